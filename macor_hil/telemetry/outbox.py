"""A thread that carries out what it is given, in order, so that who drives need not wait for it."""

import logging
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Final, Self

import zenoh

from macor_hil.errors import TelemetryError

_log = logging.getLogger(__name__)

_PATIENCE: Final = 2.0
"""Seconds that the rest may take in the end."""


class Outbox:
    """Carries out actions in a thread of its own; use as a context, whose end waits for the rest.

    An action that fails is logged, and the next one follows: nobody stops a robot because nobody
    hears of it.
    """

    def __init__(self) -> None:
        self._actions: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="outbox", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._actions.put(None)
        self._thread.join(_PATIENCE)

    def carry_out(self, action: Callable[[], None]) -> None:
        """Have something done soon, after all that was given before."""
        self._actions.put(action)

    def _run(self) -> None:
        while action := self._actions.get():
            try:
                action()
            except (zenoh.ZError, TelemetryError):
                _log.exception("something could not be told")
