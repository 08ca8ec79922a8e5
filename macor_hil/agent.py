"""One sense - plan - act step of MACOR, and what comes of it."""

from collections.abc import Callable
from dataclasses import dataclass

from macor_hil.brain import FIRST_COMMAND, Brain
from macor_hil.cameras import Camera, Frame
from macor_hil.clustering.fuzzy_art import Resonance
from macor_hil.drive import COMMANDS, Driver, Outcome
from macor_hil.planners.planner import Now, Plan, Planner
from macor_hil.vision.receptive_fields import Features


@dataclass(frozen=True, slots=True)
class View:
    """The robot's present moment.

    Attributes:
        frame: what the camera showed.
        features: the untuned features of the frame.
        resonance: the situation that it was taken for.
        neuron: that situation, entered by the last command.
    """

    frame: Frame
    features: Features
    resonance: Resonance
    neuron: int


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


Choice = Callable[[View], tuple[int, Plan]]
"""A way of choosing a command: its index, and the plan behind it."""

NO_PLAN = Plan((None,) * len(COMMANDS), None)


class Agent:
    """MACOR on a robot: looks, chooses, drives, and learns where it is told to."""

    def __init__(self, brain: Brain, driver: Driver, camera: Camera) -> None:
        self.brain = brain
        self._driver = driver
        self._camera = camera

    def begin(self, *, learn: bool) -> View:
        """Start anew where the robot stands: it counts as having come here straight on.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        self._driver.start()
        return self._look(FIRST_COMMAND, learn)

    def step(self, view: View, choose: Choice, *, learn: bool) -> Step:
        """Choose a command at a view, drive it, look again.

        Raises:
            RobotError, CameraError: the hardware fails.
        """
        command, plan = choose(view)
        motor = COMMANDS[command]
        outcome = self._driver.execute(motor)
        r = self.brain.settings.reinforcement(motor, outcome.collided)
        after = self._look(command, learn)
        if learn:
            self.brain.map.learn(view.neuron, after.neuron, r)
            self.brain.experience(view.features, command, after.features, collided=outcome.collided)
        return Step(view, plan, command, outcome, r, after)

    def planned(self, planner: Planner, fallback: Callable[[], int]) -> Choice:
        """Choose what a planner finds best; `fallback` where it knows of no command."""

        def choose(view: View) -> tuple[int, Plan]:
            now = Now(view.neuron, self.brain.memberships(view.features))
            plan = planner.plan(self.brain.memory, now)
            return (fallback() if plan.command is None else plan.command), plan

        return choose

    def _look(self, command: int, learn: bool) -> View:
        frame = self._camera.grab()
        features = self.brain.look(frame.image)
        resonance = self.brain.recognise(features, learn=learn)
        neuron = self.brain.map.neuron(resonance.node, command)
        return View(frame, features, resonance, neuron)
