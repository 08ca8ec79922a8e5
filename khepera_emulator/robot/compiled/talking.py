"""Exchanges on a silent line, compiled: requests, replies, and the time that both take.

Lengths are those of the texts that `khepera_protocol.serial.messages` makes. The plain form is a
client over a `khepera://` port.
"""

from math import copysign, floor
from typing import Any

import numpy as np
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.system.compiled import part

from khepera_emulator.robot.compiled.driving import run
from khepera_emulator.robot.compiled.layout import LEFT, POSITION, RIGHT, SPEED
from khepera_emulator.robot.compiled.sensing import proximity
from khepera_emulator.robot.compiled.wheels import counter, wrap

_LETTER: Any = np.int64(2)
"""Bytes of a request without arguments."""

_REPLY: Any = np.int64(3)
"""Bytes of a reply without values."""

_FULL_DUTY = 255.0


@part
def ask_sensors(robot: Any, walls: Any, slips: Any, noises: Any, line: Any, stage: Any) -> None:
    """N: put the latest proximity scan into the record."""
    due = _send(robot, walls, slips, _LETTER, line, stage)
    if not robot.scanned:
        proximity(robot, noises[robot.noises], stage)
        robot.noises += 1
        robot.scanned = 1
    length = _REPLY
    for sensor in range(8):
        length += 1 + _width(robot.counts[sensor])
    _receive(robot, walls, slips, due, length, line, stage)


@part
def ask_controllers(robot: Any, walls: Any, slips: Any, line: Any, stage: Any) -> None:
    """K: put what the motion controllers tell into the record."""
    due = _send(robot, walls, slips, _LETTER, line, stage)
    length = _REPLY
    for w in range(2):
        error = wrap(robot.target[w] - counter(robot, w))
        robot.told_reached[w], robot.told_error[w] = robot.reached[w], error
        length += 5 + _width(error)
    _receive(robot, walls, slips, due, length, line, stage)


@part
def ask_counters(robot: Any, walls: Any, slips: Any, counts: Any, line: Any, stage: Any) -> None:
    """H: return both encoder counters in an array."""
    due = _send(robot, walls, slips, _LETTER, line, stage)
    length = _REPLY
    for w in range(2):
        counts[w] = counter(robot, w)
        length += 1 + _width(counts[w])
    _receive(robot, walls, slips, due, length, line, stage)


@part
def zero_counters(robot: Any, walls: Any, slips: Any, line: Any, stage: Any) -> None:
    """G: set both encoder counters to 0."""
    due = _send(robot, walls, slips, _LETTER + 4, line, stage)
    for w in range(2):
        robot.reference[w] -= counter(robot, w)
        robot.offset[w] = -floor(robot.travel[w])
    _receive(robot, walls, slips, due, _REPLY, line, stage)


@part
def set_speeds(
    robot: Any, walls: Any, slips: Any, left: int, right: int, line: Any, stage: Any
) -> None:
    """D: hold wheel speeds."""
    length = _LETTER + 2 + _width(left) + _width(right)
    due = _send(robot, walls, slips, length, line, stage)
    hold_speed(robot, LEFT, left, stage)
    hold_speed(robot, RIGHT, right, stage)
    _receive(robot, walls, slips, due, _REPLY, line, stage)


@part
def set_profiles(robot: Any, walls: Any, slips: Any, profiles: Any, line: Any, stage: Any) -> None:
    """J: set top speed and acceleration of each wheel, shape (2, 2)."""
    length = _LETTER
    for w in range(2):
        for k in range(2):
            length += 1 + _width(profiles[w, k])
    due = _send(robot, walls, slips, length, line, stage)
    for w in range(2):
        for k in range(2):
            robot.profile[w][k] = profiles[w, k]
    _receive(robot, walls, slips, due, _REPLY, line, stage)


@part
def set_targets(
    robot: Any, walls: Any, slips: Any, left: int, right: int, line: Any, stage: Any
) -> None:
    """C: go to counter values."""
    length = _LETTER + 2 + _width(left) + _width(right)
    due = _send(robot, walls, slips, length, line, stage)
    _go_to(robot, LEFT, left)
    _go_to(robot, RIGHT, right)
    _receive(robot, walls, slips, due, _REPLY, line, stage)


@part
def hold_speed(robot: Any, w: int, speed: int, stage: Any) -> None:
    """Let a wheel hold a speed; see `Wheel.drive_speed`."""
    if robot.mode[w] != SPEED:
        model, gain, now = stage.model[0], robot.speed_gains[w][1], robot.speed[w]
        robot.last_error[w] = robot.reference_speed[w] = 0.0
        duty = 0.0
        if now != 0.0:
            room = _FULL_DUTY - model.friction
            duty = copysign(model.friction, now) + now * room / model.top_speed
        robot.integral[w] = duty * (model.gain_scale / gain if gain != 0 else 0.0)
    robot.mode[w], robot.set_speed[w], robot.reached[w] = SPEED, speed, 0


@part
def _go_to(robot: Any, w: int, target: int) -> None:
    if robot.mode[w] != POSITION:
        robot.integral[w] = robot.last_error[w] = 0.0
        robot.reference[w], robot.reference_speed[w] = float(counter(robot, w)), robot.speed[w]
    robot.mode[w], robot.target[w], robot.reached[w] = POSITION, target, 0


@part
def _send(robot: Any, walls: Any, slips: Any, length: int, line: Any, stage: Any) -> float:
    """Let time pass until a request of so many bytes is carried out; returns that time."""
    _pass_to(robot, walls, slips, robot.now + line.writing, stage)
    due = max(robot.receiver_free, robot.now) + line.each * length
    robot.receiver_free = due
    _pass_to(robot, walls, slips, due, stage)
    return float(due)


@part
def _receive(
    robot: Any, walls: Any, slips: Any, due: float, length: int, line: Any, stage: Any
) -> None:
    """Let time pass until the last byte of a reply has arrived."""
    robot.interpreter_free = due + line.busy
    robot.heard = robot.ticks
    sent = max(robot.sender_free, due + line.busy) + line.each * length
    robot.sender_free = sent
    _pass_to(robot, walls, slips, sent, stage)


@part
def _pass_to(robot: Any, walls: Any, slips: Any, moment: float, stage: Any) -> None:
    """Let time pass to a moment of the line."""
    ticks = int((moment - robot.power_time) / CONTROL_PERIOD + 1e-6)
    if ticks > robot.ticks:
        run(robot, walls, slips, ticks, stage)
    robot.now = moment


@part
def _width(number: int) -> int:
    """Return the characters of a number."""
    width = 1
    if number < 0:
        number, width = -number, 2
    while number > 9:
        number //= 10
        width += 1
    return width
