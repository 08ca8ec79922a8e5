"""Client of an e-puck on any pySerial port, driven as a Khepera is.

A look is one row: the speeds that the wheels shall have, the speeds that the robot was told (which
says that they have arrived), infrared sensors and step counters. Whoever looks steers: between two
looks the wheels turn on as they were told.
"""

from collections.abc import Callable
from typing import Any, Final

from khepera_protocol.epuck.codes import byte_of, pack, row, unpack
from khepera_protocol.epuck.generations import GCTRONIC2, GENERATIONS, Generation
from khepera_protocol.epuck.letters import wrapped
from khepera_protocol.epuck.units import STEP
from khepera_protocol.serial.units import ACCELERATION_UNIT, PULSE, SPEED_UNIT

from macor_hil.errors import GarbageError
from macor_hil.hardware.robots.client import LineClient, looks_reset
from macor_hil.hardware.robots.epuck.line import EpuckLine
from macor_hil.hardware.robots.epuck.readings import proximity_of, volts_of
from macor_hil.hardware.robots.epuck.servo import Servo
from macor_hil.hardware.robots.robot import RobotKind, WheelStatus

_COUNTS: Final = STEP / PULSE
"""Counts of the driver for a step."""

_TOP: Final = 1000
"""Steps a second that every e-puck makes."""

_MOST: Final = 1100
"""Steps a second that the fastest of them makes."""

_STOP: Final = row(("D", pack((0, 0))))
_STOP_AND_READ: Final = row(("D", pack((0, 0))), "E")

_SPEEDS, _PROXIMITY, _STEPS = slice(0, 4), slice(4, 20), slice(20, 24)
_SIZE: Final = 24

_NEAR_ZERO: Final = 25
"""Steps: a reset wheel has not got farther."""

_Pair = tuple[int, int]


class Epuck(LineClient[EpuckLine]):
    """An e-puck on an open serial port; use as a context, so that every way out stops it.

    Args:
        port: an open pySerial port.
        reopen: opens that port again after it has failed; None: it cannot be.

    Attributes:
        clock: seconds on the clock that the port lives by.
        meter: counts requests and times their round trips on that clock.
    """

    kind = RobotKind.EPUCK
    top_speed = int(_TOP * STEP / SPEED_UNIT)
    _counted: float

    def __init__(self, port: Any, reopen: Callable[[], Any] | None = None) -> None:
        super().__init__(port, reopen, EpuckLine, _stand)
        self._steps = [0, 0]
        self._raw: _Pair = (0, 0)
        self._wanted: _Pair = (0, 0)
        self._told: _Pair = (0, 0)
        self._wheels = Servo(), Servo()
        self._steering = False
        self._looked = 0.0
        self._firmware: Generation | None = None

    def connect(self) -> tuple[str, ...]:
        """Clear the line, ask for the version, and see where the counters are.

        Raises:
            RobotError: nothing on the port answers like an e-puck.
        """
        self._line.clear()
        line = self._line.say("V")
        if not line.startswith(b"v,"):
            raise GarbageError(f"sent b'V\\r' and got {line!r}: is this an e-puck?", b"V\r", line)
        self._line.clear()  # of the second line, which some firmwares say
        self._line.reset_seen = False
        said = line.decode("ascii", "replace")
        self._firmware = next((each for each in GENERATIONS if each.version[0] == said), None)
        self._begin()
        return (line[2:].decode("ascii", "replace"),)

    def halt(self) -> None:
        """Stop the robot, whatever an interrupted exchange has left on the line.

        Raises:
            RobotError: no stop was confirmed.
        """
        self._rest()
        super().halt()

    def set_speed(self, left: int, right: int) -> None:
        """Hold wheel speeds, counts / 10 ms."""
        self._steering = False
        self._wanted = _steps_a_second(left), _steps_a_second(right)
        self._look()

    def stop(self) -> None:
        """Stand still."""
        self.set_speed(0, 0)

    def go_to(self, left: int, right: int) -> None:
        """Drive both wheels to counter values; whoever looks steers."""
        for wheel, target in zip(self._wheels, (left, right), strict=True):
            wheel.target = target / _COUNTS
        self._steering = True
        self._look()

    def set_profile(self, left: tuple[int, int], right: tuple[int, int]) -> None:
        """Top speed and acceleration of each wheel on its way to a target; protocol units."""
        for wheel, (speed, acceleration) in zip(self._wheels, (left, right), strict=True):
            wheel.top = min(speed * SPEED_UNIT / STEP, float(_TOP))
            wheel.acceleration = max(acceleration, 1) * ACCELERATION_UNIT / STEP

    def set_counters(self, left: int, right: int) -> None:
        """Let the counters of a robot that stands read so much; those of the robot stay."""
        self._look()
        self._steps = [round(left / _COUNTS), round(right / _COUNTS)]

    def counters(self) -> _Pair:
        """Return the counters, left and right."""
        self._look()
        return self._counts()

    def status(self) -> tuple[WheelStatus, WheelStatus]:
        """State of the motion, left and right."""
        self._look()
        left, right = (
            WheelStatus(
                reached=self._steering and wheel.reached(steps),
                speed_mode=not self._steering,
                error=round(wheel.left_over(steps) * _COUNTS) if self._steering else 0,
            )
            for wheel, steps in zip(self._wheels, self._steps, strict=True)
        )
        return left, right

    def proximity(self) -> tuple[int, ...]:
        """Return the eight infrared sensors in the driver's scale and order."""
        return proximity_of(unpack(self._look()[_PROXIMITY]))

    def battery(self) -> float | None:
        """Return the battery's voltage; None where the firmware tells none."""
        firmware = self._firmware
        if firmware is None or byte_of("b") not in firmware.codes:
            return None
        answer = self._repeated(lambda: self._metered(lambda: self._line.ask(row("b"), 2)), _STOP)
        return volts_of(*unpack(answer), second=firmware is GCTRONIC2)

    def _look(self) -> bytes:
        """Tell the wheels their speeds and see how it goes; steers them on."""
        answer = self._exchange()
        if self._steering:
            now = self.clock()
            elapsed, self._looked = now - self._looked, now
            left, right = (
                round(wheel.steer(steps, elapsed))
                for wheel, steps in zip(self._wheels, self._steps, strict=True)
            )
            self._wanted = left, right
            if self._wanted != self._told and not (left and right):
                answer = self._exchange()  # one of them is there: not at the next look, but now
        return answer

    def _exchange(self) -> bytes:
        """Send the speeds that are wanted, and take the answer in; what is lost is sent again."""
        # nobody looks while it is asked again
        answer = self._repeated(lambda: self._metered(self._ask), _STOP)
        self._told = self._wanted
        self._count(unpack(answer[_STEPS], signed=True))
        return answer

    def _ask(self) -> bytes:
        answer = self._line.ask(row(("D", pack(self._wanted)), "E", "N", "Q"), _SIZE)
        if unpack(answer[_SPEEDS], signed=True) != self._wanted:
            raise GarbageError(
                f"told {self._wanted} and read back {answer[_SPEEDS]!r}", b"", answer
            )
        self._check(unpack(answer[_STEPS], signed=True))
        return answer

    def _check(self, raw: tuple[int, ...]) -> None:
        """See that no wheel has gone farther than it can: nothing on the line protects a number.

        A robot that stands has been put somewhere else and switched on: it counts on from there.
        """
        now: float = self.clock()
        most = _MOST * (now - self._counted) + _NEAR_ZERO
        if any(abs(wrapped(new - old, 16)) > most for new, old in zip(raw, self._raw, strict=True)):
            if self._steering or self._wanted != (0, 0) or self._told != (0, 0):
                raise GarbageError(f"counters went from {self._raw} to {raw} in so short a time")
            left, right = raw
            self._raw = left, right
        self._counted = now

    def _count(self, raw: tuple[int, ...]) -> None:
        """Count on; the robot's own counters have 16 bits and wrap."""
        left, right = raw
        self._steps[0] += wrapped(left - self._raw[0], 16)
        self._steps[1] += wrapped(right - self._raw[1], 16)
        self._raw = left, right

    def _counts(self) -> _Pair:
        left, right = self._steps
        return round(left * _COUNTS), round(right * _COUNTS)

    def _begin(self) -> None:
        """Take the robot's counters for where they are."""
        self._rest()
        self._raw = self._counters_of_the_robot()
        self._counted = self.clock()

    def _rest(self) -> None:
        self._steering = False
        self._wanted = 0, 0
        for wheel in self._wheels:
            wheel.speed = 0.0

    def _counters_of_the_robot(self) -> _Pair:
        left, right = unpack(self._line.ask(row("Q"), 4), signed=True)
        return left, right

    def _resume(self) -> bool:
        now = self._counters_of_the_robot()
        reset = self._line.reset_seen or looks_reset(now, self._raw, _NEAR_ZERO)
        self._counted = self.clock()
        if reset:
            self._raw = now
        else:
            self._count(now)
        return reset


def _steps_a_second(speed: int) -> int:
    steps = round(speed * SPEED_UNIT / STEP)
    return max(-_TOP, min(_TOP, steps))


def _stand(line: EpuckLine) -> None:
    line.clear(_STOP_AND_READ)
    if line.ask(_STOP_AND_READ, 4) != bytes(4):
        raise GarbageError("told to stop, and the robot has other speeds", _STOP_AND_READ)
