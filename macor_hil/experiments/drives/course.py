"""Systems, a brain and a planner each, learned from a recording and driven live on a course."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import radians
from typing import Annotated, Any, NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Outline, Pose, Reset
from pydantic import AfterValidator, Field

from macor_hil.errors import BenchError
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.cameras.light import AS_TRAINED, LIGHTS, LitCamera
from macor_hil.hardware.devices import Hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.planners.planner import Planner
from macor_hil.runs.agent import Agent
from macor_hil.runs.possible import Possible, Ways, judge
from macor_hil.runs.trials import MAX_COMMANDS, Spread, Trial, run_trial


class System(NamedTuple):
    """A brain and a planner that chooses commands by it."""

    brain: Brain
    planner: Planner


_Count = Annotated[int, Field(ge=1)]
_Most = Annotated[float, Field(ge=0.0)]


def _known(light: str) -> str:
    if light not in LIGHTS:
        raise ValueError(f"there is no light {light!r}; there are {', '.join(LIGHTS)}")
    return light


Lighting = Annotated[str, AfterValidator(_known)]
"""Name of a light in `cameras.light`."""


@dataclass(frozen=True)
class Course:
    """Trials: where they start and when they end (section 3.2)."""

    arena: str = "corridor"
    """The arena of the trials."""
    trials: _Count = 10
    """Trials of each system; all systems start from the same places."""
    commands: _Count = MAX_COMMANDS
    """Commands after which a trial ends without a collision."""
    ahead: _Most = 0.01
    """Starts differ from the arena's own by up to so many metres along,"""
    aside: _Most = 0.01
    """across,"""
    heading: _Most = 5.0
    """and degrees."""
    anywhere: bool = False
    """Starts are free places anywhere in the arena instead."""
    light: Lighting = AS_TRAINED
    """Light in which they are driven."""

    @property
    def place(self) -> str:
        """The arena, and whether trials start anywhere in it, in a few words."""
        return f"{self.arena}, from anywhere" if self.anywhere else self.arena

    def spread(self) -> Spread:
        """Return the spread of starts, in metres and radians."""
        return Spread(self.ahead, self.aside, radians(self.heading))


class Track:
    """A robot on a course."""

    def __init__(self, course: Course, hardware: Hardware, bench: Bench) -> None:
        self._course = course
        self._hardware = hardware
        self._bench = bench

    def outline(self) -> Outline:
        """Return the arena, to draw."""
        return self._bench.outline()

    def drive(self, system: System, seed: int) -> list[Trial]:
        """All trials of a system; the seed and a trial's number decide where it starts.

        Raises:
            RobotError, CameraError, BenchError: the hardware or the emulator fails.
        """
        camera = self._hardware.camera
        if self._course.light != AS_TRAINED:
            camera = LitCamera(camera, LIGHTS[self._course.light])
        agent = Agent(system.brain, Driver(self._hardware.robot), camera)
        return [self._trial(agent, system.planner, seed, k) for k in range(self._course.trials)]

    def starts(self, seed: int) -> list[Pose]:
        """Return where the trials of a seed start.

        Raises:
            BenchError: the emulator does not answer.
        """
        numbers = range(self._course.trials)
        return [self._bench.reset(self._start(seed, number)[0]).pose for number in numbers]

    def possible(self, seed: int) -> list[Possible]:
        """Return what is possible from where each trial of a seed starts.

        Raises:
            BenchError: the emulator does not answer.
        """
        return list(map(judge(self._bench, self._course.commands), self.starts(seed)))

    def is_possible(self, start: Pose, commands: int) -> bool:
        """Tell whether so many commands can be driven from a start without a collision.

        Raises:
            BenchError: the emulator does not answer.
        """
        return judge(self._bench, commands)(start).everything

    def free_place(self, chance: int) -> Pose:
        """Put the robot down at a free place anywhere in the arena, and return it.

        Raises:
            BenchError: the emulator does not answer.
        """
        return self._bench.reset(Reset(random=True, seed=chance)).pose

    def drive_from(
        self, system: System, start: Pose, commands: int, rng: np.random.Generator
    ) -> Trial:
        """Drive one trial of a system from a pose.

        Raises:
            RobotError, CameraError, BenchError: the hardware or the emulator fails.
        """
        agent = Agent(system.brain, Driver(self._hardware.robot), self._hardware.camera)
        start_there = Reset(pose=start)
        return run_trial(agent, system.planner, self._bench, start_there, rng, commands)

    def ways(self, points: Sequence[tuple[float, float]], reach: float) -> Ways:
        """Return the ways to where one of some points is near.

        Raises:
            BenchError: the emulator does not answer.
        """
        return Ways(self._bench, points, reach)

    def _trial(self, agent: Agent, planner: Planner, seed: int, number: int) -> Trial:
        start, rng = self._start(seed, number)
        return run_trial(agent, planner, self._bench, start, rng, self._course.commands)

    def _start(self, seed: int, number: int) -> tuple[Reset, np.random.Generator]:
        """Return how a trial starts, and the randomness of all that follows."""
        rng = np.random.default_rng([seed, number])
        chance = int(rng.integers(2**31))
        if self._course.anywhere:
            return Reset(random=True, seed=chance), rng
        pose = self._bench.reset(Reset(seed=chance)).pose
        return Reset(pose=self._course.spread().draw(pose, rng)), rng


@contextmanager
def on_course(course: Course, seed: int, drive: Drive) -> Iterator[Track]:
    """Yield the emulated robot of a seed on a course, such a robot as was trained by a drive.

    Raises:
        RobotError, CameraError, BenchError: the emulator cannot be used.
    """
    with drive.robot(seed, course.arena) as hardware:
        if hardware.bench is None:
            raise BenchError("trials need an emulated robot")
        yield Track(course, hardware, hardware.bench)


def possible_as_json(possible: Sequence[Possible]) -> list[list[int]]:
    """Return what was possible as it is kept in results: commands, and whether that is certain."""
    return [[one.length, one.exact] for one in possible]


def trial_as_json(trial: Trial) -> dict[str, Any]:
    """Return a trial as it is kept in results; places to 0.1 mm and headings to 0.0001 rad."""
    path = [[round(v, 4) for v in (p.x, p.y, p.heading)] for p in trial.path]
    return {
        "r": list(trial.reinforcement),
        "collided": trial.collided,
        "touched": trial.touched,
        "path": path,
    }


def trial_from_json(value: dict[str, Any], *, way: bool = True) -> Trial:
    """Return the trial of a result.

    Args:
        value: as `trial_as_json` makes it.
        way: False leaves the path empty: poses take longer than all else together.
    """
    kept = value["path"] if way else ()
    path = tuple(Pose(x=x, y=y, heading=heading) for x, y, heading in kept)
    return Trial(tuple(value["r"]), value["collided"], value["touched"], path)
