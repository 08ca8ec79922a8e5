"""The tools of the ROM: lower-case words that answer in lines of text.

The lines of `memory` and `process` are a real robot's (kMatlab's session, ROM 5.01), the loader's
are those that clients wait for (micropsi, NRS). The rest is unknown: plain words stand in.
"""

import re
from dataclasses import dataclass
from typing import Final

from khepera_protocol.serial.commands import FLASH_TOOLS, TOOLS
from khepera_protocol.serial.turrets import TurretKind

LOADER_TITLE: Final = "S format Motorola loader mode"
LOADER_DONE: Final = "S: download terminated"
LOADER_ERROR: Final = "S: error in record"

_MEMORY: Final = (
    "First free ROM address:   16'00012490, used 57%",
    "First free RAM 1 address: 16'001243F4, used 13%",
    "First free RAM 2 address: 16'001A0000, used 0%",
)
_PROCESSES: Final = (
    "Process N. 00000000  IDLE process for the micro-kernell, EF-98: Rev. 1.00",
    "Process N. 00000001  Start-up process of the Khepera, EF-98:    Rev. 5.00",
)
_LOADERS: Final = ("sfill", "run sloader")

_RECORD: Final = re.compile(rb"S[0-9]((?:[0-9A-F]{2})+) *")
_LAST_RECORDS: Final = b"789"


@dataclass(frozen=True, slots=True)
class About:
    """Facts that tools tell of a robot.

    Attributes:
        bios, protocol: versions.
        bauds: rates of its line.
        has_flash: whether there is a flash memory.
        turrets: kinds of what is mounted.
    """

    bios: str
    protocol: str
    bauds: tuple[int, ...]
    has_flash: bool
    turrets: tuple[TurretKind, ...]


def tool_lines(word: str, arguments: tuple[str, ...], about: About) -> list[str] | None:
    """Return what a tool answers; None for a word or an argument that the robot does not know.

    `restart` is no tool of this kind, and the loader has a life of its own (`begins_loader`).
    """
    if word in FLASH_TOOLS and not about.has_flash:
        return None
    match word:
        case "flash":
            return _flash(arguments)
        case "run":
            return _run(arguments, about)
        case "serial":
            return _serial(arguments, about)
        case _:
            return _plain(word, about)


def begins_loader(word: str, arguments: tuple[str, ...]) -> bool:
    """Tell whether a tool that has answered goes on to take S-records."""
    return " ".join((word, *arguments)) in _LOADERS


def set_rate(word: str, arguments: tuple[str, ...]) -> int | None:
    """Return the rate that a tool that has answered sets, in bits a second."""
    return int(arguments[0]) if word == "serial" and arguments else None


def load_record(line: bytes) -> str | None:
    """Take in one line in loader mode.

    Returns:
        What the loader says: nothing while all is well, `LOADER_DONE` after the last record;
        None for a line that is no S-record.
    """
    match = _RECORD.fullmatch(line)
    if match is None:
        return None
    count, *data, checksum = bytes.fromhex(match[1].decode()).ljust(2, b"\0")
    if count != len(data) + 1 or (count + sum(data) + checksum) % 256 != 255:
        return LOADER_ERROR
    return LOADER_DONE if line[1] in _LAST_RECORDS else ""


def _plain(word: str, about: About) -> list[str] | None:
    versions = [f"BIOS Rev. {about.bios}", f"Serial communication protocol Rev. {about.protocol}"]
    match word:
        case "help":
            known = [name for name in TOOLS if about.has_flash or name not in FLASH_TOOLS]
            return [f"{name}: {TOOLS[name]}" for name in known]
        case "k-team":
            return ["K-Team S.A., Switzerland", "ROM: Edoardo Franzi"]
        case "list":
            return [*versions, *(f"{name}: {title}" for name, title in _modules(about).items())]
        case "memory":
            return list(_MEMORY)
        case "net":
            return _net(about)
        case "process":
            return list(_PROCESSES)
        case "sfill":
            return [LOADER_TITLE]
        case "var":
            return ["No user variables"]
        case "ver":
            return versions
        case _:
            return None


def _modules(about: About) -> dict[str, str]:
    modules = {"sloader": LOADER_TITLE}
    if about.has_flash:
        modules["user-flash"] = "program in the flash memory"
    return modules


def _net(about: About) -> list[str]:
    if not about.turrets:
        return ["No turret on the extension bus"]
    return [
        kind.title if kind.number is None else f"Turret N. {kind.number:08d}  {kind.title}"
        for kind in about.turrets
    ]


def _run(arguments: tuple[str, ...], about: About) -> list[str] | None:
    if len(arguments) != 1 or arguments[0] not in _modules(about):
        return None
    return [LOADER_TITLE if arguments[0] == "sloader" else "No program in the flash memory"]


def _flash(arguments: tuple[str, ...]) -> list[str] | None:
    texts = {("E",): "Flash memory erased", ("W",): "Flash memory written"}
    return [texts[arguments]] if arguments in texts else None


def _serial(arguments: tuple[str, ...], about: About) -> list[str] | None:
    if arguments and arguments not in {(str(rate),) for rate in about.bauds}:
        return None
    rates = arguments or tuple(map(str, about.bauds))
    return [f"Serial line: {', '.join(rates)} baud, 8 data bits, no parity, 2 stop bits"]
