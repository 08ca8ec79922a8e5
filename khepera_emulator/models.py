"""The robots, number by number.

Lengths in metres, angles in radians counter-clockwise from straight ahead, speeds in encoder
counts per 10 ms. A number that no source decides is marked as a choice.
"""

from dataclasses import dataclass
from math import radians
from typing import Final

from khepera_protocol.registry import Registry
from khepera_protocol.serial.units import SPEED_UNIT
from khepera_protocol.text import printable

from khepera_emulator.doors import find_part
from khepera_emulator.errors import EmulatorError


@dataclass(frozen=True, slots=True)
class Motor:
    """A wheel's motor with its gear, seen from the wheel; both robots have the same (choices).

    Attributes:
        top_speed: speed at full duty without load; a little over 1 m/s, the fastest D.
        time_constant: seconds to 63 % of a new speed with constant duty.
        friction: duty (of 255) that standing friction eats up.
        gain_scale: divides the gains of A and F, which are fixed-point numbers of unknown scale;
            chosen so that the power-on gains settle in 30 to 60 ms without a steady error.
    """

    top_speed: float = 130.0
    time_constant: float = 0.050
    friction: float = 2.0
    gain_scale: float = 1900.0


@dataclass(frozen=True, slots=True)
class ProximityCurve:
    """Reading of every sensor against the gap to a white wall, as recorded on real robots.

    Attributes:
        gaps: metres between body and wall, ascending, shape (K,).
        counts: shape (8, K); 1023 or 1020 stands for "saturated here".
        residual: reading without any object, for each of the 8 sensors.
        step: readings are multiples of this.
        noise: standard deviation in counts, fixed part and part of the value.
        full: greatest count of the converter.
    """

    gaps: tuple[float, ...]
    counts: tuple[tuple[int, ...], ...]
    residual: tuple[int, ...]
    step: int
    noise: tuple[float, float]
    full: int = 1023


@dataclass(frozen=True, slots=True)
class Rom:
    """The ROM of a robot, as the first line of its banner has it.

    Attributes:
        name: of the robot; clients look for `KHEPERA` at its beginning.
        date: as printed.
        revision: d.dd.
    """

    name: str
    date: str
    revision: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A robot on two wheels with a ring of eight infrared sensors, of any kind.

    Attributes:
        kind: which kind of robots it is of, a name in `robot.kind.KINDS`.
        radius, height, wheel_radius, wheel_base: metres.
        mass: kilograms.
        top_speed: of a wheel without load, m/s.
        sensor_bearings: where the sensors sit on the body's edge.
        sensor_directions: where they look.
        proximity: their response.
        dark: reading of ambient light where there is none.
    """

    kind: str
    name: str
    title: str
    radius: float
    height: float
    mass: float
    wheel_radius: float
    wheel_base: float
    top_speed: float
    sensor_bearings: tuple[float, ...]
    sensor_directions: tuple[float, ...]
    proximity: ProximityCurve
    dark: int

    @property
    def full_scale(self) -> int:
        """Greatest sensor reading."""
        return self.proximity.full // self.proximity.step * self.proximity.step


@dataclass(frozen=True, slots=True, kw_only=True)
class KheperaModel(Model):
    """A Khepera: its line, versions and controllers.

    Attributes:
        bauds: rates of its line.
        versions: of BIOS and protocol, as B reads them.
        has_flash: whether user programs can be burnt into a flash memory.
        speed_gains, position_gains, profile: of the wheels' controllers after power-on.
    """

    kind: str = "khepera"
    top_speed: float = Motor().top_speed * SPEED_UNIT
    bauds: tuple[int, ...]
    versions: tuple[str, str]
    rom: Rom
    motor: Motor
    has_flash: bool = False
    speed_gains: tuple[int, int, int] = (3800, 800, 100)
    position_gains: tuple[int, int, int] = (3000, 20, 4000)
    profile: tuple[int, int] = (20, 64)


def _degrees(*angles: float) -> tuple[float, ...]:
    return tuple(radians(angle) for angle in angles)


def _columns(*rows: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    return tuple(zip(*rows, strict=True))


# Recorded on a first Khepera: 180 headings x 20 gaps before a white wall (S. Nolfi's evorobot
# samples), median within 6 degrees of each sensor's lobe centre.
_KHEPERA_PROXIMITY = ProximityCurve(
    gaps=tuple(mm / 1000 for mm in range(15, 45, 2)),
    counts=_columns(
        (1023, 1023, 1023, 1023, 1023, 1023, 1023, 1023),
        (1023, 1023, 1023, 786, 1023, 1023, 1023, 1023),
        (1023, 1011, 835, 522, 1023, 1023, 854, 1023),
        (837, 776, 635, 377, 941, 1023, 641, 1023),
        (592, 617, 464, 279, 738, 980, 445, 931),
        (358, 413, 326, 112, 539, 749, 334, 761),
        (244, 290, 165, 16, 297, 518, 158, 481),
        (174, 197, 143, 6, 244, 483, 121, 495),
        (141, 150, 48, 0, 181, 363, 47, 356),
        (33, 87, 7, 0, 101, 257, 25, 265),
        (0, 0, 4, 0, 7, 226, 0, 200),
        (0, 0, 0, 0, 0, 115, 0, 110),
        (0, 0, 0, 0, 0, 107, 0, 94),
        (0, 0, 0, 0, 0, 31, 0, 57),
        (0, 0, 0, 0, 0, 7, 0, 11),
    ),
    residual=(0,) * 8,
    step=1,
    noise=(12.0, 0.02),
)

# Recorded on one Khepera II over five days (R. McGregor's and N. Hadjipavlou's course data,
# mean): every reading a multiple of 4, none above 1020. Gap beyond the table: the residual.
_KHEPERA2_PROXIMITY = ProximityCurve(
    gaps=tuple(mm / 1000 for mm in (10, 20, 30, 40, 50, 60, 70, 80, 90, 100)),
    counts=_columns(
        (773, 1020, 998, 1020, 1020, 880, 994, 1014),
        (191, 278, 245, 311, 258, 275, 286, 363),
        (102, 143, 134, 181, 122, 152, 170, 239),
        (71, 95, 92, 132, 84, 118, 128, 194),
        (65, 77, 80, 116, 68, 90, 114, 176),
        (49, 66, 70, 102, 58, 86, 102, 163),
        (46, 62, 66, 96, 54, 86, 98, 163),
        (46, 56, 65, 91, 52, 75, 92, 156),
        (43, 54, 58, 90, 49, 74, 91, 154),
        (35, 44, 51, 61, 33, 63, 84, 141),
    ),
    residual=(35, 44, 51, 61, 33, 63, 84, 141),
    step=4,
    noise=(12.0, 0.02),
)

# of a real robot (K-Team's FAQ); the wording on a Khepera II is unknown and taken to be the same
_ROM = Rom("KHEPERA", "October 22, 1998", "5.01")

KHEPERA: Final = KheperaModel(
    name="khepera",
    title="Khepera (1995), ROM 5.01",
    radius=0.0275,
    height=0.030,
    mass=0.070,
    wheel_radius=0.00764,  # 600 counts a turn at 0.08 mm each
    wheel_base=0.053,
    bauds=(9600, 19200, 38400),
    versions=("5.01", "5.00"),
    rom=_ROM,
    # where the sensors sit (KiKS) and where they were measured to look (centres of Nolfi's lobes)
    sensor_bearings=_degrees(68, 43, 13, -13, -43, -68, -158, 158),
    sensor_directions=_degrees(70, 42, 8, -16, -45, -76, -170, 166),
    proximity=_KHEPERA_PROXIMITY,
    dark=490,
    motor=Motor(),
)

KHEPERA2: Final = KheperaModel(
    name="khepera2",
    title="Khepera II (2001)",
    radius=0.035,
    height=0.030,
    mass=0.080,
    wheel_radius=0.00764,
    wheel_base=0.053,
    bauds=(9600, 19200, 38400, 57600, 115200),
    versions=("5.02", "5.01"),
    rom=_ROM,
    # positions of the Webots model; directions: its axes, the side ones as the lobes above
    sensor_bearings=_degrees(61, 44, 14, -14, -44, -61, -166, 166),
    sensor_directions=_degrees(70, 42, 8, -8, -42, -70, 180, 180),
    proximity=_KHEPERA2_PROXIMITY,
    dark=488,
    motor=Motor(),
    has_flash=True,
)

MODELS: Final = Registry(
    "robot model",
    "khepera_macor.models",
    {
        KHEPERA.name: "khepera_emulator.models:KHEPERA",
        KHEPERA2.name: "khepera_emulator.models:KHEPERA2",
        "epuck": "khepera_emulator.robot.epuck.models:EPUCK",
        "epuck2": "khepera_emulator.robot.epuck.models:EPUCK2",
    },
)


def find_model(name: str) -> Model:
    """Return the model of a name.

    Raises:
        EmulatorError: there is none.
    """
    model = find_part(MODELS, name)
    if not isinstance(model, Model):
        raise EmulatorError(f"'{printable(name, 200)}' is not a robot model, a value of Model")
    return model
