"""Descriptors above 1023, which a process has where others before it left a thousand open.

pySerial waits with `select`, which has no place for them and fails, or worse. `poll` has.
"""

import select
from collections.abc import Sequence
from math import ceil
from types import SimpleNamespace
from typing import Any


def let_pyserial_poll() -> None:
    """Have pySerial's devices and sockets wait with `poll`, where they do not yet."""
    if not hasattr(select, "poll"):  # Windows, which has no such limit
        return
    from serial import serialposix
    from serial.urlhandler import protocol_socket

    modules: tuple[Any, ...] = (serialposix, protocol_socket)
    for module in modules:
        if module.select is select:
            module.select = SimpleNamespace(**{**vars(select), "select": _select})


def _select(
    readers: Sequence[Any], writers: Sequence[Any], _: Sequence[Any], seconds: float | None
) -> tuple[list[Any], list[Any], list[Any]]:
    """Do as `select.select`, without its limit; exceptional conditions are not asked for."""
    poll = select.poll()
    for waiting, event in ((readers, select.POLLIN), (writers, select.POLLOUT)):
        for each in waiting:
            poll.register(each, event)
    limit = None if seconds is None else ceil(1000 * max(0.0, seconds))
    # who has ended is ready: reading or writing says so
    ready = {descriptor for descriptor, _ in poll.poll(limit)}
    return (
        [r for r in readers if _number(r) in ready],
        [w for w in writers if _number(w) in ready],
        [],
    )


def _number(file: Any) -> int:
    return file if isinstance(file, int) else int(file.fileno())
