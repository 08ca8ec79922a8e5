"""Ports by name, and opening one: a pseudo-terminal if none is named."""

from collections.abc import Callable
from typing import Final

from khepera_protocol.registry import Registry
from khepera_protocol.text import printable

from khepera_emulator.doors import find_part
from khepera_emulator.errors import EmulatorError
from khepera_emulator.ports.port import Port, PortRequest

TERMINAL: Final = "terminal"

PORTS: Final = Registry(
    "kind of port",
    "khepera_macor.ports",
    {
        TERMINAL: "khepera_emulator.ports.pty:PtyPort",
        "tcp": "khepera_emulator.ports.tcp:TcpPort",
        "rfc2217": "khepera_emulator.ports.rfc2217:Rfc2217Port",
    },
)


def open_port(
    *,
    port: str | None = None,
    tcp: str | None = None,
    rfc2217: str | None = None,
    expose: bool = False,
    place: int = 0,
    moved: Callable[[str], None] = lambda _: None,
) -> Port:
    """Open the port that is asked for.

    Args:
        port: KIND or KIND=ADDRESS.
        tcp: HOST:PORT of a bare TCP port.
        rfc2217: HOST:PORT of a telnet port after RFC 2217.
        expose: allow addresses that other machines can reach.
        place: of the robot among those that share a world, from 0; each has a TCP port of its
            own, one after the other.
        moved: told the new path when a pseudo-terminal has to be given up for another one.

    Raises:
        EmulatorError: several are given, there is no such kind, or the system refuses.
    """
    shorthands = {"tcp": tcp, "rfc2217": rfc2217}
    asked = [f"{kind}={address}" for kind, address in shorthands.items() if address is not None]
    asked += [port] if port is not None else []
    if len(asked) > 1:
        raise EmulatorError("--port, --tcp and --rfc2217: a robot has one line; give one of them")
    name, _, address = (asked or [TERMINAL])[0].partition("=")
    kind = find_part(PORTS, name)
    if not hasattr(kind, "opened"):
        raise EmulatorError(f"'{printable(name, 200)}' is not a port: it has no method `opened`")
    opened: Port = kind.opened(PortRequest(address, place, expose, moved))
    return opened
