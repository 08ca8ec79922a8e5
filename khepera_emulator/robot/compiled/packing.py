"""A robot as a record of numbers, and back: between its objects and compiled functions."""

from typing import Any, Final

import numpy as np

from khepera_emulator.body.contact import Motion
from khepera_emulator.body.motors import Mode
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
        walls: impulses of what it pushes, shape (solids, 2).
    """

    def __init__(self, robot: Robot, solids: int) -> None:
        self.records = np.zeros(1, ROBOT)
        self.walls: Array = np.zeros((solids, 2))
        self._robot = robot
        self._views: dict[str, Any] = {name: self.records[name][0] for name in ROBOT.names or ()}
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
        robot, (record,) = self._robot, self.records.tolist()
        is_ = dict(zip(ROBOT.names or (), record, strict=True))
        for w, wheel in enumerate(robot.wheels):
            for name in _WHEEL:
                setattr(wheel, name, is_[name][w].item())
            wheel.reached = bool(wheel.reached)
        chassis = robot.chassis
        pushing = chassis.pushing
        for name in ("x", "y", "heading", "free_way"):
            setattr(chassis, name, is_[name])
        chassis.contact = bool(is_["contact"])
        chassis.ground_speed = tuple(is_["ground_speed"].tolist())
        chassis.sliding = Motion(*is_["motion"].tolist()) if is_["sliding"] else None
        pushing.tyres = tuple(is_["tyres"].tolist())
        pushing.walls = [(press, drag) for press, drag in self.walls[: is_["walls"]].tolist()]
        pushing.pressing, pushing.slipping = bool(is_["pressing"]), bool(is_["slipping"])
        robot.touched = bool(is_["touched"])
        if is_["ticks"] // SCAN_TICKS != robot.ticks // SCAN_TICKS:
            robot.scans.clear()
        robot.ticks, robot.heard_at = is_["ticks"], is_["heard"]
        robot.scan_pose = tuple(is_["scan"].tolist())
        if is_["scanned"]:
            robot.scans[_PROXIMITY] = tuple(is_["counts"].tolist())
        robot.slips.skip(is_["slips"])
        robot.infrared.noise.skip(is_["noises"])


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
