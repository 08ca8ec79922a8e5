"""A thread that sends samples in order, so that the loop that drives need not wait for it."""

import logging
from collections.abc import Callable
from queue import SimpleQueue
from typing import Final, Self

import zenoh
from pydantic import ValidationError

from macor_hil.errors import TelemetryError, TelemetryLostError
from macor_hil.safety.helper_thread import HelperThread

_log = logging.getLogger(__name__)

_PATIENCE: Final = 2.0
"""Seconds that the rest may take in the end."""

_MOST: Final = 300
"""Actions that wait at most: a minute of driving."""


class Sender:
    """A thread of its own for actions; use as a context, whose end waits for the rest.

    An action that fails by Zenoh, as telemetry may, or by a payload out of its bounds is logged,
    and the next one follows: nobody stops a robot because nobody hears of it. Any other failure is
    a defect. It ends the thread, and `check` says so.
    """

    def __init__(self) -> None:
        self._actions: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._thread = HelperThread(self._run, "sender")
        self._dropped = 0

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._actions.put(None)
        self._thread.join(_PATIENCE)
        if self._dropped:
            _log.warning("%d samples were not told: telemetry was too slow", self._dropped)

    def carry_out(self, action: Callable[[], object]) -> None:
        """Have an action carried out after all before it; drop it if too many wait."""
        if self._thread.ended():
            return
        if self._actions.qsize() < _MOST:
            self._actions.put(action)
            return
        if not self._dropped:
            _log.warning("telemetry is too slow: samples are dropped")
        self._dropped += 1

    @property
    def waiting(self) -> int:
        """Number of actions that are not yet carried out."""
        return self._actions.qsize()

    def check(self) -> None:
        """Check that actions are still carried out.

        Raises:
            TelemetryLostError: the thread has ended.
        """
        if why := self._thread.ended():
            raise TelemetryLostError(f"nothing can be told of the run any more: {why}")

    def _run(self) -> None:
        while action := self._actions.get():
            try:
                action()
            except (zenoh.ZError, TelemetryError, ValidationError):
                _log.exception("something could not be told")
