"""A scan of the infrared sensors, compiled; `senses.infrared.Infrared` is the plain form."""

from math import cos, inf, sin
from typing import Any

import numpy as np
from khepera_protocol.system.compiled import part

from khepera_emulator.robot.compiled.solids import gap_to, ray, toward

_TABLE_STEP = 0.001
_BLACK_LOSS = 0.5
_NOISE_SPAN, _NOISE_DEPTH = 13.5, 6.5
_HALF = _NOISE_DEPTH / _NOISE_SPAN
_NOTHING = -1.0


@part
def proximity(robot: Any, noise: Any, stage: Any) -> None:
    """Put the counts of the latest scan into the record of a robot.

    Args:
        robot: a record of `layout.ROBOT`.
        noise: a normal and a uniform number of each sensor, shape (2, 8).
        stage: see `layout.Stage`.
    """
    model, curves = stage.model[0], stage.curves
    x, y = robot.scan[0], robot.scan[1]
    c, s = cos(robot.scan[2]), sin(robot.scan[2])
    # the nearby solids: number, gap to the robot's middle, and how far ahead and left each is
    walls = np.empty((len(stage.solids), 4))
    n = 0
    for k in range(len(stage.solids)):
        if gap_to(stage.solids[k], x, y) <= model.sight:
            gap, nx, ny = toward(stage.solids[k], x, y)
            walls[n, 0], walls[n, 1] = k, gap
            walls[n, 2], walls[n, 3] = c * nx + s * ny, c * ny - s * nx
            n += 1
    if n == 0 and model.silent:
        for sensor in range(8):
            u = noise[1, sensor]
            robot.counts[sensor] = int(_NOISE_SPAN * u - _NOISE_DEPTH) if u > _HALF else 0
        return
    for sensor in range(8):
        gap = inf if n == 0 else _gap(sensor, walls[:n], x, y, c, s, stage)
        value = model.residual[sensor] if gap == inf else _response(curves[sensor], gap)
        if value > 0.0:
            value += noise[0, sensor] * (model.fixed + model.relative * value)
        else:
            value = _NOISE_SPAN * noise[1, sensor] - _NOISE_DEPTH
        count = 0
        if value > 0.0:
            count = min(int(value), model.top) // model.step * model.step
        robot.counts[sensor] = count


@part
def _response(curve: Any, gap: float) -> float:
    place = max(gap, 0.0) / _TABLE_STEP
    index = min(int(place), len(curve) - 2)
    low = curve[index]
    return float(low + (place - index) * (curve[index + 1] - low))


@part
def _gap(sensor: int, walls: Any, x: float, y: float, c: float, s: float, stage: Any) -> float:
    model, solids = stage.model[0], stage.solids
    foot_ahead, foot_left = model.foot[sensor, 0], model.foot[sensor, 1]
    reach = model.reach
    best = reach
    for k in range(5):
        ahead, left, penalty = (
            model.rays[sensor, k, 0],
            model.rays[sensor, k, 1],
            model.rays[sensor, k, 2],
        )
        distance = best - penalty
        shade = _NOTHING
        for wall in range(len(walls)):
            gap, to_ahead, to_left = walls[wall, 1], walls[wall, 2], walls[wall, 3]
            room = gap - foot_ahead * to_ahead - foot_left * to_left
            if room < distance * (ahead * to_ahead + left * to_left) or room <= 0.0:
                solid = solids[int(walls[wall, 0])]
                way = ray(
                    solid,
                    x + (c * foot_ahead - s * foot_left),
                    y + (s * foot_ahead + c * foot_left),
                    c * ahead - s * left,
                    s * ahead + c * left,
                )
                if way < distance:
                    distance, shade = way, solid.grey
        if shade != _NOTHING:
            dim = (_BLACK_LOSS - _BLACK_LOSS * shade) * max(reach - distance, 0.0)
            best = min(best, distance + dim + penalty)
    return best if best < reach else inf
