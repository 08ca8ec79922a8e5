"""A whole robot on a serial line, as a function of time: the core behind every port.

A port puts bytes in, lets time pass and takes bytes out. Nothing here reads a clock: `advance`
brings physics, interpreter and line to a given time, in the caller's thread, so that the same
bytes at the same times give the same bytes back.
"""

import logging
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from khepera_emulator.arena import Arena
from khepera_emulator.camera import Image, OmniCamera
from khepera_emulator.drift import PRESETS, DriftSettings, draw_drift
from khepera_emulator.faults import Fault, Faults, Happening
from khepera_emulator.firmware import Firmware
from khepera_emulator.geometry import FloorPlan
from khepera_emulator.models import KHEPERA, Model
from khepera_emulator.outline import outline
from khepera_emulator.places import check_room, pose_of, random_pose
from khepera_emulator.robot import Robot
from khepera_emulator.uart import Uart, on_grid
from khepera_emulator.world import World
from protocol.mirror import Mirror
from protocol.side_channel import Outline, Pose, Reset, Truth
from protocol.units import CONTROL_PERIOD

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Setup:
    """What an emulated robot is made from.

    Attributes:
        arena: where it drives.
        model: which Khepera.
        drift: how far its wheels deceive it.
        seed: of this robot (its drift), and of all that happens by chance.
        baud: rate of its line, or None for a line that takes no time.
        faults: what goes wrong on its line.
        mirror: geometry of its camera.
    """

    arena: Arena
    model: Model = KHEPERA
    drift: DriftSettings = PRESETS["default"]
    seed: int = 0
    baud: int | None = 9600
    faults: tuple[Fault, ...] = ()
    mirror: Mirror = field(default_factory=Mirror)


def _log_fault(happening: Happening) -> None:
    _log.info("fault at %s", happening)


class _Streams(NamedTuple):
    """Independent random numbers for a robot's making, drives, camera, places and line."""

    making: np.random.Generator
    driving: np.random.Generator
    camera: np.random.Generator
    places: np.random.Generator
    line: np.random.Generator


def _streams(seed: int) -> _Streams:
    return _Streams(*np.random.default_rng(seed).spawn(5))


class Emulator:
    """One emulated robot with its world, its line and its camera.

    Attributes:
        now: time that everything has been brought to, in seconds; a multiple of `uart.GRID`.
        uart: the serial line.

    Raises:
        EmulatorError: the arena's start is not free.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.uart = Uart(setup.baud, Faults(setup.faults, tell=_log_fault))
        self.now = 0.0
        self._plan = FloorPlan(setup.arena)
        check_room(self.start_pose, self._gap)
        streams = _streams(setup.seed)
        # a robot keeps its wheels for life: a reset begins chance anew, not the robot
        self._drift = draw_drift(setup.drift, setup.model.wheel_base, streams.making)
        self._build(self.start_pose, streams)

    def close(self) -> None:
        """Give back the physics client."""
        self._world.close()

    @property
    def start_pose(self) -> Pose:
        """Where the arena puts a robot down."""
        return pose_of(self.setup.arena.start)

    def write(self, data: bytes) -> None:
        """The client puts bytes on the line, now."""
        self.uart.receive(data, self.now)

    def read(self, limit: int | None = None) -> bytes:
        """The client takes the bytes that have reached it by now."""
        return self.uart.sent(self.now, limit)

    def hang_up(self) -> None:
        """The client leaves the line; the robot does not notice and goes on."""
        self.uart.hang_up()

    @property
    def moving(self) -> bool:
        """Whether the robot's wheels turn or are driven."""
        return self._robot.moving

    def advance(self, until: float) -> None:
        """Let time pass: drive, carry out the requests that arrive, answer them."""
        until = max(on_grid(until), self.now)
        for moment, line in self.uart.requests(until):
            self._drive(moment)
            self.uart.send(self._firmware.execute(line), moment)
        self._drive(until)
        self.now = until

    def truth(self) -> Truth:
        """Ground truth, now."""
        return self._robot.truth().model_copy(update={"time": self.now})

    def outline(self) -> Outline:
        """The arena from above, to draw what happens in it."""
        return outline(self.setup.arena, self.setup.model)

    def mirror_image(self) -> Image:
        """What the camera sees now, in its mirror."""
        return self._eye().mirror_image(self._robot.chassis.pose)

    def panorama(self) -> Image:
        """What the camera sees now, unwrapped."""
        return self._eye().panorama(self._robot.chassis.pose)

    def reset(self, reset: Reset) -> Truth:
        """Put the robot somewhere, powered on afresh, the line silent.

        With a seed the whole world is made anew, and the control periods are counted from now:
        what follows depends on the robot, the reset and the seed alone.

        Raises:
            EmulatorError: the pose is not free, or no free one was found; nothing has changed.
        """
        streams = self._streams if reset.seed is None else _streams(reset.seed)
        if reset.random:
            pose = random_pose(self.setup.arena.free, self._gap, streams.places)
        else:
            pose = reset.pose or self.start_pose
            check_room(pose, self._gap)
        self.uart.clear()
        if reset.seed is None:
            self._robot.put_down(pose)
        else:
            self._world.close()
            self._build(pose, streams)
        return self.truth()

    def _build(self, pose: Pose, streams: _Streams) -> None:
        setup = self.setup
        self._streams = streams
        self.uart.faults.begin(int(streams.line.integers(2**63)), self.now)
        self._world = World(setup.arena)
        self._robot = Robot(self._world, setup.model, pose, self._drift, streams.driving)
        self._firmware = Firmware(self._robot)
        self._camera: OmniCamera | None = None
        self._power_time = self.now

    def _eye(self) -> OmniCamera:
        # made when first asked for: many programs use the serial line alone
        if self._camera is None:
            self._camera = OmniCamera(self._world, self._streams.camera, self.setup.mirror)
        return self._camera

    def _drive(self, until: float) -> None:
        due = int((until - self._power_time) / CONTROL_PERIOD + 1e-6)
        if due > self._robot.ticks:
            self._robot.run(due)

    def _gap(self, pose: Pose) -> float:
        return self._plan.clearance(pose.x, pose.y) - self.setup.model.radius
