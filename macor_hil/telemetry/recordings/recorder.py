"""`macor-hil record`: a subscriber that writes all events of a robot to a file."""

import time
from math import inf
from pathlib import Path
from typing import Final, NamedTuple

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
    not_taken = NotTaken()
    with Recorder(path, robot) as recorder, Feed(session, robot, camera=True) as feed:
        try:
            while (left := end - time.monotonic()) > 0.0:
                event = feed.get(min(left, _LOOK))
                if isinstance(event, Loss | Refusal):
                    not_taken.count(event)
                elif event is not None:
                    recorder.write(event)
        except KeyboardInterrupt:
            pass  # the way to end it
        return Recorded(recorder.samples, not_taken)
