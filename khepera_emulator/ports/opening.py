"""Which port a robot gets: one of the kinds there are, a pseudo-terminal if none is named."""

from collections.abc import Callable

from khepera_emulator.errors import EmulatorError
from khepera_emulator.ports.port import Port
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.ports.rfc2217 import Rfc2217Port
from khepera_emulator.ports.tcp import TcpPort, shifted


def open_port(
    *,
    tcp: str | None = None,
    rfc2217: str | None = None,
    expose: bool = False,
    place: int = 0,
    moved: Callable[[str], None] = lambda _: None,
) -> Port:
    """Open the port that is asked for.

    Args:
        tcp: HOST:PORT of a bare TCP port.
        rfc2217: HOST:PORT of a telnet port after RFC 2217.
        expose: allow addresses that other machines can reach.
        place: of the robot among those that share a world, from 0; each has a TCP port of its
            own, one after the other.
        moved: told the new path when a pseudo-terminal has to be given up for another one.

    Raises:
        EmulatorError: both are given, or the system refuses.
    """
    if tcp is not None and rfc2217 is not None:
        raise EmulatorError("--tcp and --rfc2217: a robot has one line; give one of them")
    if tcp is not None:
        return TcpPort(shifted(tcp, place), expose=expose)
    if rfc2217 is not None:
        return Rfc2217Port(shifted(rfc2217, place), expose=expose)
    return PtyPort(moved)
