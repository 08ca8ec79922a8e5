"""The watcher of a sweep, as a type."""

from collections.abc import Callable

Watch = Callable[[str, int, int], None]
"""Hears what is being done, how many pieces of it are done, and of how many."""
