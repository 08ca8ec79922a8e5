"""Signals that tell a program to end; Windows has but two of them."""

import signal
from typing import Final

_KEYS: Final = ("SIGINT", "SIGQUIT")
_OTHERS: Final = ("SIGTERM", "SIGHUP")


def _known(*names: str) -> tuple[signal.Signals, ...]:
    return tuple(signal.Signals[name] for name in names if hasattr(signal, name))


KEYS: Final = _known(*_KEYS)
"""Ctrl-C and Ctrl-\\."""

SIGNALS: Final = (*KEYS, *_known(*_OTHERS))
"""All of them: also `kill`, and a closed terminal."""


def is_hangup(number: int) -> bool:
    """Tell whether a signal is that of a closed terminal, which `nohup` has ignored."""
    return number == getattr(signal, "SIGHUP", None)
