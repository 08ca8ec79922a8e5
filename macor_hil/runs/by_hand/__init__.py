"""Driving by hand: keys of a terminal, velocities of a program."""
