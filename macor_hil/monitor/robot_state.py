"""The state of a robot, gathered from events; no Zenoh, terminal or browser."""

from collections import deque
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from khepera_protocol.zenoh.controller_payloads import (
    Decision,
    Learned,
    Link,
    Phase,
    State,
)
from khepera_protocol.zenoh.keys import CAMERA, EMULATOR, FRAME, PAYLOADS
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.payloads import (
    USUAL_ROBOT,
    Outline,
    Pose,
    Truth,
    Wire,
)

from macor_hil.hardware.robots.form import Form
from macor_hil.hardware.robots.forms import form_of
from macor_hil.monitor.line_state import LineState
from macor_hil.monitor.way import Way
from macor_hil.telemetry.feed import Arrival, Heard, Loss, NotTaken, Presence, Refusal

_RATE_OVER: Final = 12
"""Samples that a rate is taken over."""

_HISTORY: Final = 2000
"""Decisions kept for curves and paths."""

_MARKS: Final = 200
"""Collisions and failures kept."""

_STOPPED: Final = 2.0
"""Seconds, and three times the usual pause, after which a stream has stopped."""

_NS: Final = 1e-9


class MarkKind(StrEnum):
    """Kinds of what is marked on a way."""

    COLLISION = "collision"
    CONTACT = "contact"
    FAILURE = "failure"


@dataclass(frozen=True, slots=True)
class Mark:
    """A collision, the touch of a wall, or a failure.

    Attributes:
        kind: which of them.
        sequence: the decision that it belongs to; None: no controller drove.
        pose: where the robot was; None: unknown.
        words: what is known of it.
    """

    kind: MarkKind
    sequence: int | None
    pose: Pose | None
    words: str


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
        way: where it was since it was put there.
        truths: times of its clock and poses, of late.
        line: its serial line.
    """

    alive: bool = False
    outline: Outline | None = None
    truth: Truth | None = None
    way: Way = field(default_factory=Way)
    truths: deque[tuple[float, Pose]] = field(default_factory=lambda: deque(maxlen=600))
    line: LineState = field(default_factory=LineState)

    def place(self, truth: Truth) -> None:
        """Take in a ground truth."""
        self.truth = truth
        self.truths.append((truth.time, truth.pose))
        self.way.add(truth.pose)

    def pose_at(self, time: float) -> Pose | None:
        """Return the robot's pose at a time of its clock; None if it is not known."""
        if not self.truths:
            return None
        when, pose = min(self.truths, key=lambda known: abs(known[0] - time))
        return pose if abs(when - time) < 0.5 else None


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
        marks: collisions and failures, oldest first.
        left: when the controller went, on the clock of the arrivals; None: it is there, or never
            was.
        not_taken: samples that were refused or lost.
        version: counts what came.
    """

    robot: str
    controlled: Controlled = field(default_factory=Controlled)
    emulated: Emulated = field(default_factory=Emulated)
    frame: bytes = b""
    frames: Arrivals = field(default_factory=Arrivals)
    marks: deque[Mark] = field(default_factory=lambda: deque(maxlen=_MARKS))
    left: float | None = None
    not_taken: NotTaken = field(default_factory=NotTaken)
    version: int = 0

    @property
    def form(self) -> Form:
        """The form of its kind, as whoever drives it or emulates it tells."""
        state, outline = self.controlled.state, self.emulated.outline
        if outline is not None:
            return form_of(outline.robot_kind)
        return form_of(state.robot_kind if state is not None else USUAL_ROBOT)

    @property
    def kind(self) -> str:
        """Its kind and, where it is told, its model, for people."""
        outline = self.emulated.outline
        model = outline.robot_model if outline is not None else ""
        return f"{self.form.title} ({model})" if model else self.form.title

    @property
    def radius(self) -> float:
        """The radius of its body, metres."""
        outline = self.emulated.outline
        return outline.robot_radius if outline is not None else self.form.radius

    @property
    def counters(self) -> tuple[int, ...] | None:
        """The wheels' counters: as its line tells them, or else as the driver counts."""
        decision = self.controlled.decision
        if self.emulated.line.counters is not None:
            return self.emulated.line.counters
        return decision.odometry.counters if decision else None

    @property
    def alive(self) -> bool:
        """True while either side is there."""
        return self.controlled.alive or self.emulated.alive

    def take(self, event: Heard) -> None:
        """Take in an event; what cannot be read is trouble, and no more."""
        self.version += 1
        match event:
            case Presence():
                self._meet(event.side, event.received * _NS, alive=event.alive)
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

    def _meet(self, side: str, now: float, *, alive: bool) -> None:
        if side == EMULATOR:
            if alive:
                self.emulated = Emulated()
            self.emulated.alive = alive
        else:
            if alive:
                self.controlled, self.not_taken.last = Controlled(met=True), ""
            self.controlled.alive = alive
            self.left = None if alive else now

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
                self._decide(payload, now)
            case State():
                self._enter(payload)
            case Learned():
                self.controlled.learned = payload
            case Link():
                self.controlled.link = payload
            case Truth():
                self._place(payload)
            case Outline():
                self.emulated.outline = payload
            case Wire():
                self.emulated.line.take(payload, now)

    def _decide(self, decision: Decision, now: float | None) -> None:
        self.controlled.decide(decision, now)
        if decision.sequence == 0:
            self.marks.clear()  # another run
        if decision.collided:
            words = f"collision at command {decision.sequence}"
            self.marks.append(Mark(MarkKind.COLLISION, decision.sequence, self.pose, words))

    def _enter(self, state: State) -> None:
        before, self.controlled.state = self.controlled.state, state
        news = before is None or (before.phase, before.reason) != (state.phase, state.reason)
        if news and state.phase in (Phase.RECOVERING, Phase.FAILED):
            words = f"{state.phase.value}: {state.reason}"
            self.marks.append(Mark(MarkKind.FAILURE, state.driven, self.pose, words))

    def _place(self, truth: Truth) -> None:
        before = self.emulated.truth
        self.emulated.place(truth)
        if truth.contact and not (before and before.contact):
            decision = self.controlled.decision if self.controlled.alive else None
            number = decision.sequence + 1 if decision else None
            words = "the body touched something"
            self.marks.append(Mark(MarkKind.CONTACT, number, truth.pose, words))

    @property
    def pose(self) -> Pose | None:
        """The robot's pose: the true one if it is told, else that of its encoders; None: unknown.

        A robot without an emulator begins at the origin.
        """
        if self.emulated.truth:
            return self.emulated.truth.pose
        return self.controlled.decision.odometry.pose if self.controlled.decision else None
