"""Robots for the tests of programs that drive a Khepera: a Python API and a plugin of pytest."""
