"""What a watcher knows of a controller: gathered from its samples, without Zenoh or terminal."""

from collections import deque
from dataclasses import dataclass, field

from macor_hil.telemetry.schemas import Decision, State

_RATE_OVER = 12
"""Samples that a rate is taken over."""

_HISTORY = 60
"""Reinforcements kept for the curve."""


class Arrivals:
    """When the samples of a stream arrived, in seconds of any clock."""

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_RATE_OVER)

    def add(self, now: float) -> None:
        """A sample has arrived."""
        self._times.append(now)

    @property
    def rate(self) -> float | None:
        """Samples a second; None before there are two at different times."""
        if len(self._times) < 2 or self._times[-1] <= self._times[0]:
            return None
        return (len(self._times) - 1) / (self._times[-1] - self._times[0])

    def age(self, now: float) -> float | None:
        """Seconds since the last one; None without one."""
        return now - self._times[-1] if self._times else None


@dataclass
class Watched:
    """One controller, as seen from outside; for another one, begin another.

    Attributes:
        robot: the robot's name in the keys.
        alive: whether a controller is there.
        met: whether it was ever there.
        state, decision: the latest ones.
        reinforcements: of the decisions seen, oldest first.
        missed: decisions that were made and did not arrive.
        decisions, frames: arrivals.
        frame_bytes: size of the last frame.
        trouble: what could not be read, empty when all could.
    """

    robot: str
    alive: bool = False
    met: bool = False
    state: State | None = None
    decision: Decision | None = None
    reinforcements: deque[float] = field(default_factory=lambda: deque(maxlen=_HISTORY))
    missed: int = 0
    decisions: Arrivals = field(default_factory=Arrivals)
    frames: Arrivals = field(default_factory=Arrivals)
    frame_bytes: int = 0
    trouble: str = ""

    def decide(self, decision: Decision, now: float | None) -> None:
        """A decision has arrived, now or, where that is None, some time ago."""
        last = self.decision
        if last is None or decision.sequence <= last.sequence:
            self.reinforcements.clear()  # a run begins, or watching does
        else:
            self.missed += decision.sequence - last.sequence - 1
        self.decision = decision
        self.reinforcements.append(decision.reinforcement)
        if now is not None:
            self.decisions.add(now)

    def see(self, size: int, now: float) -> None:
        """A frame of so many bytes has arrived."""
        self.frame_bytes = size
        self.frames.add(now)
