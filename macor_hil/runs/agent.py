"""One sense - plan - act step of MACOR, and what comes of it."""

from collections.abc import Callable
from dataclasses import dataclass

from macor_hil.commands import COMMANDS, FIRST_COMMAND
from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.hardware.driver import Driver, Outcome
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import memory_for
from macor_hil.mind.experience import Experience, Moment, Seen
from macor_hil.mind.planners.planner import Plan, Planner


@dataclass(frozen=True, slots=True)
class View:
    """A picture and what it was taken for."""

    frame: Frame
    moment: Moment


@dataclass(frozen=True, slots=True)
class Step:
    """A decision and its outcome.

    Attributes:
        before, after: what was seen.
        plan: what the planner made of it; without evaluations where nothing was planned.
        command: index of the command that was driven.
        outcome: how the drive went.
        reinforcement: what it earned.
    """

    before: View
    plan: Plan
    command: int
    outcome: Outcome
    reinforcement: float
    after: View

    @property
    def experience(self) -> Experience:
        """Experience of the step, to learn from."""
        before, after = self.before.moment, self.after.moment
        return Experience(before, self.command, after, self.reinforcement, self.outcome.collided)


Choice = Callable[[View], tuple[int, Plan]]
"""A way of choosing a command: its index, and the plan behind it."""


class Agent:
    """MACOR on a robot: looks, chooses, drives, and learns where it is told to.

    Args:
        brain: sees and learns.
        driver, camera: the robot.
        witness: hears of everything that is seen.
    """

    def __init__(
        self,
        brain: Brain,
        driver: Driver,
        camera: Camera,
        witness: Callable[[Seen], None] = lambda _: None,
    ) -> None:
        self.brain = brain
        self._driver = driver
        self._camera = camera
        self._witness = witness

    def begin(self, *, learn: bool) -> View:
        """Start anew where the robot stands: it counts as having come here straight on.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        self._driver.start()
        view = self._look(FIRST_COMMAND, learn)
        self._witness(Seen(view.moment.raw))
        return view

    def step(self, view: View, choose: Choice, *, learn: bool) -> Step:
        """Choose a command at a view, drive it, look again.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        command, plan = choose(view)
        outcome = self._driver.execute(COMMANDS[command])
        r = self.brain.earned(command, collided=outcome.collided)
        after = self._look(command, learn)
        self._witness(Seen(after.moment.raw, command, outcome.collided))
        step = Step(view, plan, command, outcome, r, after)
        if learn:
            self.brain.learn(step.experience)
        return step

    def planned(self, planner: Planner, fallback: Callable[[], int]) -> Choice:
        """Choose what a planner finds best; `fallback` where it knows of no command.

        Raises:
            MacorError: the brain has no memory of the kind that the planner reads.
        """
        memory = memory_for(self.brain, planner)

        def choose(view: View) -> tuple[int, Plan]:
            plan = planner.plan(memory, view.moment)
            return (fallback() if plan.command is None else plan.command), plan

        return choose

    def _look(self, command: int, learn: bool) -> View:
        frame = self._camera.grab()
        return View(frame, self.brain.perceive(self.brain.look(frame.image), command, learn=learn))
