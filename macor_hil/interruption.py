"""Ctrl-C, SIGTERM and a closed terminal become one KeyboardInterrupt that can be held back."""

import signal
import threading
from types import FrameType
from typing import Final, Self

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """Raises KeyboardInterrupt wherever the main thread waits when the process is told to end.

    The first signal holds back all later ones, so that whoever was interrupted can put things
    in order undisturbed, until `release`. Outside the main thread it does nothing.

    Attributes:
        name: of the first signal that came, such as SIGTERM, or of who asked; empty before.
    """

    def __init__(self) -> None:
        self.name = ""
        self._held = False
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._come) for number in _SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def ask(self, name: str) -> None:
        """End at the next `check`; for other threads."""
        self.name = self.name or name

    def check(self) -> None:
        """Raise KeyboardInterrupt if a signal has come, or somebody asked.

        A KeyboardInterrupt that hits a destructor or a library's callback gets lost there.
        """
        if self.name:
            raise KeyboardInterrupt

    def hold(self) -> None:
        """Let no signal through until `release`."""
        self._held = True

    def release(self) -> None:
        """Let signals through again."""
        self._held = False

    def _come(self, number: int, _: FrameType | None) -> None:
        self.name = self.name or signal.Signals(number).name
        if not self._held:
            self._held = True
            raise KeyboardInterrupt
