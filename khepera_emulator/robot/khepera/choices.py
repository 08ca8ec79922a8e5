"""Choices where no source decides what a Khepera does, those that can be switched.

The defaults follow the best source there is; `docs/khepera-choices.md` lists all choices, these
and the fixed ones, with the reasons. A switch is set as `--firmware NAME` or
`--firmware NAME=VALUE`, and in a `khepera://` URL as `firmware=NAME` or `firmware=NAME=VALUE`.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from khepera_emulator.robot.switches import Form, parse_switches, switch_names

_COUNT: Final = re.compile(r"[0-9]{1,2}", re.ASCII), "give 0 to 99"
_VERSION: Final = re.compile(r"[0-9]\.[0-9]{2}", re.ASCII), "a version looks like 5.01"
_TEXT: Final = re.compile(r"[ -~]{1,60}"), "give 1 to 60 printable characters"

_FORMS: Final[dict[str, Form]] = {
    "reached_within": _COUNT,
    "bios": _VERSION,
    "protocol": _VERSION,
    "rom_revision": _VERSION,
    "rom_name": _TEXT,
    "rom_date": _TEXT,
}


@dataclass(frozen=True, slots=True)
class Choices:
    """Behaviour of one robot's firmware where sources differ or are silent.

    Texts that are empty stand for the model's own.

    Attributes:
        error_prefix: answer `z,Command not found` as later K-Team robots do, not the bare words.
        error_dot: end `z,Protocol error.` with a dot, as uKOS does.
        reject_beyond: refuse every number out of range instead of clamping some.
        count_arguments: refuse arguments to commands that have none (`N,1`).
        speed_mode_once_reached: K reports M=1 at the end of a move, as in kMatlab's session.
        reached_at_rest: K reports T=1 in speed mode while the set speed is 0.
        pixels_from_zero: the linear vision turret numbers its pixels from 0, not from 1.
        reached_within: counts off the target at which a finished move counts as reached.
        counters_carry_target: G during a move shifts its target along, so that the wheel stops
            where it would have stopped.
        bios, protocol: versions that B reads, as d.dd.
        rom_name, rom_date, rom_revision: the parts of the banner's first line that vary.
    """

    error_prefix: bool = False
    error_dot: bool = False
    reject_beyond: bool = False
    count_arguments: bool = False
    speed_mode_once_reached: bool = False
    reached_at_rest: bool = False
    pixels_from_zero: bool = False
    reached_within: int = 1
    counters_carry_target: bool = False
    bios: str = ""
    protocol: str = ""
    rom_name: str = ""
    rom_date: str = ""
    rom_revision: str = ""


def option_names() -> list[str]:
    """List the names of the switches, as users write them."""
    return switch_names(Choices())


def parse_choices(items: Iterable[str]) -> Choices:
    """Read switches such as `reject-beyond` or `rom-revision=4.10`; later ones win.

    Raises:
        EmulatorError: an unknown name, or a value that it does not take.
    """
    return parse_switches(Choices(), items, _FORMS)
