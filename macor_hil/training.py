"""The paper's training: random commands, then reactively selected ones (section 3.1).

Training is cut into sessions. On an emulated robot a session begins with a seeded reset and has a
random generator of its own, so that it depends on nothing but the brain that it starts with, the
seed and its number: a training that was killed goes on from its last checkpoint and ends with
the same map, byte for byte. On a physical robot a session begins where the robot stands.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from macor_hil.agent import NO_PLAN, Agent, Choice, View
from macor_hil.bench import Bench
from macor_hil.brain import Brain
from macor_hil.cameras import Camera
from macor_hil.drive import COMMANDS, Driver
from macor_hil.planners.reactive import Reactive
from protocol.side_channel import Reset


class Recovery(StrEnum):
    """What follows a collision."""

    BACK = "back"
    """Drive back along the trail: works on a physical robot."""
    RESET = "reset"
    """Let the emulator put the robot somewhere else."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """How much is trained, and in which portions.

    Attributes:
        tuning: commands driven first to tune the receptive fields; nothing else is learned.
        random: randomly selected commands.
        reactive: reactively selected commands after them.
        session: commands from one checkpoint to the next.
        episode: commands after which an emulated robot is put somewhere else.
        seed: of all random choices, the emulator's included.
        recovery: what follows a collision.
    """

    tuning: int = 400
    random: int = 11_000
    reactive: int = 2_000
    session: int = 250
    episode: int = 60
    seed: int = 1
    recovery: Recovery = Recovery.RESET

    @property
    def commands(self) -> int:
        """All commands, tuning included."""
        return self.tuning + self.random + self.reactive

    def sessions(self) -> list["Session"]:
        """The sessions in order."""
        plan = [Session(0, Phase.TUNING, self.tuning, 0)]
        for phase, total in ((Phase.RANDOM, self.random), (Phase.REACTIVE, self.reactive)):
            for done in range(0, total, self.session):
                last = plan[-1]
                length = min(self.session, total - done)
                plan.append(Session(last.number + 1, phase, length, last.start + last.length))
        return plan


class Phase(StrEnum):
    """What a session trains."""

    TUNING = "tuning"
    RANDOM = "random"
    REACTIVE = "reactive"


@dataclass(frozen=True, slots=True)
class Session:
    """A portion of training: its number, kind, length and first command."""

    number: int
    phase: Phase
    length: int
    start: int


class Trainer:
    """Trains a brain on a robot, session by session.

    Args:
        brain: what learns; changed in place.
        driver, camera: the robot.
        bench: reset of an emulated robot, or None.
        schedule: how much.
    """

    def __init__(
        self,
        brain: Brain,
        driver: Driver,
        camera: Camera,
        bench: Bench | None,
        schedule: Schedule,
    ) -> None:
        self._brain = brain
        self._driver = driver
        self._camera = camera
        self._bench = bench
        self._schedule = schedule

    def run(self, session: Session, progress: Callable[[int], None]) -> None:
        """Train one session; `progress` hears how many commands have been driven in all.

        Raises:
            RobotError, CameraError, BenchError: the hardware or the emulator fails.
        """
        rng = np.random.default_rng([self._schedule.seed, session.number])
        if self._bench is not None:
            self._bench.reset(Reset(random=True, seed=int(rng.integers(2**31))))
        if session.phase is Phase.TUNING:
            # what the untuned eyes take for situations is thrown away
            scratch = Agent(Brain(self._brain.settings), self._driver, self._camera)
            views = list(self._drive(session, scratch, rng, progress))
            seen = np.array([view.features for view in views])
            self._brain.fields = self._brain.fields.tuned_to(seen)
        else:
            agent = Agent(self._brain, self._driver, self._camera)
            for _ in self._drive(session, agent, rng, progress):
                pass

    def _drive(
        self,
        session: Session,
        agent: Agent,
        rng: np.random.Generator,
        progress: Callable[[int], None],
    ) -> Iterator[View]:
        """Drive and learn the commands of a session; gives what is seen after each."""
        choose = self._choice(session.phase, agent, rng)
        view = agent.begin(learn=True)
        since_begin = 0
        for done in range(1, session.length + 1):
            step = agent.step(view, choose, learn=True)
            view = step.after
            yield view
            progress(session.start + done)
            since_begin += 1
            if step.outcome.collided or self._is_long(since_begin):
                self._recover(rng)
                view = agent.begin(learn=True)
                since_begin = 0

    def _choice(self, phase: Phase, agent: Agent, rng: np.random.Generator) -> Choice:
        def draw() -> int:
            return int(rng.integers(len(COMMANDS)))

        if phase is Phase.REACTIVE:
            return agent.planned(Reactive(), draw)
        return lambda _: (draw(), NO_PLAN)

    def _is_long(self, commands: int) -> bool:
        """Whether an emulated robot has been in one place long enough."""
        return self._resetting is not None and commands >= self._schedule.episode

    def _recover(self, rng: np.random.Generator) -> None:
        if self._resetting is not None:
            self._resetting.reset(Reset(random=True))
        else:
            self._driver.back_off(int(rng.integers(3, 9)))

    @property
    def _resetting(self) -> Bench | None:
        return self._bench if self._schedule.recovery is Recovery.RESET else None
