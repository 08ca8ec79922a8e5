"""One wheel's motor and its controllers, stepped every 10 ms.

Three ways of driving a wheel, of which the last commanded wins at once: a duty cycle (P), a PID
on speed (D), and a PID on position (C) that follows a trapezoidal profile: the reference speeds
up with the profile's acceleration to its top speed, and begins to brake when the way left is the
braking distance v^2 / 2a. Positions are encoder counts, speeds counts a period.
"""

from dataclasses import dataclass, field
from enum import Enum, auto
from math import copysign, exp, floor, sqrt

from khepera_protocol.serial.units import CONTROL_PERIOD

from khepera_emulator.models import Motor

FULL_DUTY = 255.0


_HALF_RANGE = 2.0**31
_CREEP = 0.05
"""Speed below which standing friction stops a motor without drive."""


class Mode(Enum):
    """Controller that drives the wheel."""

    SPEED = auto()
    POSITION = auto()
    DUTY = auto()


_SPEED, _POSITION, _DUTY = Mode  # as names of their own: `control` asks for them a lot


@dataclass(slots=True)
class Gains:
    """Gains of a PID, in the fixed-point units of A and F."""

    kp: int
    ki: int
    kd: int


@dataclass(slots=True)
class Profile:
    """Limits of the position controller: top speed, and acceleration in 1/256 count a period^2."""

    speed: int
    acceleration: int


@dataclass(slots=True)
class Wheel:
    """Controller, motor and encoder of one wheel.

    Attributes:
        travel: way of the wheel in counts since power-on, with its fraction.
        speed: present speed.
        measured: counts of the last period, which is all that the controllers see.
        offset: what G added to the encoder.
        reached_within: counts between position and target at which a finished profile counts as
            reached.
    """

    motor: Motor
    speed_gains: Gains
    position_gains: Gains
    profile: Profile
    reached_within: int = 1
    mode: Mode = Mode.SPEED
    set_speed: int = 0
    target: int = 0
    set_duty: int = 0
    travel: float = 0.0
    speed: float = 0.0
    measured: int = 0
    offset: int = 0
    reached: bool = False
    reference: float = 0.0
    reference_speed: float = 0.0
    integral: float = 0.0
    last_error: float = 0.0
    response: float = field(init=False)

    def __post_init__(self) -> None:
        self.response = 1.0 - exp(-CONTROL_PERIOD / self.motor.time_constant)

    @property
    def counter(self) -> int:
        """Encoder counter, a signed 32-bit number that wraps."""
        return _wrap(floor(self.travel) + self.offset)

    @counter.setter
    def counter(self, value: int) -> None:
        self.reference += value - self.counter
        self.offset = value - floor(self.travel)

    @property
    def error(self) -> int:
        """Control error: target minus position, or set speed minus measured speed."""
        if self.mode is _POSITION:
            return _wrap(self.target - self.counter)
        return self.set_speed - self.measured if self.mode is _SPEED else 0

    def drive_speed(self, speed: int) -> None:
        """Hold a speed; the set-point counts at once."""
        if self.mode is not _SPEED:
            self._clear()
            # take over without a jump: the integral begins at the duty that holds this speed
            self.integral = self._holding_duty(self.speed) * self._scale(self.speed_gains.ki)
        self.mode, self.set_speed, self.reached = _SPEED, speed, False

    def drive_position(self, target: int) -> None:
        """Go to a counter value along the profile, from the present place and speed."""
        if self.mode is not _POSITION:
            self._clear()
            self.reference, self.reference_speed = float(self.counter), self.speed
        self.mode, self.target, self.reached = _POSITION, target, False

    def drive_duty(self, duty: int) -> None:
        """Put a duty cycle on the motor, open loop."""
        self.mode, self.set_duty, self.reached = _DUTY, duty, False

    def control(self) -> float:
        """Run the controllers for one period.

        Returns:
            The speed that the motor would have at the period's end if nothing held the wheel.
        """
        motor = self.motor
        friction, top_speed = motor.friction, motor.top_speed
        room = FULL_DUTY - friction
        mode = self.mode
        if mode is _DUTY:
            duty = float(self.set_duty)
        else:
            if mode is _SPEED:
                gains, error = self.speed_gains, float(self.set_speed - self.measured)
                forward = 0.0
            else:
                gains, error = self.position_gains, self._follow()
                # the profile's own speed is fed forward: the PID has only its errors to mend
                forward = self.reference_speed
            scale, ki, integral = motor.gain_scale, gains.ki, self.integral
            if ki:
                integral += error
                limit = FULL_DUTY * scale / ki
                if integral > limit:
                    integral = limit
                elif integral < -limit:
                    integral = -limit
                self.integral = integral
            duty = (gains.kp * error + ki * integral + gains.kd * (error - self.last_error)) / scale
            self.last_error = error
            duty = FULL_DUTY if duty > FULL_DUTY else -FULL_DUTY if duty < -FULL_DUTY else duty
            if forward != 0.0:
                duty += (friction if forward > 0.0 else -friction) + forward * room / top_speed
                duty = FULL_DUTY if duty > FULL_DUTY else -FULL_DUTY if duty < -FULL_DUTY else duty
        # drive beyond standing friction, and the speed that the motor would come to with it
        if duty > friction:
            free = (duty - friction) * top_speed / room
        elif duty < -friction:
            free = (duty + friction) * top_speed / room
        else:
            free = 0.0
        speed = self.speed + (free - self.speed) * self.response
        # a motor without drive comes to rest instead of creeping for ever
        return 0.0 if free == 0.0 and -_CREEP < speed < _CREEP else speed

    def roll(self, way: float, speed: float) -> None:
        """Take in what the wheel really did in the period: way in counts, speed at its end."""
        travel = self.travel
        self.travel = after = travel + way
        self.speed = speed
        self.measured = floor(after) - floor(travel)
        if self.mode is _POSITION and self.reference_speed == 0.0 and not self.reached:
            self.reached = self.reference == self.target and abs(self.error) <= self.reached_within

    def at_rest(self) -> bool:
        """Tell whether the wheel stands and nothing drives it."""
        if self.speed != 0.0 or self.measured != 0:
            return False
        if self.mode is _POSITION:
            return self.reached and self.error == 0
        return not (self.set_speed if self.mode is _SPEED else self.set_duty)

    def _clear(self) -> None:
        self.integral = self.last_error = 0.0
        self.reference_speed = 0.0

    def _scale(self, gain: int) -> float:
        return self.motor.gain_scale / gain if gain else 0.0

    def _holding_duty(self, speed: float) -> float:
        if speed == 0.0:
            return 0.0
        motor = self.motor
        return copysign(motor.friction, speed) + speed * (FULL_DUTY - motor.friction) / (
            motor.top_speed
        )

    def _follow(self) -> float:
        """Move the profile's reference on by a period; returns how far the wheel lags behind."""
        reference, speed = self.reference, self.reference_speed
        way = self.target - reference
        if way != 0.0 or speed != 0.0:
            profile = self.profile
            top, acceleration = profile.speed, profile.acceleration / 256
            if acceleration == 0.0 or top == 0:
                self.reference_speed = 0.0  # a profile without speed or acceleration goes nowhere
            else:
                left = abs(way)
                wanted = sqrt(2.0 * acceleration * left + acceleration**2 / 4) - acceleration / 2
                if wanted > top:
                    wanted = top
                change = (wanted if way >= 0.0 else -wanted) - speed
                if change > acceleration:
                    change = acceleration
                elif change < -acceleration:
                    change = -acceleration
                speed += change
                fast = abs(speed)
                if fast <= 2 * acceleration and left <= max(fast, 0.5 * acceleration):
                    reference, speed = float(self.target), 0.0
                else:
                    reference += speed
                self.reference, self.reference_speed = reference, speed
        lag = reference - (floor(self.travel) + self.offset)
        if not -_HALF_RANGE < lag < _HALF_RANGE:
            lag -= round(lag / 2**32) * 2**32  # wheel and reference on both sides of a wrap
        return lag


def _wrap(count: int) -> int:
    """Return a count as a signed 32-bit number holds it."""
    return (count + 2**31) % 2**32 - 2**31
