"""A robot as a record of numbers, and back: between its objects and compiled functions."""

from typing import Any, Final

import numpy as np

from khepera_emulator.body.contact import Motion
from khepera_emulator.body.motors import Mode, Profile
from khepera_emulator.line.clock import WRITE_TIME
from khepera_emulator.line.uart import Uart
from khepera_emulator.robot.compiled.layout import (
    DUTY,
    LINE,
    MODEL,
    POSITION,
    ROBOT,
    SOLID,
    SPEED,
    Records,
    Stage,
)
from khepera_emulator.robot.khepera.robot import SCAN_TICKS, Robot
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.rays import Array

_NUMBERS = {Mode.SPEED: SPEED, Mode.POSITION: POSITION, Mode.DUTY: DUTY}
_MODES = {number: mode for mode, number in _NUMBERS.items()}

_WHEEL = (
    *("set_speed", "target", "set_duty", "travel", "speed", "measured", "offset", "reached"),
    *("reference", "reference_speed", "integral", "last_error"),
)
"""Fields of a wheel that are named as in its class."""

_PLACE: Final = {name: ROBOT.fields[name][1] // 8 for name in ROBOT.names or () if ROBOT.fields}
"""Place of each field among the numbers of a record, or of its first number."""

_REAL_WHEEL = tuple(name for name in _WHEEL if ROBOT[name].base.kind == "f")
_WHOLE_WHEEL = tuple(name for name in _WHEEL if ROBOT[name].base.kind == "i")

_CONTACT = ("arm", "turns_arm", "turns_radius", "stiff", "rub", "lean")

_PROXIMITY = "proximity"

_SLOWEST: Final = 4800
"""Bits a second below which an exchange takes more control periods than are drawn ahead."""


def stage_of(plan: FloorPlan, robot: Robot) -> Stage:
    """Return all about a robot's world that stays the same."""
    curves = np.array([sensor.curve for sensor in robot.infrared.sensors])
    return Stage(_model(robot), curves, _solids(plan))


def is_quick(baud: int | None) -> bool:
    """Tell whether a line is one that compiled functions can be on; None: it takes no time."""
    return baud is None or baud >= _SLOWEST


def line_of(uart: Uart) -> np.void:
    """Return the times of a line, a record."""
    line = np.zeros(1, LINE)
    line[0] = (uart.each, uart.busy, WRITE_TIME if uart.baud is None else 0.0)
    record: np.void = line[0]
    return record


class Packed:
    """The record of one robot, and what belongs to it.

    Attributes:
        records: one record.
        record: the same.
        walls: impulses of what it pushes, shape (solids, 2).
    """

    def __init__(self, robot: Robot, solids: int) -> None:
        self.records = np.zeros(1, ROBOT)
        self.walls: Array = np.zeros((solids, 2))
        self.record: Any = self.records[0]
        self._robot = robot
        self._views: dict[str, Any] = {name: self.records[name][0] for name in ROBOT.names or ()}
        # all fields are numbers of eight bytes: as a list of either kind they are read at once
        self._reals, self._wholes = self.records.view(np.float64), self.records.view(np.int64)
        record = self.records
        chassis = robot.chassis
        record["scale"] = chassis.left_scale, chassis.right_scale
        record["wheel_base"] = chassis.wheel_base
        record["slip"] = robot.drift.slip
        record["reached_within"] = robot.wheels[0].reached_within
        for name in _CONTACT:
            record[name] = getattr(chassis.pushing, name)

    def take(self) -> None:
        """Take over what the robot is like now."""
        robot, record = self._robot, self.records
        views = self._views
        for w, wheel in enumerate(robot.wheels):
            for name in _WHEEL:
                views[name][w] = getattr(wheel, name)
            views["mode"][w] = _NUMBERS[wheel.mode]
            for name in ("speed_gains", "position_gains"):
                gains = getattr(wheel, name)
                views[name][w] = gains.kp, gains.ki, gains.kd
            views["profile"][w] = wheel.profile.speed, wheel.profile.acceleration
        chassis = robot.chassis
        pushing, sliding = chassis.pushing, chassis.sliding
        for name in ("x", "y", "heading", "contact", "free_way"):
            record[name] = getattr(chassis, name)
        views["ground_speed"][:] = chassis.ground_speed
        record["touched"] = robot.touched
        record["sliding"] = sliding is not None
        views["motion"][:] = sliding or (0.0, 0.0, 0.0)
        views["tyres"][:] = pushing.tyres
        record["walls"] = len(pushing.walls)
        if pushing.walls:
            self.walls[: len(pushing.walls)] = pushing.walls
        record["pressing"], record["slipping"] = pushing.pressing, pushing.slipping
        record["ticks"], record["heard"] = robot.ticks, robot.heard_at
        views["scan"][:] = robot.scan_pose
        counts = robot.scans.get(_PROXIMITY)
        record["scanned"] = counts is not None
        views["counts"][:] = counts or 0
        record["slips"] = record["noises"] = 0

    def give(self) -> None:
        """Hand back what the robot is like now."""
        robot, reals, wholes = self._robot, self._reals.tolist(), self._wholes.tolist()
        both = range(2)
        for w, wheel in zip(both, robot.wheels, strict=True):
            for name in _WHOLE_WHEEL:
                setattr(wheel, name, wholes[_PLACE[name] + w])
            for name in _REAL_WHEEL:
                setattr(wheel, name, reals[_PLACE[name] + w])
            wheel.reached = bool(wheel.reached)
            wheel.mode = _MODES[wholes[_PLACE["mode"] + w]]
            profile = _PLACE["profile"] + 2 * w
            wheel.profile = Profile(wholes[profile], wholes[profile + 1])
        chassis = robot.chassis
        pushing = chassis.pushing
        for name in ("x", "y", "heading", "free_way"):
            setattr(chassis, name, reals[_PLACE[name]])
        chassis.contact = bool(wholes[_PLACE["contact"]])
        chassis.ground_speed = _several(reals, "ground_speed", 2)
        sliding = wholes[_PLACE["sliding"]]
        chassis.sliding = Motion(*_several(reals, "motion", 3)) if sliding else None
        pushing.tyres = _several(reals, "tyres", 4)
        pushed = wholes[_PLACE["walls"]]
        pushing.walls = [(press, drag) for press, drag in self.walls[:pushed].tolist()]
        pushing.pressing = bool(wholes[_PLACE["pressing"]])
        pushing.slipping = bool(wholes[_PLACE["slipping"]])
        robot.touched = bool(wholes[_PLACE["touched"]])
        ticks = wholes[_PLACE["ticks"]]
        if ticks // SCAN_TICKS != robot.ticks // SCAN_TICKS:
            robot.scans.clear()
        robot.ticks, robot.heard_at = ticks, wholes[_PLACE["heard"]]
        robot.scan_pose = _several(reals, "scan", 3)
        if wholes[_PLACE["scanned"]]:
            robot.scans[_PROXIMITY] = self.counts
        robot.slips.skip(wholes[_PLACE["slips"]])
        robot.infrared.noise.skip(wholes[_PLACE["noises"]])

    @property
    def counts(self) -> tuple[int, ...]:
        """The proximity scan that was read last."""
        return tuple(self._views["counts"].tolist())


def _several(numbers: list[float], name: str, count: int) -> Any:
    """Return the numbers of a field that has several."""
    return tuple(numbers[_PLACE[name] : _PLACE[name] + count])


def _model(robot: Robot) -> Records:
    model, infrared, contact = robot.model, robot.infrared, robot.chassis.pushing
    record = np.zeros(1, MODEL)
    record["radius"], record["mass"] = model.radius, model.mass
    for name in ("light", "hold", "tolerance"):
        record[name] = getattr(contact, name)
    motor = model.motor
    for name in ("friction", "top_speed", "gain_scale"):
        record[name] = getattr(motor, name)
    record["response"] = robot.wheels[0].response
    for name in ("reach", "sight", "top", "step", "silent"):
        record[name] = getattr(infrared, name)
    record["fixed"], record["relative"] = infrared.spread
    record["residual"] = infrared.residual
    record["foot"] = [sensor.foot for sensor in infrared.sensors]
    record["rays"] = [sensor.rays for sensor in infrared.sensors]
    return record


def _solids(plan: FloorPlan) -> Records:
    solids = np.zeros(len(plan.boxes) + len(plan.posts), SOLID)
    for k, box in enumerate(plan.boxes):
        for name in ("x", "y", "ux", "uy", "half_length", "half_thickness", "grey"):
            solids[name][k] = getattr(box, name)
    for k, disc in enumerate(plan.discs, len(plan.boxes)):
        solids["round"][k] = True
        for name in ("x", "y", "radius", "grey"):
            solids[name][k] = getattr(disc, name)
    return solids
