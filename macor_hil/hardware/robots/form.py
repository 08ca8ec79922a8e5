"""A kind of robots from outside: what is drawn of it, and how what passes on its line is read.

Watchers know of a robot what is here, and no more: a third kind is another `Form` and a line in
`forms`. Infrared readings, their order and their scale are the driver's (`robot`); lengths are
metres.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from khepera_protocol.serial.units import PULSE
from khepera_protocol.zenoh.payloads import WireEntry

REQUEST: Final = "request"
REPLY: Final = "reply"


class Reading(NamedTuple):
    """Facts of a robot that a request or its reply tells; None: nothing.

    Attributes:
        proximity: eight infrared readings, in the order and the scale of the driver.
        ambient: readings of ambient light, as they were told.
        counters: of both wheels, as they were told, without the wraps of short numbers.
        recounted: whether counters are set, or begin anew with the robot.
        speed: of both wheels, as they were told.
        wanted: speeds that a request sets.
        lamps: names of lamps, and whether they shine now.
        battery: volts.
    """

    proximity: tuple[int, ...] | None = None
    ambient: tuple[int, ...] | None = None
    counters: tuple[int, ...] | None = None
    recounted: bool = False
    speed: tuple[int, ...] | None = None
    wanted: tuple[int, ...] | None = None
    lamps: tuple[tuple[str, bool], ...] = ()
    battery: float | None = None


SATURATED: Final = 1000
"""Reading before a white wall 15 mm away, in the driver's scale."""

NOTHING: Final = Reading()


class Passed(NamedTuple):
    """Something whole that has passed on a line, never a half of it.

    Attributes:
        what: REQUEST, REPLY, or the kind of another event, such as fault.
        text: it, fit for a terminal: text without its end, and bytes as hexadecimal numbers.
        time: seconds on the robot's clock.
        asks: whether a request asks for something.
        drives: whether a request turns the wheels.
        answers: the text of the request that a reply answers; empty: nobody knows.
        more: whether a reply goes on one that was told before.
        reading: what it tells of the robot.
    """

    what: str
    text: str
    time: float
    asks: bool = False
    drives: bool = False
    answers: str = ""
    more: bool = False
    reading: Reading = NOTHING


class Listener(Protocol):
    """Puts the pieces together that a line's watchers are told, and reads them."""

    def take(self, entry: WireEntry) -> Iterator[Passed]:
        """Yield what has come to its end by an entry."""

    def lose(self) -> None:
        """Forget halves and open requests: what would have made them whole did not come."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """A kind of robots.

    Attributes:
        title: its name.
        radius, height: of the body, where nobody tells another radius.
        sensors: names of the eight infrared sensors.
        bearings: where they sit and look, degrees from straight ahead, left positive.
        sensor_height: above the floor.
        response: readings before a white wall, ascending, and the gaps that give them.
        saturated: reading on the line that is the driver's 1000.
        field_of_view: radians that a sensor sees at half of its reading.
        pulse: way of a wheel for one count, as it is told on the line.
        base: distance between the wheels.
        chemistry: of the battery: NICD or LIPO.
        cells: of the battery.
        listener: makes what reads a line in one of its ways of speaking.
    """

    title: str
    radius: float
    height: float
    sensors: tuple[str, ...]
    bearings: tuple[float, ...]
    sensor_height: float
    response: tuple[tuple[int, float], ...]
    saturated: int = SATURATED
    field_of_view: float
    pulse: float
    base: float
    chemistry: str
    cells: int
    listener: Callable[[str], Any]

    @property
    def nearest(self) -> float:
        """Gap to a white wall at which the sensors are saturated."""
        return self.response[-1][1]

    @property
    def farthest(self) -> float:
        """Gap from which on nothing is seen."""
        return self.response[0][1]

    def in_the_drivers_counts(self, told: Reading) -> Reading:
        """Return what a line tells, its counters as the driver counts: 0.08 mm each."""
        if told.counters is None:
            return told
        counters = tuple(round(count * self.pulse / PULSE) for count in told.counters)
        return told._replace(counters=counters)

    def on_the_line(self, reading: int) -> int:
        """Return the least reading on the line that comes to one in the driver's scale."""
        return -(-reading * self.saturated // SATURATED)

    def distance(self, reading: int) -> float | None:
        """Return the gap to a white wall that gives a reading; None: nothing is seen.

        A reading depends on colour, angle and sensor, too: a robot that plans by it wants a
        measurement of its own.
        """
        readings, gaps = zip(*self.response, strict=True)
        return None if reading < readings[0] else float(np.interp(reading, readings, gaps))
