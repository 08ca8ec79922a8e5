"""Being told to end by Ctrl-C, SIGTERM or a closed terminal (SIGHUP)."""

import signal
from collections.abc import Callable
from types import FrameType
from typing import Final, Self

from khepera_protocol.system.signals import KEYS
from khepera_protocol.system.startup import INTERRUPTED, signals_to_take

STATUS: Final = (
    "0 done, or told to end by SIGTERM or SIGHUP; 1 a replay differs; 2 failed, one sentence says"
    " why; 130 Ctrl-C."
)
"""All exit statuses, for the help text."""


class Ending:
    """Handler of signals: they raise KeyboardInterrupt, or do as `call` wants.

    Attributes:
        number: of the first signal that came; 0 before.
    """

    def __init__(self) -> None:
        self.number = 0
        self._call: Callable[[], None] | None = None
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        self._before = {each: signal.signal(each, self._come) for each in signals_to_take()}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @property
    def status(self) -> int:
        """Exit status of a program that was told to end."""
        return INTERRUPTED if self.number in KEYS else 0

    def call(self, function: Callable[[], None]) -> None:
        """From now on call a function instead, and do so at once if a signal has come already."""
        self._call = function
        if self.number:
            function()

    def hold(self) -> None:
        """From now on remember what comes, and do nothing until `call`."""
        self._call = lambda: None

    def _come(self, number: int, _: FrameType | None) -> None:
        self.number = self.number or number
        if self._call is None:
            raise KeyboardInterrupt
        self._call()
