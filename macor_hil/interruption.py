"""Ctrl-C, SIGTERM and a closed terminal become one KeyboardInterrupt that can be held back."""

import _thread
import signal
import threading
import time
from types import FrameType
from typing import Final, Self

_LOCKING: Final = ("threading", "queue")
"""Modules written in Python whose locks an exception at any place may leave locked."""

_AGAIN: Final = 0.02
"""Seconds after which an exception that was not raised within them is tried again."""

_TRIES: Final = 10
"""Times that it is tried: whoever is there longer than that waits, and locks nothing."""

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interruption:
    """Raises KeyboardInterrupt wherever the main thread waits when the process is told to end.

    The first signal holds back all later ones, so that whoever was interrupted can put things
    in order undisturbed, until `release`. Outside the main thread it does nothing. A signal that
    comes within a lock written in Python is raised right after it.

    Attributes:
        name: of the first signal that came, such as SIGTERM, or of who asked; empty before.
    """

    def __init__(self) -> None:
        self.name = ""
        self._held = False
        self._tries = 0
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._come) for number in _SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        self._tries = 0
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
            self._tries = 0
            raise KeyboardInterrupt

    def hold(self) -> None:
        """Let no signal through until `release`."""
        self._held = True

    def release(self) -> None:
        """Let signals through again."""
        self._held = False

    def _come(self, number: int, frame: FrameType | None) -> None:
        self.name = self.name or signal.Signals(number).name
        if self._held:
            return
        if self._tries < _TRIES and _may_lock(frame):
            self._tries += 1
            # no Thread, whose beginning takes one of those locks
            _thread.start_new_thread(self._come_again, (number,))
            return
        self._held, self._tries = True, 0
        raise KeyboardInterrupt

    def _come_again(self, number: int) -> None:
        time.sleep(_AGAIN)
        if self._tries:  # nobody has raised it meanwhile
            # a signal again, which ends a wait, too
            signal.pthread_kill(threading.main_thread().ident or 0, number)


def _may_lock(frame: FrameType | None) -> bool:
    """Whether a frame is within a Condition, an Event or a Queue, such as those of pySerial.

    What they lock between two lines of Python would stay locked, and the stop of the robot hang.
    """
    while frame is not None:
        if frame.f_globals.get("__name__") in _LOCKING:
            return True
        frame = frame.f_back
    return False
