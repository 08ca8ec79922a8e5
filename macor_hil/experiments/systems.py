"""Systems: a clusterer, a map and a planner, learned from a recording and driven live."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import radians
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from macor_hil.agent import Agent
from macor_hil.bench import Bench
from macor_hil.brain import FIRST_COMMAND, Brain
from macor_hil.clustering.clusterer import Clusterer
from macor_hil.clustering.fuzzy_art import Resonance
from macor_hil.clustering.membership import Array
from macor_hil.drive import COMMANDS, MIRRORED, Driver
from macor_hil.errors import BenchError
from macor_hil.experiments.recording import PUT_DOWN, Recording
from macor_hil.graded_map import GradedMap
from macor_hil.hardware import Hardware, open_hardware
from macor_hil.memory import Memory
from macor_hil.planners.planner import Planner
from macor_hil.planners.q_learning import QMap
from macor_hil.reinforcement import Reinforcement
from macor_hil.sensorimotor_map import SensorimotorMap
from macor_hil.trials import MAX_COMMANDS, Spread, Trial, run_trial
from macor_hil.vision.receptive_fields import Features
from protocol.side_channel import Outline, Pose, Reset

Nodes = NDArray[np.int64]


class GradedSituations(Protocol):
    """Tells how much an input belongs to each situation."""

    def memberships(self, x: Array) -> Array:
        """Memberships, shape (n,), of an input of shape (M,)."""
        ...


class Mind(Brain):
    """The eyes of a recording's brain with a clusterer and a map of another kind.

    Args:
        eyes: whose receptive fields, prototypes and reinforcement are used.
        clusterer: what a situation is.
        memory: what their commands led to.
        shades: graded situations other than those of the eyes.
    """

    def __init__(
        self,
        eyes: Brain,
        clusterer: Clusterer,
        memory: Memory,
        shades: GradedSituations | None = None,
    ) -> None:
        super().__init__(eyes.settings)
        self.fields = eyes.fields
        self.map = memory.map
        self.graded = memory.graded
        self.clusterer = clusterer
        self.shades = eyes.prototypes if shades is None else shades

    def recognise(self, raw: Features, *, learn: bool) -> Resonance:
        """The situation of untuned features."""
        return self.clusterer.present(self.fields.tune(raw), learn=learn)

    def memberships(self, raw: Features) -> Array:
        """How much untuned features belong to each graded situation, shape (n,)."""
        return self.shades.memberships(self.fields.tune(raw))


def learn_transitions(
    memory: SensorimotorMap, nodes: Nodes, recording: Recording, earns: Reinforcement
) -> None:
    """Adapt a map to the transitions of a recording.

    Args:
        memory: learns; Q-learning hears which transitions ended in a collision.
        nodes: situation of each frame, shape (T,), of the first T frames.
        recording: commands and collisions.
        earns: what commands earn.
    """
    count = len(nodes)
    commands, collided = recording.commands[:count], recording.collided[:count]
    r = recording.reinforcement(earns)[:count]
    entered = np.where(commands == PUT_DOWN, FIRST_COMMAND, commands)
    neurons = [memory.neuron(int(k), int(a)) for k, a in zip(nodes, entered, strict=True)]
    for t in range(1, count):
        if commands[t] == PUT_DOWN:
            continue
        j, i = neurons[t - 1], neurons[t]
        if isinstance(memory, QMap) and collided[t]:
            memory.learn_last(j, i, float(r[t]))
        else:
            memory.learn(j, i, float(r[t]))


def learn_graded(
    graded: GradedMap,
    shades: GradedSituations,
    recording: Recording,
    earns: Reinforcement,
    *,
    mirrored: bool = True,
    frames: int | None = None,
) -> None:
    """Count the commands of a recording between graded situations.

    Args:
        graded: learns.
        shades: the situations.
        recording: frames, commands and collisions.
        earns: what commands earn.
        mirrored: whether the mirror image of everything counts as experienced, too.
        frames: how many of the first frames count; None: all.
    """
    x = recording.inputs[:frames]
    _count(graded, shades, x, recording, earns, range(len(COMMANDS)))
    if mirrored:
        _count(graded, shades, recording.brain.fields.mirrored(x), recording, earns, MIRRORED)


def _count(
    graded: GradedMap,
    shades: GradedSituations,
    inputs: Array,
    recording: Recording,
    earns: Reinforcement,
    names: Sequence[int],
) -> None:
    """Count all commands, each under the index that it has in `names`."""
    shares = [shades.memberships(x) for x in inputs]
    for t in range(1, len(shares)):
        if recording.commands[t] != PUT_DOWN:
            command, collided = names[recording.commands[t]], bool(recording.collided[t])
            then = None if collided else shares[t]
            graded.learn(shares[t - 1], command, then, earns(COMMANDS[command], collided))


@dataclass(frozen=True)
class Course:
    """Trials: where they start and when they end (section 3.2)."""

    arena: str = "corridor"
    """Where they are driven."""
    trials: int = 10
    """Trials of each system; all systems start from the same places."""
    commands: int = MAX_COMMANDS
    """Commands after which a trial ends without a collision."""
    ahead: float = 0.01
    """Starts differ from the arena's own by up to so many metres along,"""
    aside: float = 0.01
    """across,"""
    heading: float = 5.0
    """and degrees."""
    anywhere: bool = False
    """Starts are free places anywhere in the arena instead."""

    def spread(self) -> Spread:
        """How starts differ, in metres and radians."""
        return Spread(self.ahead, self.aside, radians(self.heading))


class Track:
    """A robot on a course."""

    def __init__(self, course: Course, hardware: Hardware, bench: Bench) -> None:
        self._course = course
        self._hardware = hardware
        self._bench = bench

    def outline(self) -> Outline:
        """The arena, to draw."""
        return self._bench.outline()

    def drive(self, mind: Brain, planner: Planner, seed: int) -> list[Trial]:
        """All trials of a system; the seed and a trial's number decide where it starts.

        Raises:
            RobotError, CameraError, BenchError: the hardware or the emulator fails.
        """
        agent = Agent(mind, Driver(self._hardware.robot), self._hardware.camera)
        return [self._trial(agent, planner, seed, k) for k in range(self._course.trials)]

    def _trial(self, agent: Agent, planner: Planner, seed: int, number: int) -> Trial:
        rng = np.random.default_rng([seed, number])
        chance = int(rng.integers(2**31))
        if self._course.anywhere:
            start = Reset(random=True, seed=chance)
        else:
            pose = self._bench.reset(Reset(seed=chance)).pose
            start = Reset(pose=self._course.spread().draw(pose, rng))
        return run_trial(agent, planner, self._bench, start, rng, self._course.commands)


@contextmanager
def on_course(course: Course, seed: int, drift: str = "default") -> Iterator[Track]:
    """The emulated robot of a seed on a course.

    Raises:
        RobotError, CameraError, BenchError: the emulator cannot be used.
    """
    with open_hardware(f"khepera://{course.arena}?seed={seed}&drift={drift}") as hardware:
        if hardware.bench is None:
            raise BenchError("trials need an emulated robot")
        yield Track(course, hardware, hardware.bench)


def trial_as_json(trial: Trial) -> dict[str, Any]:
    """A trial as it is kept in results; places to 0.1 mm and headings to 0.0001 rad."""
    path = [[round(v, 4) for v in (p.x, p.y, p.heading)] for p in trial.path]
    return {
        "r": list(trial.reinforcement),
        "collided": trial.collided,
        "touched": trial.touched,
        "path": path,
    }


def trial_from_json(value: dict[str, Any]) -> Trial:
    """The trial of a result."""
    path = tuple(Pose(x=x, y=y, heading=heading) for x, y, heading in value["path"])
    return Trial(tuple(value["r"]), value["collided"], value["touched"], path)
