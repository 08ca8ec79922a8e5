"""The interface of planners."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Moment


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A hypothetical sequence that was weighed.

    Attributes:
        neurons: what it goes through, without the start.
        evaluation: what it is worth to the planner.
    """

    neurons: tuple[int, ...]
    evaluation: float


@dataclass(frozen=True, slots=True)
class Plan:
    """The outcome of planning.

    Attributes:
        evaluations: value of each command, None for commands never tried here.
        command: index of the best one, or None when no command was ever tried here.
        sequence: neurons of the best hypothetical sequence, without the start.
        steps: wave steps that were run.
        hypotheses: sequences that were weighed, each first transition with its best continuation,
            the best one first; for those who watch.
        activities: activity of every neuron after the wave; empty for planners without one.
    """

    evaluations: tuple[float | None, ...]
    command: int | None
    sequence: tuple[int, ...] = ()
    steps: int = 0
    hypotheses: tuple[Hypothesis, ...] = ()
    activities: tuple[float, ...] = ()


NO_PLAN: Final = Plan((None,) * len(COMMANDS), None)
"""Nothing is evaluated, and no command chosen."""


class Planner(Protocol):
    """A way of choosing the next command.

    All parameters of its constructor are settings, with defaults.
    """

    @property
    def memory(self) -> str:
        """Name of the memory that it reads."""
        ...

    def plan(self, memory: Any, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present moment.

        Args:
            memory: the one that it asked for; not changed.
            now: what the robot sees, and the neuron it is in.
        """
        ...


@dataclass(frozen=True, slots=True)
class Aim:
    """A goal that a planner drives to, as the camera sees it at a moment.

    Attributes:
        name: of the goal.
        bearing: direction in which it is seen, radians to the left of straight ahead; None: it is
            not seen.
        reached: whether the robot is there.
        ends: whether a drive ends there.
    """

    name: str
    bearing: float | None = None
    reached: bool = False
    ends: bool = True


@runtime_checkable
class Aiming(Protocol):
    """Planners that may drive to a goal."""

    def aim(self, now: Moment) -> Aim | None:
        """Return the goal as it is seen at a moment; None: there is none."""
        ...


@runtime_checkable
class Preparing(Protocol):
    """Planners that think about a memory before the first decision."""

    def prepare(self, memory: Any) -> None:
        """Do what is done once for a memory, and may take seconds."""
        ...


def aim_of(planner: Planner, now: Moment) -> Aim | None:
    """Return a planner's goal as it is seen at a moment; None: it has none."""
    return planner.aim(now) if isinstance(planner, Aiming) else None


def is_over(aim: Aim | None) -> bool:
    """Tell whether a drive ends because its goal is reached."""
    return aim is not None and aim.reached and aim.ends


def ranked(hypotheses: Iterable[Hypothesis], commands: int) -> tuple[Hypothesis, ...]:
    """Sort hypotheses from the best to the worst; at a tie as `best_command`, then as given."""

    def rank(hypothesis: Hypothesis) -> tuple[float, int]:
        return -hypothesis.evaluation, hypothesis.neurons[0] % commands

    return tuple(sorted(hypotheses, key=rank))


def best_ends(
    weighed: Iterable[tuple[int, float]], commands: int
) -> tuple[list[float | None], list[int]]:
    """Return each command's best value, and the neuron that it leads to (None and -1: none).

    Args:
        weighed: neurons that can follow, each with what that is worth; the first one wins a tie.
        commands: m.
    """
    best: list[float | None] = [None] * commands
    ends = [-1] * commands
    for i, value in weighed:
        before = best[i % commands]
        if before is None or value > before:
            best[i % commands], ends[i % commands] = value, i
    return best, ends


def best_command(evaluations: tuple[float | None, ...]) -> int | None:
    """Return the command of the greatest evaluation, the first one at a tie."""
    known = [(value, -a) for a, value in enumerate(evaluations) if value is not None]
    return -max(known)[1] if known else None
