"""The start of a program, before anything heavy is imported: standard files and signals."""

import os
import signal
import sys
from types import FrameType
from typing import Final

from khepera_protocol.system.signals import KEYS, SIGNALS

INTERRUPTED: Final = 130
"""Exit status after Ctrl-C or Ctrl-\\."""


def begin(program: str) -> None:
    """Open standard files that are closed; until something is made, signals end the process.

    Args:
        program: name under which an interruption is told.
    """

    def end(number: int, _: FrameType | None) -> None:
        if number in KEYS:
            os.write(2, f"{program}: interrupted\n".encode())
        os._exit(INTERRUPTED if number in KEYS else 0)

    open_standard_files()
    for number in signals_to_take():
        signal.signal(number, end)


def signals_to_take() -> list[signal.Signals]:
    """Return the signals that shall end this process.

    A script's background job ignores Ctrl-C, which a robot must not; `nohup` is obeyed.
    """
    return [
        number
        for number in SIGNALS
        if number is signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN
    ]


def ignore_signals() -> None:
    """Ignore all signals while the program ends, so that its exit status is the one it gives.

    CPython remembers a KeyboardInterrupt that left an `exec` of text, as a library's may when it is
    imported, and `python -m` then ends by SIGINT though it was handled; another `exec` forgets it.
    """
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    exec("")


def open_standard_files() -> None:
    """Open those of the three standard files that are closed, for nobody.

    Otherwise the next file that is opened, a serial line perhaps, gets what is printed.
    """
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, mode, closefd=False))  # noqa: SIM115
