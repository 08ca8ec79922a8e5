"""Golden transcripts: conversations with an emulated robot, as text to read and to compare.

# url khepera://corridor?seed=1     the robot; an arena's file is looked for beside the text
> B                                 a request; escapes such as \\x20 stand for bytes
< b,5.01,5.00                       a line of its reply
>> BB 00                            bytes in hexadecimal, which end without a line end
<< 05 00 05 00                      the bytes of the reply, 32 a line, or how many there are
# wait 0.5                          let so many seconds pass
# now 0.500 s                       when it was after a wait, on the robot's clock
# anything else                     a comment
"""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

from in_process import open_robot

from khepera_emulator.ports.protocol_khepera import Serial

FOLDER = Path(__file__).parent / "golden"

_URL = re.compile(r"# url khepera://([^?]+)(\?.*)?")
_WAIT = re.compile(r"# wait ([0-9.]+)")


@dataclass(frozen=True)
class Exchange:
    """A request with the lines of its reply."""

    request: bytes
    reply: list[str]


def bytes_of(text: str) -> bytes:
    """Return the bytes that a request's line stands for."""
    value = ast.literal_eval(f"b'{text}'")
    assert isinstance(value, bytes)
    return value


def exchanges(text: str) -> list[Exchange]:
    """Return the content of a transcript."""
    found: list[Exchange] = []
    for line in text.splitlines():
        if line.startswith(">>"):
            found.append(Exchange(bytes.fromhex(line[2:]), []))
        elif line.startswith(">"):
            found.append(Exchange(bytes_of(line[2:]), []))
        elif line.startswith("< "):
            found[-1].reply.append(line[2:])
        elif line.startswith("<< "):
            found[-1].reply.append(line[3:])
    return found


def url_of(text: str) -> str:
    """The robot of a transcript."""
    match = _URL.match(text)
    assert match, "a transcript begins with its URL"
    arena = FOLDER / match[1]
    return f"khepera://{arena if arena.exists() else match[1]}{match[2] or ''}"


def play(text: str) -> str:
    """The transcript that comes of having the conversation again."""
    lines: list[str] = []
    with open_robot(url_of(text), timeout=60) as port:
        for line in text.splitlines():
            if line.startswith(("< ", "<< ", "# now ")):
                continue
            lines.append(line)
            if line.startswith(">>"):
                lines += _ask_in_bytes(port, bytes.fromhex(line[2:]))
            elif line.startswith(">"):
                lines += [f"< {reply}" for reply in _ask(port, bytes_of(line[2:]))]
            elif match := _WAIT.fullmatch(line):
                port.emulator.advance(port.now + float(match[1]))
                lines.append(f"# now {port.now:.3f} s")
    return "\n".join(lines) + "\n"


def _ask(port: Serial, request: bytes) -> list[str]:
    port.write(request + b"\n")
    port.flush()
    lines: list[str] = []
    while port.emulator.uart.queued():
        line = port.read_until()
        text = line.removesuffix(b"\r\n").decode("ascii")
        lines.append("".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text))
    return lines


def _ask_in_bytes(port: Serial, request: bytes) -> list[str]:
    port.write(request)
    port.flush()
    reply = port.read(port.emulator.uart.queued())
    shown = [f"<< {reply[at : at + 32].hex(' ').upper()}" for at in range(0, len(reply), 32)]
    most = 6
    return shown if len(shown) <= most else [*shown[:most], f"<< {len(reply)} bytes"]
