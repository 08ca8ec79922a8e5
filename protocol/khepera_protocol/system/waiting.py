"""Waiting for descriptors, with whatever the system has: `select`, `poll`, or only the former."""

import select
from collections.abc import Sequence
from math import ceil
from typing import Any, Final

_SELECTABLE: Final = 1024
"""Descriptors that `select` can wait for: those below this number."""


def readable(descriptors: Sequence[int], seconds: float) -> set[int]:
    """Wait for a time until any of some descriptors can be read; those that can.

    `select` keeps its time-out to a tenth of a millisecond; `poll` and `epoll` round it to a
    whole one, half a character at 9600. But `select` has no place for descriptors above 1023, which
    a process has that was started with a thousand open.
    """
    if max(descriptors) < _SELECTABLE or not hasattr(select, "poll"):
        return set(select.select(descriptors, (), (), seconds)[0])
    poll = select.poll()
    for descriptor in descriptors:
        poll.register(descriptor, select.POLLIN)
    return {descriptor for descriptor, _ in poll.poll(ceil(1000 * seconds))}


def is_broken(file: Any) -> bool:
    """Tell whether nobody is at the other end of a pipe or connection any more.

    Where the system has no `poll`, reading and writing tell it, and this does not.

    Args:
        file: a descriptor, or what has one.
    """
    if not hasattr(select, "poll"):
        return False
    poll = select.poll()
    poll.register(file, 0)  # errors only
    return bool(poll.poll(0))


def input_waits(descriptor: int, seconds: float) -> bool:
    """Wait for a time until a file, a terminal or a pipe can be read; True if it can.

    Where the system can wait for connections only, reading waits instead.
    """
    return not hasattr(select, "poll") or bool(readable([descriptor], seconds))
