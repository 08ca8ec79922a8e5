"""Processor time of a whole training command on an emulated robot, and of its parts."""

from collections.abc import Mapping
from contextlib import ExitStack
from time import process_time

import numpy as np
from figures import Figure
from planning_speed import in_neuron
from stopwatch import Part, Stopwatch

from khepera_emulator.robot.khepera.robot import Robot
from macor_hil.hardware.bench import PortBench
from macor_hil.hardware.cameras.port_camera import PortCamera
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.khepera import Khepera
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.memories.graded import GradedMemory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.anticipative import Anticipative
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.runs.training import Schedule, Session, SessionKind, Trainer

_TUNING, _RANDOM, _COMMANDS = 150, 600, 100
_PLANS = 40

_PARTS: Mapping[str, Part] = {
    "camera": (PortCamera, "grab"),
    "exchanges": (Khepera, "request"),
    "physics": (Robot, "run"),
    "infrared": (Robot, "proximity"),
    "vision": (Brain, "look"),
    "Fuzzy ART": (FuzzyArt, "present"),
    "planning": (Reactive, "plan"),
    "map": (SensorimotorMap, "learn"),
    "graded map": (GradedMemory, "learn"),
    "resets": (PortBench, "reset"),
}


class TrainingCommand:
    """Commands of the reactive part of training, in the paper's corridor."""

    def __init__(self, stack: ExitStack) -> None:
        hardware = stack.enter_context(open_hardware("khepera://corridor?seed=1"))
        self._port = hardware.robot.port
        self._brain = build_brain()
        self._trainer = Trainer(
            self._brain, Driver(hardware.robot), hardware.camera, hardware.bench, Schedule()
        )
        self._sessions = 0
        self._train(SessionKind.TUNING, _TUNING)
        self._train(SessionKind.RANDOM, _RANDOM)

    def round(self) -> dict[str, float]:
        """Train a session as it is, another with a stopwatch, and plan some commands."""
        before = self._port.now
        taken = self._train(SessionKind.REACTIVE, _COMMANDS)
        found = {"command": taken / _COMMANDS, "factor": (self._port.now - before) / taken}
        watch = Stopwatch()
        with watch.watch(_PARTS):
            total = self._train(SessionKind.REACTIVE, _COMMANDS)
        found |= {name: watch.seconds[name] / total for name in _PARTS}
        found["rest"] = 1.0 - sum(watch.seconds.values()) / total
        found["requests"] = watch.calls["exchanges"] / _COMMANDS
        return found | self._plan()

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Return figures of the command, its parts, and a plan."""
        command, factor = medians["command"], medians["factor"]
        rows = [
            Figure(
                "a whole training command",
                f"{1e3 * command:.2f} ms",
                f"{command * factor:.2f} s of the robot's time, {medians['requests']:.0f}"
                " exchanges",
                f"{factor:.0f} x real time",
            )
        ]
        rows += [
            Figure(
                f"of it: {name}",
                f"{1e3 * command * medians[name]:.2f} ms",
                "the command",
                f"{100 * medians[name]:.1f} %",
            )
            for name in (*_PARTS, "rest")
        ]
        plan = medians["plan"]
        rows.append(
            Figure(
                "a plan of the anticipative system",
                f"{1e3 * plan:.2f} ms",
                "a training command",
                f"{plan / command:.2f}",
            )
        )
        return rows

    def _train(self, phase: SessionKind, commands: int) -> float:
        """Train one session; returns seconds of the processor."""
        session = Session(self._sessions, phase, commands, 0)
        self._sessions += 1
        start = process_time()
        self._trainer.run(session, lambda _: None)
        return process_time() - start

    def _plan(self) -> dict[str, float]:
        memory = self._brain.memories["transitions"]
        assert isinstance(memory, SensorimotorMap)
        known = np.unique(memory.transitions().past)
        chosen = known[np.linspace(0, len(known) - 1, _PLANS).astype(int)]
        planner = Anticipative()
        start = process_time()
        for neuron in chosen.tolist():
            planner.plan(memory, in_neuron(neuron))
        return {"plan": (process_time() - start) / _PLANS}
