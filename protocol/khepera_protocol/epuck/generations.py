"""The firmwares: what each of them does in its own way, as data."""

from dataclasses import dataclass
from typing import Final

from khepera_protocol.epuck.codes import BTCOM_CODES, EPUCK2_CODES, EPUCK_CODES, Codes
from khepera_protocol.epuck.letters import LETTERS


@dataclass(frozen=True, slots=True)
class Generation:
    """A firmware.

    Attributes:
        name: as users write it.
        title: its robot and maker.
        version: lines of V; `{}` stands for the number of the hardware.
        letters: requests in text that it answers.
        silent: letters that it takes without a word.
        small: small letters that mean something else than the capital.
        codes: its binary commands.
        speed_limit: greatest speed, in steps a second.
        bits: of its int.
        unsigned_bytes: whether its compiler's `char` has no sign, so that a negative speed that
            comes in a binary row is read back as 65536 more.
        ground: values of M in text.
        resets: whether R starts the robot again.
        most_picture: greatest size of a picture in bytes, beyond which J takes its default.
        window: whether J takes the place of the picture's upper left corner.
        longest: bytes of a request that it has room for.
        calibration: seconds that K takes (a choice, but for the e-puck2).
        calibrates: whether it does what K does when it is switched on.
    """

    name: str
    title: str
    version: tuple[str, ...]
    letters: frozenset[str]
    silent: frozenset[str]
    small: str
    codes: Codes
    speed_limit: int
    bits: int
    unsigned_bytes: bool
    ground: int
    resets: bool
    most_picture: int
    window: bool
    longest: int
    calibration: float
    calibrates: bool = False


_ALL = frozenset(LETTERS)

GCTRONIC: Final = Generation(
    name="gctronic",
    title="e-puck, GCtronic's firmware 1.2.2",
    version=("v,Version 1.2.2 August 2008 GCtronic", "HW version: {:X}"),
    letters=_ALL - {"X"},
    silent=frozenset(),
    small="bg",
    codes=EPUCK_CODES,
    speed_limit=1000,
    bits=16,
    unsigned_bytes=False,
    ground=5,
    resets=True,
    most_picture=48 * 36 * 2,
    window=True,
    longest=48 * 36 * 2 - 1,
    calibration=1.0,
)

BTCOM: Final = Generation(
    name="btcom",
    title="e-puck, BTcom 2.0.0",
    version=("v,Version 2.0.0 January 2008",),
    letters=_ALL - {"b", "g", "Y", "Z"},
    silent=frozenset("W"),  # of a turret that it was not built for
    small="",
    codes=BTCOM_CODES,
    speed_limit=1000,
    bits=16,
    unsigned_bytes=False,
    ground=3,
    resets=True,
    most_picture=39 * 52 * 2 + 80,  # a choice: the robot would write beyond its memory
    window=False,
    longest=39 * 52 * 2 + 3 + 80 - 1,
    calibration=0.5,
    calibrates=True,
)

GCTRONIC2: Final = Generation(
    name="gctronic2",
    title="e-puck2, GCtronic's firmware 2.0",
    version=("v,Version 2.0 January 2018 GCtronic", "HW version: {:X}"),
    letters=_ALL - {"X"},
    silent=frozenset("R"),
    small="bg",
    codes=EPUCK2_CODES,
    speed_limit=1100,
    bits=32,
    unsigned_bytes=True,
    ground=5,
    resets=False,
    most_picture=52 * 39 * 2 + 3 + 80 - 3,
    window=True,
    longest=52 * 39 * 2 + 3 + 80 - 1,
    calibration=1.5,
)

GENERATIONS: Final = (GCTRONIC, BTCOM, GCTRONIC2)
