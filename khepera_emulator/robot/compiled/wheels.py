"""Both wheels of a robot, compiled; `body.motors.Wheel` is the plain form."""

from math import floor, sqrt
from typing import Any

from khepera_protocol.system.compiled import part

from khepera_emulator.robot.compiled.layout import DUTY, POSITION, SPEED

_FULL_DUTY = 255.0
_HALF_RANGE = 2.0**31
_CREEP = 0.05


@part
def wrap(count: int) -> int:
    """Return a count as a signed 32-bit number holds it."""
    return (count + 2**31) % 2**32 - 2**31


@part
def counter(robot: Any, w: int) -> int:
    """Return the encoder counter of a wheel."""
    return wrap(floor(robot.travel[w]) + robot.offset[w])


@part
def at_rest(robot: Any, w: int) -> bool:
    """Tell whether a wheel stands and nothing drives it."""
    if robot.speed[w] != 0.0 or robot.measured[w] != 0:
        return False
    if robot.mode[w] == POSITION:
        return robot.reached[w] != 0 and wrap(robot.target[w] - counter(robot, w)) == 0
    if robot.mode[w] == SPEED:
        return bool(robot.set_speed[w] == 0)
    return bool(robot.set_duty[w] == 0)


@part
def control(robot: Any, w: int, model: Any) -> float:
    """Run a wheel's controllers for one period; returns the speed that they would give it."""
    friction, top_speed = model.friction, model.top_speed
    room = _FULL_DUTY - friction
    mode = robot.mode[w]
    if mode == DUTY:
        duty = float(robot.set_duty[w])
    else:
        if mode == SPEED:
            error, forward = float(robot.set_speed[w] - robot.measured[w]), 0.0
            kp, ki, kd = robot.speed_gains[w][0], robot.speed_gains[w][1], robot.speed_gains[w][2]
        else:
            error = _follow(robot, w)
            forward = robot.reference_speed[w]
            gains = robot.position_gains[w]
            kp, ki, kd = gains[0], gains[1], gains[2]
        scale, integral = model.gain_scale, robot.integral[w]
        if ki != 0:
            integral += error
            limit = _FULL_DUTY * scale / ki
            if integral > limit:
                integral = limit
            elif integral < -limit:
                integral = -limit
            robot.integral[w] = integral
        duty = (kp * error + ki * integral + kd * (error - robot.last_error[w])) / scale
        robot.last_error[w] = error
        duty = _held(duty)
        if forward != 0.0:
            duty += (friction if forward > 0.0 else -friction) + forward * room / top_speed
            duty = _held(duty)
    if duty > friction:
        free = (duty - friction) * top_speed / room
    elif duty < -friction:
        free = (duty + friction) * top_speed / room
    else:
        free = 0.0
    speed = robot.speed[w] + (free - robot.speed[w]) * model.response
    return 0.0 if free == 0.0 and -_CREEP < speed < _CREEP else speed


@part
def roll(robot: Any, w: int, way: float, speed: float) -> None:
    """Take in what a wheel really did in a period: way in counts, speed at its end."""
    travel = robot.travel[w]
    after = travel + way
    robot.travel[w] = after
    robot.speed[w] = speed
    robot.measured[w] = floor(after) - floor(travel)
    if robot.mode[w] == POSITION and robot.reference_speed[w] == 0.0 and robot.reached[w] == 0:
        here = robot.reference[w] == robot.target[w]
        error = wrap(robot.target[w] - counter(robot, w))
        robot.reached[w] = here and abs(error) <= robot.reached_within


@part
def _held(duty: float) -> float:
    return _FULL_DUTY if duty > _FULL_DUTY else -_FULL_DUTY if duty < -_FULL_DUTY else duty


@part
def _follow(robot: Any, w: int) -> float:
    """Move the profile's reference on by a period; returns how far the wheel lags behind."""
    reference, speed = robot.reference[w], robot.reference_speed[w]
    way = robot.target[w] - reference
    if way != 0.0 or speed != 0.0:
        top, acceleration = float(robot.profile[w][0]), robot.profile[w][1] / 256
        if acceleration == 0.0 or top == 0.0:
            robot.reference_speed[w] = 0.0
        else:
            left = abs(way)
            wanted = (
                sqrt(2.0 * acceleration * left + acceleration * acceleration / 4) - acceleration / 2
            )
            wanted = min(wanted, top)
            change = (wanted if way >= 0.0 else -wanted) - speed
            if change > acceleration:
                change = acceleration
            elif change < -acceleration:
                change = -acceleration
            speed += change
            fast = abs(speed)
            if fast <= 2 * acceleration and left <= max(fast, 0.5 * acceleration):
                reference, speed = float(robot.target[w]), 0.0
            else:
                reference += speed
            robot.reference[w], robot.reference_speed[w] = reference, speed
    lag = reference - (floor(robot.travel[w]) + robot.offset[w])
    if not -_HALF_RANGE < lag < _HALF_RANGE:
        lag -= round(lag / 2.0**32) * 2.0**32
    return float(lag)
