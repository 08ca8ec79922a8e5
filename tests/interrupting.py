"""Interrupts at any place of a piece of work: after so many of its calls of C functions."""

import signal
import sys
from collections.abc import Callable
from typing import Any


def signal_after(calls: int, came: list[Any]) -> Callable[..., Any]:
    """A profile function that sends a signal after so many calls of C functions."""

    def profile(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal calls
        calls -= event == "c_return"
        if calls == 0:
            sys.setprofile(None)
            came.append(1)
            signal.raise_signal(signal.SIGINT)

    return profile


def interrupt_after(calls: int) -> None:
    """Have a KeyboardInterrupt come after so many calls of C functions, as a signal may."""
    left = calls

    def profile(_frame: Any, event: str, _argument: Any) -> None:
        nonlocal left
        left -= event == "c_return"
        if left == 0:
            sys.setprofile(None)
            raise KeyboardInterrupt

    sys.setprofile(profile)
