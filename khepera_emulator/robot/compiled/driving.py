"""A robot's control periods, compiled; `robot.Robot.run` with `body.chassis` is the plain form."""

from math import cos, sin
from typing import Any

import numpy as np
from khepera_protocol.serial.units import CONTROL_PERIOD, PULSE
from khepera_protocol.system.compiled import compiled, part

from khepera_emulator.robot.compiled.layout import LEFT, RIGHT
from khepera_emulator.robot.compiled.solids import clearance, gap_to, hypot, toward
from khepera_emulator.robot.compiled.wheels import at_rest, control, roll

_SCAN_TICKS = 2
_HELD = 1e-6
_SPOT_SLIP = 2.0
_CLOSE = 1e-4
_LEAST_GRIP = 0.2
_WALL = 0.06
_PUSH_OUT = 0.2
_TURNS = 40
_SLIPPING = 1e-4


@compiled
def run(robot: Any, walls: Any, slips: Any, ticks: int, stage: Any) -> None:
    """Let control periods pass up to a number of them.

    Args:
        robot: a record of `layout.ROBOT`.
        walls: impulses of what it pushes, shape (solids, 2).
        slips: drawn slips of its wheels, as many as there are periods at least, shape (K, 2).
        ticks: number of the last period.
        stage: see `layout.Stage`.
    """
    while robot.ticks < ticks:
        if at_rest(robot, LEFT) and at_rest(robot, RIGHT):
            robot.ground_speed[0] = robot.ground_speed[1] = 0.0
            if ticks // _SCAN_TICKS > robot.ticks // _SCAN_TICKS:
                start_scan(robot)
            robot.ticks = ticks
            return
        _period(robot, walls, slips, stage)


@part
def start_scan(robot: Any) -> None:
    """Let the sensors look from where the robot is now."""
    robot.scan[0], robot.scan[1], robot.scan[2] = robot.x, robot.y, robot.heading
    robot.scanned = 0


@part
def _period(robot: Any, walls: Any, slips: Any, stage: Any) -> None:
    model = stage.model[0]
    free_left, free_right = control(robot, LEFT, model), control(robot, RIGHT, model)
    mean_left = (robot.speed[0] + free_left) / 2
    mean_right = (robot.speed[1] + free_right) / 2
    sd = robot.slip * _SPOT_SLIP if mean_left * mean_right < 0.0 else robot.slip
    slip_left, slip_right = sd * slips[robot.slips, 0], sd * slips[robot.slips, 1]
    robot.slips += 1
    left, right = mean_left * PULSE, mean_right * PULSE
    _go(
        robot,
        walls,
        left * (robot.scale[0] * max(1.0 + slip_left, _LEAST_GRIP)),
        right * (robot.scale[1] * max(1.0 + slip_right, _LEAST_GRIP)),
        stage,
    )
    robot.ticks += 1
    if robot.contact:
        robot.touched = 1
    turned = left / PULSE
    roll(robot, LEFT, turned, free_left if abs(turned - mean_left) <= _HELD else turned)
    turned = right / PULSE
    roll(robot, RIGHT, turned, free_right if abs(turned - mean_right) <= _HELD else turned)
    if robot.ticks % _SCAN_TICKS == 0:
        start_scan(robot)


@part
def _go(robot: Any, walls: Any, left: float, right: float, stage: Any) -> None:
    """Go the ways of both wheels over ground, as far as walls allow."""
    radius = stage.model[0].radius
    reach = max(abs(left), abs(right))
    limit = reach + _CLOSE
    if robot.free_way < limit or robot.sliding:
        gap = clearance(stage.solids, robot.x, robot.y)
        if gap <= radius + limit or robot.sliding:
            _go_along(robot, walls, left, right, radius + limit, stage)
            return
        robot.free_way = gap - radius
    robot.free_way -= reach
    robot.contact = 0
    _glide(robot, left, right)


@part
def _glide(robot: Any, left: float, right: float) -> None:
    turn = (right - left) / robot.wheel_base
    half, way = turn / 2, (left + right) / 2
    if not -1e-9 <= half <= 1e-9:
        way *= sin(half) / half
    middle = robot.heading + half
    robot.x += way * cos(middle)
    robot.y += way * sin(middle)
    robot.heading += turn
    robot.ground_speed[0] = left / CONTROL_PERIOD
    robot.ground_speed[1] = right / CONTROL_PERIOD


@part
def _go_along(robot: Any, walls: Any, left: float, right: float, reach: float, stage: Any) -> None:
    """Go close to solids, or until the tyres have stopped slipping: glide, or push."""
    radius, solids = stage.model[0].radius, stage.solids
    robot.free_way = 0.0
    turn = (right - left) / robot.wheel_base
    middle = robot.heading + (robot.motion[2] * CONTROL_PERIOD if robot.sliding else turn) / 2
    c, s, way = cos(middle), sin(middle), (left + right) / 2
    touches, gap = 0, _CLOSE
    for k in range(len(solids)):
        if gap_to(solids[k], robot.x, robot.y) <= reach:
            distance, nx, ny = toward(solids[k], robot.x, robot.y)
            gap = min(gap, distance - radius - way * (c * nx + s * ny))
            touches += 1
    if not robot.sliding:
        if gap > 0.0 or touches == 0:
            robot.contact = gap < _CLOSE
            _glide(robot, left, right)
            return
        before_left, before_right = robot.ground_speed[0], robot.ground_speed[1]
        robot.motion[0] = (before_left + before_right) / 2
        robot.motion[1] = 0.0
        robot.motion[2] = (before_right - before_left) / robot.wheel_base
    _push(robot, walls, left / CONTROL_PERIOD, right / CONTROL_PERIOD, reach, c, s, stage)
    ahead, aside, rate = robot.motion[0], robot.motion[1], robot.motion[2]
    robot.x += (c * ahead - s * aside) * CONTROL_PERIOD
    robot.y += (s * ahead + c * aside) * CONTROL_PERIOD
    robot.heading += rate * CONTROL_PERIOD
    half = rate * robot.wheel_base / 2
    robot.ground_speed[0], robot.ground_speed[1] = ahead - half, ahead + half
    robot.contact = robot.pressing or gap < _CLOSE
    robot.sliding = 1
    if not (robot.pressing or robot.slipping):
        robot.sliding = 0
        robot.walls = 0
        robot.tyres[:] = 0.0


@part
def _push(
    robot: Any,
    walls: Any,
    wheel_left: float,
    wheel_right: float,
    reach: float,
    c: float,
    s: float,
    stage: Any,
) -> None:
    """Find the motion at the end of a period in which something is in the way; see `Contact`."""
    model, solids = stage.model[0], stage.solids
    light, radius, mass = model.light, model.radius, model.mass
    turns_arm, turns_radius, arm = robot.turns_arm, robot.turns_radius, robot.arm
    # the nearby solids: gap, and how far ahead and left the way to each leads
    touches = np.empty((len(solids), 4))
    n = 0
    for k in range(len(solids)):
        if gap_to(solids[k], robot.x, robot.y) <= reach:
            distance, nx, ny = toward(solids[k], robot.x, robot.y)
            gap = distance - radius
            touches[n, 0] = c * nx + s * ny
            touches[n, 1] = c * ny - s * nx
            touches[n, 2] = (gap if gap > 0.0 else _PUSH_OUT * gap) / CONTROL_PERIOD
            n += 1
    ahead, left, rate = robot.motion[0], robot.motion[1], robot.motion[2]
    al, ll, ar, lr = robot.tyres[0], robot.tyres[1], robot.tyres[2], robot.tyres[3]
    if robot.walls != n:
        walls[:n] = 0.0
    ahead += light * (al + ar)
    left += light * (ll + lr)
    rate += turns_arm * (ar - al)
    for k in range(n):
        press, drag = walls[k, 0], walls[k, 1]
        ahead -= light * (press * touches[k, 0] + drag * touches[k, 1])
        left -= light * (press * touches[k, 1] - drag * touches[k, 0])
        rate += turns_radius * drag
    for _ in range(_TURNS):
        change = lean = 0.0
        for k in range(n):
            to_ahead, to_left = touches[k, 0], touches[k, 1]
            before, drag_before = walls[k, 0], walls[k, 1]
            press = before + (ahead * to_ahead + left * to_left - touches[k, 2]) * mass
            press = max(press, 0.0)
            most = _WALL * press
            step = press - before
            ahead -= light * step * to_ahead
            left -= light * step * to_left
            drag = drag_before - (left * to_ahead - ahead * to_left + radius * rate) * robot.rub
            drag = most if drag > most else -most if drag < -most else drag
            walls[k, 0], walls[k, 1] = press, drag
            change += abs(step)
            lean += press * to_left
            step = drag - drag_before
            ahead -= light * step * to_left
            left += light * step * to_ahead
            rate += turns_radius * step
        lean *= robot.lean
        lean = min(max(lean, -model.hold), model.hold)
        al, ll, step, aside = _grip(
            al, ll, ahead - arm * rate - wheel_left, left, model.hold - lean, robot.stiff
        )
        ahead += light * step
        left += light * aside
        rate -= turns_arm * step
        change += abs(step) + abs(aside)
        ar, lr, step, aside = _grip(
            ar, lr, ahead + arm * rate - wheel_right, left, model.hold + lean, robot.stiff
        )
        ahead += light * step
        left += light * aside
        rate += turns_arm * step
        change += abs(step) + abs(aside)
        if change < model.tolerance:
            break
    robot.tyres[0], robot.tyres[1], robot.tyres[2], robot.tyres[3] = al, ll, ar, lr
    robot.walls = n
    robot.pressing = 0
    for k in range(n):
        if walls[k, 0] > 0.0:
            robot.pressing = 1
    slip = abs(left) + abs(ahead - arm * rate - wheel_left)
    robot.slipping = slip + abs(ahead + arm * rate - wheel_right) > _SLIPPING
    robot.motion[0], robot.motion[1], robot.motion[2] = ahead, left, rate


@part
def _grip(
    along: float, across: float, slip: float, left: float, most: float, stiff: float
) -> tuple[float, float, float, float]:
    """Let a tyre hold its point on the floor; returns its impulse, and by how much that changed."""
    a, b = along - stiff * slip, across - stiff * left
    size = hypot(a, b)
    if size > most:
        a, b = a * most / size, b * most / size
    return a, b, a - along, b - across
