"""An e-puck as its firmware finds it: motors, sensors, lamps and camera, at one moment of time."""

from dataclasses import replace
from typing import Final

from khepera_protocol.epuck.letters import wrapped
from khepera_protocol.epuck.units import STEP
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.robot.epuck.avoidance import avoid
from khepera_emulator.robot.epuck.choices import Choices
from khepera_emulator.robot.epuck.models import EpuckModel, ring
from khepera_emulator.robot.epuck.panel import Panel, Picture
from khepera_emulator.robot.epuck.senses import ground, ranging
from khepera_emulator.robot.epuck.senses.eye import Eye
from khepera_emulator.robot.epuck.senses.motion import MotionSense
from khepera_emulator.robot.epuck.senses.proximity import Ring, Scan
from khepera_emulator.robot.epuck.steppers import Stepper
from khepera_emulator.robot.kind import Berth
from khepera_emulator.robot.rolling import Pair, Rolling

_RANGE_TICKS: Final = round(ranging.PERIOD / CONTROL_PERIOD)
_AVOID_TICKS: Final = 2
"""Control periods between two steps of the e-puck2's avoidance of obstacles, which is at 50 Hz."""

_QUIET, _LOUD = 12, 36
"""Volumes of a microphone in a quiet room (a choice)."""

_REMOTE_ADDRESSES: Final = (0, 8)
_REMOTE_SPEED: Final = 600
_REMOTE_SPEEDS: Final = {
    1: (0.5, 1.0),
    2: (1.0, 1.0),
    3: (1.0, 0.5),
    4: (-1.0, 1.0),
    5: (0.0, 0.0),
    6: (1.0, -1.0),
    7: (-0.5, -1.0),
    8: (-1.0, -1.0),
    9: (-1.0, -0.5),
}
"""Shares of the speed, left and right, that keys of the infrared remote control set."""

_REMOTE_SOUND: Final = 5


class Robot(Rolling):
    """One e-puck in a world.

    Args:
        berth: where it is, and what it is made from there.
        choices: its firmware, and properties of its own.

    Attributes:
        model: which robot, with the places of the sensors that hold.
        motors: left and right.
        motion: accelerometer and gyroscope.
        pressed: whether somebody holds the button.
        temperature: of its processor, degrees C (a choice).
    """

    temperature = 27

    panel: Panel

    def __init__(self, berth: Berth, choices: Choices) -> None:
        slip, sensors = berth.rng.spawn(2)
        places = ring(choices.switches.places)
        model: EpuckModel = replace(berth.model, sensor_bearings=places, sensor_directions=places)
        super().__init__(
            berth.world, model, berth.pose, berth.drift, slip, berth.dead_man, berth.ailments
        )
        self.model = model
        self.choices = choices
        proximity, motion, self._floor, self._echo, self._ears, self._grain = sensors.spawn(6)
        world, scene = berth.world, self.chassis.scene
        self._world = world
        self.ring = Ring(model, scene, world.arena.lamp, proximity)
        self.motion = MotionSense(motion)
        self.motion.put(self.chassis.heading)
        self.pressed = False
        self._eye: Eye | None = None
        self._scans: dict[str, Scan] = {}
        self._scan_tick = -1
        self.power_on()

    def power_on(self) -> None:
        """Set everything that power-on or a reset sets; the body stays put."""
        generation = self.choices.generation
        left, right = (
            Stepper(generation.speed_limit, generation.bits, self.model.fast_timer)
            for _ in range(2)
        )
        self.motors = left, right
        self.panel = Panel()
        self._distance, self._distance_tick = 0, -1
        if generation.calibrates:
            self.calibrate()

    def put_down(self, pose: Pose) -> None:
        """Move the robot somewhere else and power it on afresh."""
        self._scan_tick = -1
        super().put_down(pose)
        self.motion.put(self.chassis.heading)

    @property
    def moving(self) -> bool:
        """True if a wheel is driven, or something is still felt of its stopping."""
        left, right = self.motors
        still = left.pace == right.pace == 0.0 and self.chassis.ground_speed == (0.0, 0.0)
        return not (still and self.motion.still) or self.panel.avoiding

    def rest(self, ticks: int) -> None:
        """Let control periods pass in which nothing moves; see `run`."""
        self.ticks = ticks

    def arrive(self, ways: Pair) -> None:
        """End a control period: the steps are made, whatever became of the wheels."""
        del ways
        self.ticks += 1
        if self.chassis.contact:
            self.touched = True
        for motor in self.motors:
            motor.step(CONTROL_PERIOD)
        left, right = self.chassis.ground_speed
        self.motion.period((left + right) / 2, self.chassis.heading)
        if self.panel.avoiding and self.ticks % _AVOID_TICKS == 0:
            self._avoid()

    def drive(self, left: int, right: int) -> None:
        """Tell the motors their speeds; while it avoids obstacles, those are what it aims at."""
        self.panel.speeds[:] = left, right
        if not self.panel.avoiding:
            for motor, speed in zip(self.motors, (left, right), strict=True):
                motor.drive(wrapped(speed, 16))

    def avoid_obstacles(self, avoiding: bool) -> None:
        """Begin or end to avoid obstacles."""
        self.panel.avoiding = avoiding

    def proximity(self) -> tuple[int, ...]:
        """Read the infrared sensors: eight counts above their zeros."""
        counts = self.ring.counts(self._reflected(), self.panel.zeros)
        return counts if self.ailments is None else self.ailments.proximity(self.time, counts)

    def ambient(self) -> tuple[int, ...]:
        """Read ambient light: eight counts."""
        light = self._scan("ambient")
        counts = tuple(map(int, light))
        if self.ailments is None:
            return counts
        return self.ailments.ambient(self.time, counts, self.model.dark)

    def calibrate(self) -> None:
        """Take the infrared sensors' zeros, as they are now."""
        self.panel.zeros = self.ring.zeros(*self._place())

    def battery(self) -> int:
        """Read the battery, raw."""
        raw = self.model.battery[0]
        return raw if self.ailments is None else self.ailments.battery(self.time, raw)

    def volumes(self) -> tuple[int, ...]:
        """Read the microphones: a quiet room."""
        return tuple(self._ears.integers(_QUIET, _LOUD, self.model.volumes).tolist())

    def sound(self) -> bytes:
        """Return the microphones' buffer: 100 numbers of 16 bits of each of three."""
        samples = self._ears.integers(-_QUIET, _QUIET, 300) + 2048
        return samples.astype("<i2").tobytes()

    def distance(self) -> int:
        """Read the time of flight, in mm; switched off it reads what it read last."""
        tick = self.ticks // _RANGE_TICKS
        if self.panel.ranging and tick != self._distance_tick:
            self._distance_tick = tick
            self._distance = ranging.measure(self.chassis.scene, *self._place(), self._echo)
        return self._distance

    def ground(self) -> tuple[int, ...]:
        """Read the board of ground sensors, three and two for cliffs; zeros without the board."""
        count = self.choices.generation.ground
        if count < len(ground.PLACES) or not self.choices.switches.ground:
            return (0,) * count
        return ground.read(self._world.arena, *self._place(), self._floor)

    def gyro(self) -> tuple[int, int, int]:
        """Read the gyroscope; zeros where there is none."""
        return (0, 0, 0) if self.choices.switches.first_revision else self.motion.turning()

    def picture(self, picture: Picture) -> bytes:
        """Take a picture with its parameters; the bytes of its pixels."""
        # made when first asked for: many programs never do
        if self._eye is None:
            self._eye = Eye(self._world, self.model, self.chassis, self._grain)
        return self._eye.take(picture, self._view())

    def press_key(self, data: int, address: int = 0) -> None:
        """Press a key of an infrared remote control.

        Args:
            data: the key; 1 to 9 drive, 0 makes a sound.
            address: of the control's device, 0 or 8 for this robot.
        """
        panel = self.panel
        panel.remote = (1 - panel.remote[0], address, data)
        if address not in _REMOTE_ADDRESSES or data == panel.key:
            return
        panel.key = data
        if data == 0:
            panel.sound = _REMOTE_SOUND
            return
        left, right = _REMOTE_SPEEDS.get(data, (0.0, 0.0))
        self.drive(int(_REMOTE_SPEED * left), int(_REMOTE_SPEED * right))

    def _avoid(self) -> None:
        wanted = [wrapped(speed, 16) for speed in self.panel.speeds]
        speeds = avoid(wanted, self.proximity())
        for motor, speed in zip(self.motors, speeds, strict=True):
            motor.drive(speed)

    def _intend(self) -> tuple[Pair, Pair]:
        """Return ways in metres that the motors give the wheels in this period, and their slips."""
        left, right = self.motors
        if self._is_forgotten():
            self.panel.speeds[:] = 0, 0
            left.drive(0)
            right.drive(0)
        paces = left.pace, right.pace
        if self.ailments is not None:
            # a weak motor loses steps that are counted all the same
            paces = self.ailments.speeds(self.time, paces)
        way = STEP * CONTROL_PERIOD
        slip = self._draw_slip(paces[0] * paces[1] < 0.0)
        return (paces[0] * way, paces[1] * way), slip

    def _reflected(self) -> Scan:
        if not self.panel.scanning:
            return (0.0,) * len(self.model.offsets)
        return self._scan("reflected")

    def _scan(self, name: str) -> Scan:
        """Return the scan of the present control period."""
        if self._scan_tick != self.ticks:
            self._scan_tick = self.ticks
            self._scans.clear()
        if name not in self._scans:
            look = self.ring.ambient if name == "ambient" else self.ring.reflected
            self._scans[name] = look(*self._place())
        return self._scans[name]

    def _place(self) -> tuple[float, float, float]:
        chassis = self.chassis
        return chassis.x, chassis.y, chassis.heading

    def _view(self) -> Pose:
        pose = self.chassis.pose
        if self.ailments is None:
            return pose
        turned = self.ailments.heading(self.time)
        return pose.model_copy(update={"heading": pose.heading + turned})
