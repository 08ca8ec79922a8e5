"""Lines of text that an e-puck's firmware says: help, version, battery, remote control.

The words of the help are our own; on the robot they say the same.
"""

from khepera_protocol.epuck.generations import Generation
from khepera_protocol.epuck.letters import LETTERS
from khepera_protocol.epuck.units import battery_share

_WIDTH = 18
_NO_WINDOW = 4
"""Numbers of J without the place of a window."""


def line(*words: object) -> bytes:
    """Return a reply: words with commas between them."""
    return ",".join(map(str, words)).encode("ascii") + b"\r\n"


def help_lines(generation: Generation, *, first_revision: bool) -> bytes:
    """Return what H says: a bare line feed, then a line for each letter."""
    lines = [b"\n"]
    for row in LETTERS.values():
        hidden = row.letter in "XZ" or (first_revision and row.letter == "g")
        if row.letter in generation.letters and not hidden:
            asked = row.request if generation.window else row.request[:_NO_WINDOW]
            name = f'"{",".join([row.letter, *"#" * len(asked)])}"'
            lines.append(f"{name:{_WIDTH}}{row.title}\r\n".encode("ascii"))
    return b"".join(lines)


def version_lines(generation: Generation, hardware: int) -> bytes:
    """Return what V says."""
    return b"".join(line(text.format(hardware)) for text in generation.version)


def battery_line(raw: int, empty: int, full: int, *, generation: Generation) -> bytes:
    """Return what b says where the voltage is measured."""
    if generation.bits > 16:
        share = battery_share(raw)
    else:
        share = min(max((raw - empty) * 100 // (full - empty), 0), 100)
    return line(f"b,{raw} ({share}%)")


def remote_line(remote: tuple[int, int, int]) -> bytes:
    """Return what G says."""
    check, address, data = remote
    return line(f"g IR check : 0x{check:x}, address : 0x{address:x}, data : 0x{data:x}")
