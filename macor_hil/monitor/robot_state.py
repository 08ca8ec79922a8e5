"""The state of a robot, gathered from events; no Zenoh, terminal or browser."""

from collections import deque
from dataclasses import dataclass, field
from math import hypot
from typing import Final

from khepera_protocol.zenoh.controller_payloads import (
    Decision,
    Learned,
    Link,
    State,
)
from khepera_protocol.zenoh.keys import CAMERA, EMULATOR, FRAME, PAYLOADS
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.payloads import (
    Outline,
    Pose,
    Truth,
    Wire,
    WireEntry,
)

from macor_hil.telemetry.feed import Arrival, Heard, Loss, NotTaken, Presence, Refusal

_RATE_OVER: Final = 12
"""Samples that a rate is taken over."""

_HISTORY: Final = 2000
"""Decisions kept for curves and paths."""

_WIRE_HISTORY: Final = 200
"""Entries of the wire log kept."""

_STEP: Final = 0.002
"""Metres that the robot moves before its path gets another point."""

_PATH: Final = 5_000
"""Points of its path that are kept: ten metres and more."""

_STOPPED: Final = 2.0
"""Seconds, and three times the usual pause, after which a stream has stopped."""

_DRIVES: Final = ("C", "D", "P")
"""Letters of requests that turn the wheels."""

_TURNS: Final = 0.004
"""m/s from which on a wheel turns."""

_LATELY: Final = 5.0
"""Seconds for which a request tells that a program is on the line."""

_JUMP: Final = 0.05
"""Metres between two truths beyond which the robot was put there."""

_NS: Final = 1e-9


class Arrivals:
    """The times at which samples of a stream arrived, in seconds of any clock."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_RATE_OVER)

    def add(self, now: float) -> None:
        """Add the arrival of a sample."""
        self._times.append(now)

    def rate(self, now: float) -> float | None:
        """Return samples a second, 0 once they have stopped; None before there are two."""
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        pause = (self._times[-1] - self._times[0]) / (len(self._times) - 1)
        return 0.0 if now - self._times[-1] > max(_STOPPED, 3 * pause) else 1 / pause

    def age(self, now: float) -> float | None:
        """Return seconds since the last one; None without one."""
        return max(0.0, now - self._times[-1]) if self._times else None


@dataclass
class Emulated:
    """The emulator's side, as seen from outside.

    Attributes:
        alive: whether an emulator is there.
        outline: its arena.
        truth: where the robot is.
        path: where it was, oldest first, since it was put there.
        truths: times of its clock and poses, of late.
        wire: the latest entries of its serial line.
        wire_bytes: bytes that have passed since watching began.
        asked, driven: when a request came on its line, and one that drives, on the clock of the
            arrivals; None: never.
    """

    alive: bool = False
    outline: Outline | None = None
    truth: Truth | None = None
    path: deque[Pose] = field(default_factory=lambda: deque(maxlen=_PATH))
    truths: deque[tuple[float, Pose]] = field(default_factory=lambda: deque(maxlen=600))
    wire: deque[WireEntry] = field(default_factory=lambda: deque(maxlen=_WIRE_HISTORY))
    wire_bytes: int = 0
    asked: float | None = None
    driven: float | None = None

    def place(self, truth: Truth) -> None:
        """Take in a ground truth."""
        self.truth = truth
        self.truths.append((truth.time, truth.pose))
        way = _distance(self.path[-1], truth.pose) if self.path else 0.0
        if way > _JUMP:
            self.path.clear()
        if not self.path or way >= _STEP:
            self.path.append(truth.pose)

    def pose_at(self, time: float) -> Pose | None:
        """Return the robot's pose at a time of its clock; None if it is not known."""
        if not self.truths:
            return None
        when, pose = min(self.truths, key=lambda known: abs(known[0] - time))
        return pose if abs(when - time) < 0.5 else None

    def pass_by(self, wire: Wire, now: float | None) -> None:
        """Take in what has passed on the line."""
        self.wire.extend(wire.entries)
        for entry in wire.entries:
            if entry.what in ("request", "reply"):
                self.wire_bytes += len(entry.text)
            if entry.what == "request":
                self.asked = now
                if any(line.startswith(_DRIVES) for line in entry.text.splitlines()):
                    self.driven = now

    def client(self, now: float) -> str:
        """Return what a program does that is no controller of ours; empty without one."""
        turns = self.truth is not None and any(abs(v) > _TURNS for v in self.truth.speed)
        if not self.alive:
            return ""
        if turns or _lately(self.driven, now):
            return "a program that tells nothing of itself drives it"
        return "a program talks to it" if _lately(self.asked, now) else ""


@dataclass
class Controlled:
    """The controller's side, as seen from outside; for another controller, begin another.

    Attributes:
        alive: whether a controller is there.
        met: whether it was ever there.
        state, decision, learned, link: the latest ones.
        history: decisions of the run, as far as they were seen, oldest first.
        missed: decisions that were made and did not arrive.
        decisions: arrivals.
    """

    alive: bool = False
    met: bool = False
    state: State | None = None
    decision: Decision | None = None
    learned: Learned | None = None
    link: Link | None = None
    history: deque[Decision] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    missed: int = 0
    decisions: Arrivals = field(default_factory=Arrivals)

    def decide(self, decision: Decision, now: float | None) -> None:
        """Take in a decision that has arrived now or, where that is None, some time ago."""
        last = self.decision
        if last is None or decision.sequence <= last.sequence:
            self.history.clear()  # a run begins, or watching does
        else:
            self.missed += decision.sequence - last.sequence - 1
        self.decision = decision
        self.history.append(decision)
        if now is not None:
            self.decisions.add(now)


@dataclass
class RobotState:
    """The state of one robot, as seen from outside.

    Attributes:
        robot: its name in the keys.
        controlled, emulated: what is known of either side, the one that is there or was last.
        frame: the latest picture, JPEG or PNG; the emulator's where no controller tells one.
        frames: arrivals of pictures.
        not_taken: samples that were refused or lost.
        version: counts what came.
    """

    robot: str
    controlled: Controlled = field(default_factory=Controlled)
    emulated: Emulated = field(default_factory=Emulated)
    frame: bytes = b""
    frames: Arrivals = field(default_factory=Arrivals)
    not_taken: NotTaken = field(default_factory=NotTaken)
    version: int = 0

    def take(self, event: Heard) -> None:
        """Take in an event; what cannot be read is trouble, and no more."""
        self.version += 1
        match event:
            case Presence():
                self._meet(event.side, alive=event.alive)
            case Loss() | Refusal():
                self.not_taken.count(event)
            case Arrival():
                try:
                    self._note(event)
                except PayloadError as error:
                    reason = f"is it of another version of macor-hil? {error}"
                    self.not_taken.count(Refusal(event.leaf, reason, event.received))

    def see(self, picture: bytes, now: float) -> None:
        """Take in a picture."""
        self.frame = picture
        self.frames.add(now)

    def _meet(self, side: str, *, alive: bool) -> None:
        if side == EMULATOR:
            if alive:
                self.emulated = Emulated()
            self.emulated.alive = alive
        else:
            if alive:
                self.controlled, self.not_taken.last = Controlled(met=True), ""
            self.controlled.alive = alive

    def _note(self, arrival: Arrival) -> None:
        now = arrival.received * _NS
        own = arrival.leaf == CAMERA.leaf and not self.controlled.alive
        if own or arrival.leaf == FRAME.leaf:
            self.see(arrival.data, now)
        elif kind := PAYLOADS.get((arrival.side, arrival.leaf)):
            self._read(kind.parse(arrival.data), now if arrival.live else None)

    def _read(self, payload: Payload, now: float | None) -> None:
        match payload:
            case Decision():
                self.controlled.decide(payload, now)
            case State():
                self.controlled.state = payload
            case Learned():
                self.controlled.learned = payload
            case Link():
                self.controlled.link = payload
            case Truth():
                self.emulated.place(payload)
            case Outline():
                self.emulated.outline = payload
            case Wire():
                self.emulated.pass_by(payload, now)


def _lately(when: float | None, now: float) -> bool:
    return when is not None and now - when < _LATELY


def _distance(a: Pose, b: Pose) -> float:
    return hypot(a.x - b.x, a.y - b.y)
