"""`macor-hil record`: a subscriber that writes all events of a robot to a file."""

import time
from contextlib import ExitStack
from math import inf
from pathlib import Path
from typing import Final, NamedTuple, Self

import zenoh

from macor_hil.telemetry.feed import Feed, Loss, NotTaken, Refusal
from macor_hil.telemetry.recordings.recording import Recorder

_LOOK: Final = 0.2
"""Seconds after which an idle recorder looks at the clock."""


class Recorded(NamedTuple):
    """The outcome of a recording: samples that were written, and those that were not taken."""

    samples: int
    not_taken: NotTaken


def record(
    session: zenoh.Session, robot: str, path: Path, duration: float | None = None
) -> Recorded:
    """Record a robot until Ctrl-C; it may come, go and come again.

    Args:
        session: an open session.
        robot: the robot's name in the keys.
        path: the file, replaced if it is there.
        duration: seconds after which to end; None: never.

    Raises:
        TelemetryError: the name cannot be part of a key.
        RecordingError: the file cannot be written, or the disk is full. What was recorded before
            can be read.
    """
    end = inf if duration is None else time.monotonic() + duration
    with LiveRecorder(session, robot, path) as recorder:
        try:
            while (left := end - time.monotonic()) > 0.0:
                recorder.take(min(left, _LOOK))
        except KeyboardInterrupt:
            pass  # the way to end it
        return recorder.recorded


class LiveRecorder:
    """Records a robot as often as it is asked to; use as a context.

    Args:
        session, robot, path: see `record`.

    Raises:
        TelemetryError, RecordingError: see `record`.
    """

    def __init__(self, session: zenoh.Session, robot: str, path: Path) -> None:
        self._not_taken = NotTaken()
        with ExitStack() as stack:
            self._recorder = stack.enter_context(Recorder(path, robot))
            self._feed = stack.enter_context(Feed(session, robot, camera=True))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.__exit__(*error)  # type: ignore[arg-type]

    @property
    def recorded(self) -> Recorded:
        """The outcome so far."""
        return Recorded(self._recorder.samples, self._not_taken)

    def take(self, seconds: float) -> None:
        """Write down what comes for a time, and at least what has come already.

        Raises:
            RecordingError: the disk is full, or gone.
        """
        end = time.monotonic() + seconds
        while True:
            event = self._feed.get(max(0.0, end - time.monotonic()))
            if event is None:
                return
            if isinstance(event, Loss | Refusal):
                self._not_taken.count(event)
            else:
                self._recorder.write(event)
            if time.monotonic() > end + _LOOK:
                return  # what comes may come faster than it is written
