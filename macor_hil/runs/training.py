"""The paper's training: random commands, then reactively selected ones if they are asked for.

Section 3.1 trains with "ca. 11000 randomly selected and about 2000 reactively selected actions" and
looks at reactive behaviour. Section 3.2 compares planners and only says "more than 10.000 typical
sensorimotor situations"; there the reactive ones, which mostly drive straight on into walls, teach
the wave that straight on is what goes on, and its drives get shorter (docs/design.md).

Training is cut into sessions. On an emulated robot a session begins with a seeded reset and has a
random generator of its own, so that it depends on nothing but the brain that it starts with, the
seed and its number: a training that was killed goes on from its last checkpoint and ends with
the same map, byte for byte. On a physical robot a session begins where the robot stands, and goes
on where it was left, command by command: sessions as long as a battery lasts add up to one map.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from khepera_protocol.zenoh.payloads import Reset

from macor_hil.commands import COMMANDS
from macor_hil.errors import CameraError, RobotError
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.cameras import Camera
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.way_out import STUCK, drive_away
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.experience import Seen
from macor_hil.mind.planners.planner import NO_PLAN
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.agent import Agent, Choice, View
from macor_hil.runs.recovery import TrainingRecovery


class Recovery(StrEnum):
    """Ways of going on after a collision."""

    BACK = "back"
    """Drive back along the trail: works on a physical robot."""
    RESET = "reset"
    """Let the emulator put the robot somewhere else."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """Amount of training, and its portions.

    Attributes:
        tuning: commands driven first to tune the receptive fields; nothing else is learned.
        random: randomly selected commands.
        reactive: reactively selected commands after them; section 3.1: 11,000 and 2,000.
        session: commands from one checkpoint to the next.
        episode: commands after which an emulated robot is put somewhere else.
        seed: of all random choices, the emulator's included.
        recovery: what follows a collision.
    """

    tuning: int = 400
    random: int = 13_000
    reactive: int = 0
    session: int = 250
    episode: int = 60
    seed: int = 1
    recovery: Recovery = Recovery.RESET

    @property
    def commands(self) -> int:
        """All commands, tuning included."""
        return self.tuning + self.random + self.reactive

    def sessions(self) -> list["Session"]:
        """Return the sessions in order."""
        plan = [Session(0, SessionKind.TUNING, self.tuning, 0)]
        for kind, total in (
            (SessionKind.RANDOM, self.random),
            (SessionKind.REACTIVE, self.reactive),
        ):
            for done in range(0, total, self.session):
                last = plan[-1]
                length = min(self.session, total - done)
                plan.append(Session(last.number + 1, kind, length, last.start + last.length))
        return plan


class SessionKind(StrEnum):
    """Kinds of sessions."""

    TUNING = "tuning"
    RANDOM = "random"
    REACTIVE = "reactive"


@dataclass(frozen=True, slots=True)
class Session:
    """A portion of training: its number, kind, length and first command."""

    number: int
    kind: SessionKind
    length: int
    start: int


class Trainer:
    """Trains a brain on a robot, session by session.

    Args:
        brain: what learns; changed in place.
        driver, camera: the robot.
        bench: reset of an emulated robot, or None.
        schedule: how much.
        rescue: recovers robot and camera from failures; None: a failure ends the training.
        witness: hears of everything that is seen after the tuning.

    Attributes:
        seen: features that have been seen in tuning, shape (commands, M) as lists.
    """

    def __init__(
        self,
        brain: Brain,
        driver: Driver,
        camera: Camera,
        bench: Bench | None,
        schedule: Schedule,
        rescue: TrainingRecovery | None = None,
        witness: Callable[[Seen], None] = lambda _: None,
    ) -> None:
        self._witness = witness
        self.seen: list[list[float]] = []
        self._rescue = rescue
        self._stuck = 0
        self._brain = brain
        self._driver = driver
        self._camera = camera
        self._bench = bench
        self._schedule = schedule

    def run(self, session: Session, progress: Callable[[int], None], done: int = 0) -> None:
        """Train one session; `progress` hears how many commands have been driven in all.

        Args:
            session: which.
            progress: called after each command.
            done: commands of the session that have been driven before.

        Raises:
            RobotError, CameraError, BenchError: the hardware or the emulator fails.
        """
        place = [session.number, done] if done else [session.number]
        rng = np.random.default_rng([self._schedule.seed, *place])
        if self._bench is not None:
            self._bench.reset(Reset(random=True, seed=int(rng.integers(2**31))))
        if session.kind is SessionKind.TUNING:
            # what the untuned eyes take for situations is thrown away
            scratch = Agent(
                build_brain(self._brain.settings or MindSettings()), self._driver, self._camera
            )
            for view in self._drive(session, scratch, rng, progress, done):
                self.seen.append(view.moment.raw.tolist())
            self._brain.tune(np.array(self.seen), rng)
        else:
            agent = Agent(self._brain, self._driver, self._camera, self._witness)
            for _ in self._drive(session, agent, rng, progress, done):
                pass

    def _drive(
        self,
        session: Session,
        agent: Agent,
        rng: np.random.Generator,
        progress: Callable[[int], None],
        before: int,
    ) -> Iterator[View]:
        """Drive and learn the commands of a session; gives what is seen after each."""
        choose = self._choice(session.kind, agent, rng)
        view = self._begin(agent)
        since_begin, done = 0, before
        while done < session.length:
            try:
                step = agent.step(view, choose, learn=True)
            except (RobotError, CameraError) as error:
                # a command without a known outcome teaches nothing
                self._recover_from(error)
                view = self._begin(agent)
                continue
            done += 1
            view = step.after
            yield view
            progress(session.start + done)
            since_begin += 1
            if step.outcome.collided or self._is_long(since_begin):
                self._move_away(rng, at_once=since_begin == 1)
                view = self._begin(agent)
                since_begin = 0

    def _begin(self, agent: Agent) -> View:
        while True:
            try:
                return agent.begin(learn=True)
            except (RobotError, CameraError) as error:
                self._recover_from(error)

    def _recover_from(self, error: RobotError | CameraError) -> None:
        if self._rescue is None:
            raise error
        self._rescue.recover(error)

    def _choice(self, kind: SessionKind, agent: Agent, rng: np.random.Generator) -> Choice:
        def draw() -> int:
            return int(rng.integers(len(COMMANDS)))

        if kind is SessionKind.REACTIVE:
            return agent.planned(Reactive(), draw)
        return lambda _: (draw(), NO_PLAN)

    def _is_long(self, commands: int) -> bool:
        """Return True if an emulated robot has been in one place long enough."""
        return self._resetting is not None and commands >= self._schedule.episode

    def _move_away(self, rng: np.random.Generator, *, at_once: bool) -> None:
        if self._resetting is not None:
            self._resetting.reset(Reset(random=True))
            return
        try:
            drive_away(self._driver, rng, turn=at_once)
        except (RobotError, CameraError) as error:
            self._recover_from(error)
        self._stuck = self._stuck + 1 if at_once else 0
        if self._stuck >= STUCK and self._rescue is not None:
            self._rescue.free()
            self._stuck = 0

    @property
    def _resetting(self) -> Bench | None:
        return self._bench if self._schedule.recovery is Recovery.RESET else None
