"""A Khepera as its firmware finds it: wheels, sensors, lamps and bus, at one moment of time."""

from dataclasses import dataclass, field

import numpy as np
from khepera_protocol.serial.units import CONTROL_PERIOD, PULSE
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.body.motors import Gains, Profile, Wheel
from khepera_emulator.models import KheperaModel
from khepera_emulator.robot.ailments import Ailments
from khepera_emulator.robot.khepera.equipment import Equipment
from khepera_emulator.robot.rolling import Pair, Rolling
from khepera_emulator.senses.infrared import SCAN_PERIOD, Infrared
from khepera_emulator.turrets.grasp import WorldThings
from khepera_emulator.turrets.rack import Fittings, mount
from khepera_emulator.turrets.turret import Site
from khepera_emulator.world.world import World

SCAN_TICKS = round(SCAN_PERIOD / CONTROL_PERIOD)
"""Control periods from one scan of the sensors to the next."""

_BATTERY_COUNTS = 600
"""Channel 0: half of 4.8 V, as 2.4 V. Nothing documents channels 0 to 2 (a choice)."""

_HELD = 1e-6
"""Counts a period by which a wheel that nothing holds may miss what its motor wants."""


@dataclass(slots=True)
class Panel:
    """State that a client can set and see beside the motors: made anew with every power-on.

    Attributes:
        leds: whether they are on, the lateral one first.
        outputs: bytes written to the bus, by address.
        inputs: bytes on the bus, by address.
        analogue: counts at the A/D inputs.
        loading: whether requests go to the loader of S-records.
    """

    leds: list[bool] = field(default_factory=lambda: [False, False])
    outputs: dict[int, int] = field(default_factory=dict)
    inputs: dict[int, int] = field(default_factory=dict)
    analogue: list[int] = field(default_factory=lambda: [_BATTERY_COUNTS, 0, 0, 0, 0, 0])
    loading: bool = False


class Robot(Rolling):
    """One Khepera in a world; its time advances in control periods of 10 ms.

    Args:
        world: where it is.
        model: which of the two robots.
        pose: where it is put down.
        drift: what its encoders do not see.
        rng: source of all its randomness: slip, sensor noise and turrets have a stream each.
        equipment: what it carries, and the choices of its firmware.
        dead_man: seconds without a request after which it stops by itself; None: never.
        ailments: faults of its own; None: there are none.
    """

    panel: Panel

    def __init__(
        self,
        world: World,
        model: KheperaModel,
        pose: Pose,
        drift: WheelDrift,
        rng: np.random.Generator,
        equipment: Equipment | None = None,
        dead_man: float | None = None,
        ailments: Ailments | None = None,
    ) -> None:
        slip, sensors, turrets = rng.spawn(3)
        super().__init__(world, model, pose, drift, slip, dead_man, ailments)
        self.model = model
        self.equipment = equipment or Equipment()
        self.infrared = Infrared(model, self.chassis.scene, world.arena.lamp, sensors)
        self.scans: dict[str, tuple[int, ...]] = {}
        self._start_scan()
        self._free = self._counts = (0.0, 0.0)
        self.turrets = mount(self.equipment.turrets, self._fittings(world), turrets)
        self._carries = bool(self.turrets)
        self.power_on()

    def power_on(self) -> None:
        """Set everything that power-on, the reset button or `restart` sets; the body stays put.

        Turrets have processors of their own, which `restart` does not reach (a choice).
        """
        self.wheels = self._wheel(), self._wheel()
        self.panel = Panel()

    def put_down(self, pose: Pose) -> None:
        """Move the robot somewhere else and power it on afresh."""
        super().put_down(pose)
        self._free = self._counts = (0.0, 0.0)
        self._start_scan()
        self.turrets.power_on()

    @property
    def moving(self) -> bool:
        """True if a wheel turns or is driven."""
        left, right = self.wheels
        return not (left.at_rest() and right.at_rest())

    def rest(self, ticks: int) -> None:
        """Let control periods pass in which nothing moves; see `run`."""
        # nothing moves, whatever the time: only the latest of the scans counts
        self.chassis.ground_speed = (0.0, 0.0)
        if ticks // SCAN_TICKS > self.ticks // SCAN_TICKS:
            self._start_scan()
        self.ticks = ticks
        if self._carries:
            self.turrets.step(self.time)

    def arrive(self, ways: Pair) -> None:
        """End a control period in which the wheels have turned so many metres."""
        self.ticks += 1
        if self.chassis.contact:
            self.touched = True
        # the speed at the period's end: the motor's own, or what something that holds leaves of it
        (left, right), (wanted_left, wanted_right) = self.wheels, self._counts
        turned = ways[0] / PULSE
        left.roll(turned, self._free[0] if abs(turned - wanted_left) <= _HELD else turned)
        turned = ways[1] / PULSE
        right.roll(turned, self._free[1] if abs(turned - wanted_right) <= _HELD else turned)
        if self.ticks % SCAN_TICKS == 0:
            self._start_scan()
        if self._carries:
            self.turrets.step(self.time)

    def proximity(self) -> tuple[int, ...]:
        """Return the latest proximity scan: eight counts."""
        # computed when first asked for: most scans are never read
        if "proximity" not in self.scans:
            counts = self.infrared.proximity(*self.scan_pose)
            if self.ailments is not None:
                counts = self.ailments.proximity(self.time, counts)
            self.scans["proximity"] = counts
        return self.scans["proximity"]

    def ambient(self) -> tuple[int, ...]:
        """Return the latest ambient light scan: eight counts."""
        if "ambient" not in self.scans:
            counts = self.infrared.ambient(*self.scan_pose)
            if self.ailments is not None:
                counts = self.ailments.ambient(self.time, counts, self.model.dark)
            self.scans["ambient"] = counts
        return self.scans["ambient"]

    def analogue(self, channel: int) -> int:
        """Return the counts at an A/D input; the first one is the battery's."""
        counts = self.panel.analogue[channel]
        if channel or self.ailments is None:
            return counts
        return self.ailments.battery(self.time, counts)

    def _start_scan(self) -> None:
        chassis = self.chassis
        self.scan_pose = chassis.x, chassis.y, chassis.heading
        self.scans.clear()

    def _fittings(self, world: World) -> Fittings:
        equipment = self.equipment
        first = 0 if equipment.choices.pixels_from_zero else 1
        return Fittings(self._site(world), equipment.radio, equipment.number, first)

    def _site(self, world: World) -> Site:
        chassis, scene = self.chassis, self.chassis.scene
        return Site(
            radius=self.model.radius,
            place=lambda: (chassis.x, chassis.y, chassis.heading),
            rays=scene,
            sky=sum(world.arena.sky) / 3,
            things=WorldThings(world, scene),
        )

    def _intend(self) -> tuple[Pair, Pair]:
        """Return ways in metres that the motors give the wheels in this period, and their slips."""
        left, right = self.wheels
        if self._is_forgotten():
            left.drive_speed(0)
            right.drive_speed(0)
        free = left.control(), right.control()
        if self.ailments is not None:
            free = self.ailments.speeds(self.time, free)
        self._free = free_left, free_right = free
        # mean of the speeds at both ends of the period, in counts and metres a period
        mean_left, mean_right = (left.speed + free_left) / 2, (right.speed + free_right) / 2
        self._counts = mean_left, mean_right
        slip = self._draw_slip(mean_left * mean_right < 0.0)
        return (mean_left * PULSE, mean_right * PULSE), slip

    def _wheel(self) -> Wheel:
        model = self.model
        return Wheel(
            model.motor,
            Gains(*model.speed_gains),
            Gains(*model.position_gains),
            Profile(*model.profile),
            self.equipment.choices.reached_within,
        )
