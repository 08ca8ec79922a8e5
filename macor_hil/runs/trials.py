"""Trials: from a start, up to 40 commands or until a collision, scored as in table 1."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from math import radians

import numpy as np
from khepera_protocol.zenoh.payloads import Pose, Reset, Truth

from macor_hil.commands import COMMANDS
from macor_hil.hardware.bench import Bench
from macor_hil.mind.planners.planner import Planner, aim_of, is_over
from macor_hil.runs.agent import Agent, Step

MAX_COMMANDS = 40
"""Commands after which a trial ends without a collision (figure 5)."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Differences of starts from the arena's own: uniform, to either side."""

    ahead: float = 0.01
    aside: float = 0.01
    heading: float = radians(5.0)

    def draw(self, start: Pose, rng: np.random.Generator) -> Pose:
        """Return a start near another one; metres and radians."""
        ahead, aside, turn = rng.uniform(-1.0, 1.0, 3) * (self.ahead, self.aside, self.heading)
        c, s = np.cos(start.heading), np.sin(start.heading)
        return Pose(
            x=start.x + float(c * ahead - s * aside),
            y=start.y + float(s * ahead + c * aside),
            heading=start.heading + float(turn),
        )


@dataclass(frozen=True, slots=True)
class Trial:
    """Outcome of a trial.

    Attributes:
        reinforcement: of every command.
        collided: whether the robot's own sensors ended it.
        touched: whether its body really touched something (ground truth).
        path: ground truth, at the start and after every command.
        reached: whether the planner's goal was reached, which ended it.
    """

    reinforcement: tuple[float, ...]
    collided: bool
    touched: bool
    path: tuple[Pose, ...]
    reached: bool = False

    @property
    def length(self) -> int:
        """Number of commands, the colliding one included."""
        return len(self.reinforcement)

    @property
    def total(self) -> float:
        """Sum of the reinforcement."""
        return sum(self.reinforcement)


def fallback(rng: np.random.Generator) -> Callable[[], int]:
    """Make a source of random commands, for situations in which none was ever tried."""
    return lambda: int(rng.integers(len(COMMANDS)))


def drive(
    agent: Agent,
    planner: Planner,
    rng: np.random.Generator,
    commands: int | None = MAX_COMMANDS,
    *,
    learn: bool = False,
) -> Iterator[Step]:
    """Drive by a planner until a collision, the last command, or its goal, where it has one.

    Args:
        agent: drives.
        planner: chooses.
        rng: source of commands where the planner knows of none.
        commands: to drive at most; None: without end.
        learn: whether the brain learns meanwhile.

    Raises:
        RobotError, CameraError: the hardware fails.
    """
    choose = agent.planned(planner, fallback(rng))
    view = agent.begin(learn=learn)
    for _ in count() if commands is None else range(commands):
        if is_over(aim_of(planner, view.moment)):
            return
        step = agent.step(view, choose, learn=learn)
        yield step
        if step.outcome.collided:
            return
        view = step.after


def run_trial(
    agent: Agent,
    planner: Planner,
    bench: Bench,
    start: Reset,
    rng: np.random.Generator,
    commands: int = MAX_COMMANDS,
) -> Trial:
    """Put an emulated robot at a start and drive one trial.

    Raises:
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    truth: Truth = bench.reset(start)
    path = [truth.pose]
    reinforcement = []
    collided = reached = False
    for step in drive(agent, planner, rng, commands):
        truth = bench.truth()
        path.append(truth.pose)
        reinforcement.append(step.reinforcement)
        collided = step.outcome.collided
        reached = not collided and is_over(aim_of(planner, step.after.moment))
    # a robot that is put down at its goal drives no command
    reached |= not collided and len(reinforcement) < commands
    return Trial(tuple(reinforcement), collided, truth.touched, tuple(path), reached)
