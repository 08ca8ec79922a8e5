"""Learning from recordings: what a robot saw and did, taken in as if it happened now."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from macor_hil.arrays import Array
from macor_hil.commands import COMMANDS, FIRST_COMMAND
from macor_hil.errors import RecordingError
from macor_hil.mind.brain import Brain
from macor_hil.mind.experience import Experience
from macor_hil.mind.experience import Moment as Seen
from macor_hil.telemetry.feed import Arrival, Event
from macor_hil.telemetry.keys import DECISION, FRAME
from macor_hil.telemetry.schemas import Decision

_SAME_TIME = 1e-6
"""Seconds by which the stamp of a frame may differ from the time that a decision names."""


class Moment(NamedTuple):
    """A view and what led to it.

    Attributes:
        raw: untuned features of the frame.
        command: index of the command that led to it; None where a drive began.
        reinforcement: what that command earned.
        collided: whether it ended in a collision.
    """

    raw: Array
    command: int | None
    reinforcement: float
    collided: bool


def learn(brain: Brain, recordings: Iterable[Sequence[Event]], rng: np.random.Generator) -> int:
    """Tune a brain's eyes to what was seen, then learn what followed what.

    Args:
        brain: a new one; changed in place.
        recordings: events of recorded drives.
        rng: see `Brain.tune`.

    Returns:
        How many commands were learned from.

    Raises:
        RecordingError: there is no decision with its frames among the events.
        CameraError: the frames do not fit the mirror of the brain's settings.
    """
    drives = [list(_moments(brain, events)) for events in recordings]
    driven = sum(moment.command is not None for drive in drives for moment in drive)
    if not driven:
        raise RecordingError("there is no decision with the frames before and after it")
    brain.tune(np.array([moment.raw for drive in drives for moment in drive]), rng)
    for drive in drives:
        before: Seen | None = None
        for moment in drive:
            command = FIRST_COMMAND if moment.command is None else moment.command
            after = brain.perceive(moment.raw, command, learn=True)
            if before is not None and moment.command is not None:
                r, collided = moment.reinforcement, moment.collided
                brain.learn(Experience(before, command, after, r, collided))
            before = after
    return driven


def _moments(brain: Brain, events: Sequence[Event]) -> Iterator[Moment]:
    """Frames in the order in which they were seen, with the decision between each two."""
    names = [command.name for command in COMMANDS]
    last: float | None = None
    seen: list[tuple[float, Array]] = []
    for event in events:
        if not isinstance(event, Arrival):
            continue
        if event.leaf == FRAME and event.stamp:
            image = cv2.imdecode(np.frombuffer(event.data, np.uint8), cv2.IMREAD_COLOR)
            if image is not None:
                seen.append((event.stamp.time, brain.look(np.asarray(image, dtype=np.uint8))))
        elif event.leaf == DECISION:
            decision = Decision.model_validate_json(event.data)
            # the frame after a command was taken before its decision is told
            if len(seen) < 2 or abs(seen[-2][0] - decision.frame_time) > _SAME_TIME:
                continue  # a frame did not arrive
            if seen[-2][0] != last:
                yield Moment(seen[-2][1], None, 0.0, False)
            command = names.index(decision.command)
            yield Moment(seen[-1][1], command, decision.reinforcement, decision.collided)
            last = seen[-1][0]
