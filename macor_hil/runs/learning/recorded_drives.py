"""Learning from recordings: what a robot saw and did, taken in as if it happened now.

Frames and decisions come over two keys and may stand in a recording in any order. A decision names
the time of the frame that it was made on, and the frame after its command is the next one by
number: no order is needed to find both.
"""

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.keys import CONTROLLER, DECISION, FRAME

from macor_hil.arrays import Array, Image
from macor_hil.commands import COMMANDS
from macor_hil.errors import CameraError, RecordingError, WrongPictureError
from macor_hil.hardware.cameras.decoding import decode_picture
from macor_hil.mind.brain import Brain
from macor_hil.mind.experience import Seen
from macor_hil.mind.stored import MOST_EARNED
from macor_hil.telemetry.feed import Arrival, Event, Presence

_log = logging.getLogger(__name__)

_NAMES: Final = [command.name for command in COMMANDS]

_TICK: Final = 1e-6
"""Seconds by which the stamp of a frame may differ from the time that a decision names."""

_OUT_OF_ORDER: Final = 16
"""By how much numbers step back within a run at most; a run that begins counts from 0 again."""


class _Driven(NamedTuple):
    """Contents of a decision that are learned: its frame, its command, and the outcome."""

    frame_time: float
    command: int
    reinforcement: float
    collided: bool


@dataclass
class _Run:
    """Frames and decisions of one run of a controller.

    Attributes:
        frames: untuned features by the frames' numbers.
        decisions: by their numbers.
        newest: greatest number of a frame so far.
    """

    frames: dict[int, Array] = field(default_factory=dict)
    decisions: dict[int, _Driven] = field(default_factory=dict)
    newest: int = -1
    _numbers: dict[int, int] = field(default_factory=dict)

    def number_at(self, time: float) -> int | None:
        """Return the number of the frame of a time, or None."""
        tick = round(time / _TICK)
        near = (self._numbers.get(tick + k) for k in (0, -1, 1))
        return next((number for number in near if number is not None), None)

    def cannot_have(self, number: int, time: float) -> bool:
        """Return whether a frame of this number and time must be of another run."""
        taken = number in self.frames and self.number_at(time) != number
        return taken or number < self.newest - _OUT_OF_ORDER

    def add(self, number: int, time: float, features: Array) -> None:
        """Add a frame."""
        self.frames[number] = features
        self._numbers[round(time / _TICK)] = number
        self.newest = max(self.newest, number)


def learn(brain: Brain, recordings: Iterable[Iterable[Event]], rng: np.random.Generator) -> int:
    """Tune a brain's eyes to what was seen, then learn what followed what; tell what is left out.

    Args:
        brain: a new one; changed in place.
        recordings: events of recorded drives.
        rng: see `Brain.tune`.

    Returns:
        How many commands were learned from.

    Raises:
        RecordingError: there is no decision with its frames among the events.
        CameraError: no frame fits the mirror of the brain's settings.
    """
    left_out = Counter[str]()
    runs = [run for events in recordings for run in _runs(brain, events, left_out)]
    drives = [list(_moments(run, left_out)) for run in runs]
    driven = sum(moment.command is not None for drive in drives for moment in drive)
    if left_out:
        what = "; ".join(f"{reason}: {count:,}" for reason, count in left_out.items())
        _log.warning("left out: %s", what)
    if not driven:
        raise RecordingError("there is no decision with the frames before and after it")
    brain.tune(np.array([moment.raw for drive in drives for moment in drive]), rng)
    for drive in drives:
        brain.relive(drive)
    return driven


def _runs(brain: Brain, events: Iterable[Event], left_out: Counter[str]) -> list[_Run]:
    """Sort frames and decisions into the runs that they are of.

    Raises:
        CameraError: no frame fits the mirror of the brain's settings.
    """
    runs, misfit = [_Run()], None
    for event in events:
        if isinstance(event, Presence):
            # not while a run has but begun: its first frame may have come before
            if event.side == CONTROLLER and event.alive and runs[-1].decisions:
                runs.append(_Run())
        elif event.leaf == DECISION.leaf:
            _add_decision(runs, event, left_out)
        elif event.leaf == FRAME.leaf:
            try:
                _add_frame(runs, event, brain, left_out)
            except CameraError as error:
                left_out["frames that do not fit the mirror"] += 1
                misfit = misfit or error
    if misfit is not None and not any(run.frames for run in runs):
        raise misfit
    return runs


def _add_frame(runs: list[_Run], event: Arrival, brain: Brain, left_out: Counter[str]) -> None:
    """Add a frame to its run, which may be a new one.

    Raises:
        CameraError: it does not fit the mirror of the brain's settings.
    """
    image = _decoded(event.data)
    if event.stamp is None or image is None:
        left_out["frames without a picture or a stamp"] += 1
        return
    number, time = event.stamp.sequence, event.stamp.time
    if runs[-1].cannot_have(number, time):
        runs.append(_Run())
    runs[-1].add(number, time, brain.look(image))


def _add_decision(runs: list[_Run], event: Arrival, left_out: Counter[str]) -> None:
    """Add a decision to its run, which may be a new one."""
    try:
        decision = Decision.parse(event.data)
    except ValueError:
        decision = None
    if (
        decision is None
        or decision.command not in _NAMES
        or abs(decision.reinforcement) > MOST_EARNED
    ):
        left_out["decisions that cannot be read"] += 1
        return
    command = _NAMES.index(decision.command)
    driven = _Driven(decision.frame_time, command, decision.reinforcement, decision.collided)
    if runs[-1].decisions.setdefault(decision.sequence, driven) != driven:
        runs.append(_Run(decisions={decision.sequence: driven}))


def _decoded(data: bytes) -> Image | None:
    try:
        return decode_picture(data, "a recorded frame is no picture")
    except WrongPictureError:
        return None


def _moments(run: _Run, left_out: Counter[str]) -> Iterator[Seen]:
    """Return frames in the order in which they were seen, with the decision between each two."""
    last: int | None = None
    for _, driven in sorted(run.decisions.items()):
        number = run.number_at(driven.frame_time)
        if number is None:
            left_out["decisions without the frame before them"] += 1
            continue
        after = run.frames.get(number + 1)
        if after is None:
            left_out["decisions without the frame after them"] += 1
            continue
        if number != last:
            yield Seen(run.frames[number])
        yield Seen(after, driven.command, driven.collided, driven.reinforcement)
        last = number + 1
