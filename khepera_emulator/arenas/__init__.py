"""Arenas as files: the bundled ones, and how one is read and written."""
