"""Ctrl-C, SIGTERM, a closed terminal: one KeyboardInterrupt that can be held back.

A program takes the signals over with an `Interruption`. In a library (a notebook, a learner of
one's own) they stay its owner's; `unwind_on_signals` only keeps them from ending the process
without a stop of the robot, and `undisturbed` holds them back while the robot is being stopped.
"""

import _thread
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from types import FrameType
from typing import Final, Self

from khepera_protocol.system.signals import SIGNALS, is_hangup

_LOCKING: Final = ("threading", "queue")
"""Modules written in Python whose locks an exception at any place may leave locked."""

_AGAIN: Final = 0.02
"""Seconds after which an exception that was not raised within them is tried again."""

_TRIES: Final = 10
"""Times that it is tried: whoever is there longer than that waits, and locks nothing."""

_ORDERLY: Final = 1.0
"""Seconds after an interrupt for which no other one comes."""

_KILLED: Final = 128
"""Exit status of a process that a signal ended, less the signal's number."""


class Interruption:
    """Raises KeyboardInterrupt wherever the main thread waits when the process is told to end.

    The first signal holds back those of the next second, so that whoever was interrupted can put
    things in order undisturbed; later ones raise again, because a KeyboardInterrupt may get lost.
    `hold` holds back all until `release`. A signal that comes within a lock written in Python is
    raised right after it. Outside the main thread nothing is done. SIGINT is taken over even where
    a shell has it ignored (a script's background job), SIGHUP is not (`nohup`).

    Args:
        told: another way of being told to end: its name, or nothing, whenever `check` asks.

    Attributes:
        name: of the first signal that came, such as SIGTERM, or of who asked; empty before.
        kept: what is to be told of the work that was cut short.
    """

    def __init__(self, told: Callable[[], str] = str) -> None:
        self.name = ""
        self.kept = ""
        self._told = told
        self._held = False
        self._raised = -inf
        self._tries = 0
        self._before: dict[signal.Signals, signal._HANDLER] = {}

    def __enter__(self) -> Self:
        if _in_main_thread():
            self._before = {
                number: signal.signal(number, self._come)
                for number in _from_python()
                if not is_hangup(number) or signal.getsignal(number) is not signal.SIG_IGN
            }
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
        self.name = self.name or self._told()
        if self.name:
            self._tries = 0
            raise KeyboardInterrupt

    def hold(self) -> None:
        """Let no signal through until `release`."""
        self._held = True

    def release(self) -> None:
        """Let signals through again."""
        self._held = False
        self._raised = -inf

    def _come(self, number: int, frame: FrameType | None) -> None:
        self.name = self.name or signal.Signals(number).name
        now = time.monotonic()
        if self._held or now - self._raised <= _ORDERLY:
            return
        if self._tries < _TRIES and _may_lock(frame):
            self._tries += 1
            # no Thread, whose beginning takes one of those locks
            _thread.start_new_thread(self._come_again, (number,))
            return
        self._raised, self._tries = now, 0
        raise KeyboardInterrupt

    def _come_again(self, number: int) -> None:
        time.sleep(_AGAIN)
        if self._tries:  # nobody has raised it meanwhile
            _send_to_main_thread(number)


def _send_to_main_thread(number: int) -> None:
    """Send a signal again, which ends a wait, too; where there are none, the handler is called."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(signal.Signals(number))


def _may_lock(frame: FrameType | None) -> bool:
    """Tell whether a frame is within a Condition, an Event or a Queue, such as those of pySerial.

    What they lock between two lines of Python would stay locked, and the stop of the robot hang.
    """
    while frame is not None:
        if frame.f_globals.get("__name__") in _LOCKING:
            return True
        frame = frame.f_back
    return False


def interruption_in_charge() -> Interruption | None:
    """Return the interruption that has taken the signals over, or None."""
    owner = getattr(signal.getsignal(signal.SIGTERM), "__self__", None)
    return owner if isinstance(owner, Interruption) else None


@contextmanager
def signals_taken_over() -> Iterator[Interruption]:
    """Give the interruption in charge, or a new one for as long as the context lasts."""
    if interruption := interruption_in_charge():
        yield interruption
    else:
        with Interruption() as interruption:
            yield interruption


@contextmanager
def undisturbed() -> Iterator[None]:
    """Hold signals back meanwhile; outside the main thread, which they never reach, do nothing.

    An interruption in charge keeps the first name for its next `check`. To any other handler what
    came is sent again afterwards.
    """
    if not _in_main_thread():
        yield
    elif interruption := interruption_in_charge():
        interruption.hold()
        try:
            yield
        finally:
            interruption.release()
    else:
        came: list[int] = []
        before = {n: signal.signal(n, lambda n, _: came.append(n)) for n in _from_python()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            for n in came:
                signal.raise_signal(n)


@contextmanager
def unbroken() -> Iterator[None]:
    """Hold signals back meanwhile, and be interrupted right afterwards if one has come."""
    with undisturbed():
        yield
    if interruption := interruption_in_charge():
        interruption.check()


def unwind_on_signals() -> None:
    """Let signals end the process by SystemExit where they would kill it at once.

    Then contexts, destructors and exit handlers run, and stop the robot. Handlers that are there
    already stay, and so does this one.
    """
    if not _in_main_thread():
        return
    for number in SIGNALS:
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, _exit)


def _exit(number: int, _: FrameType | None) -> None:
    raise SystemExit(_KILLED + number)


def _from_python() -> list[signal.Signals]:
    """Signals but for those whose handler is another language's and could not be put back."""
    return [number for number in SIGNALS if signal.getsignal(number) is not None]


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
