"""Emulated robots from their options to the end of their daemon, for `khepera-emulator run`."""

import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from khepera_protocol.system.supervisor import Supervisor

from khepera_emulator.app.control import Control
from khepera_emulator.app.daemon import Daemon
from khepera_emulator.app.ending import Ending
from khepera_emulator.app.options import LineOptions, ZenohOptions
from khepera_emulator.app.side_channel import SideChannel
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.clock import Clock
from khepera_emulator.line.fault_text import read_script
from khepera_emulator.line.wire_log import WireLog
from khepera_emulator.ports.link import Link
from khepera_emulator.ports.opening import open_port
from khepera_emulator.ports.paths import check_name, check_output
from khepera_emulator.ports.port import Port
from khepera_emulator.robot.emulator import make_robots
from khepera_emulator.robot.options import AUTO, RobotOptions, UrlOptions


def serve(
    options: RobotOptions,
    line: LineOptions,
    zenoh: ZenohOptions,
    ending: Ending,
    announce: Callable[[str], None],
) -> None:
    """Switch robots on, and serve them until the program is told to end.

    Args:
        options: what the robots are made from.
        line: their lines and their time.
        zenoh: their side channels.
        ending: tells when to end.
        announce: is given a line for each robot, as soon as it can be talked to, and later the
            answers to what is asked over the standard input.

    Raises:
        EmulatorError: an option names nothing that there is, or the system refuses something.
    """
    if line.link and not line.on_terminal:
        raise EmulatorError("--link points to a terminal, and --tcp and --rfc2217 have none")
    count = options.robots
    faults = read_script(line.fault_script) if line.fault_script else []
    robots = [UrlOptions.of(options, number, faults) for number in range(1, count + 1)]
    setups = robots[0].setups()
    names = _numbered(zenoh.robot, count)
    links, files = _links(line.link, count), _recordings(line.record, count)
    ending.hold()  # what is made from here on is put away at the end
    with ExitStack() as stack:
        claims = [stack.enter_context(Link(path)) if path else None for path in links]
        emulators = make_robots(setups)
        stack.callback(emulators[0].close)
        channels = _channels(stack, names, zenoh)
        ports = _ports(stack, line, claims)
        logs = [
            stack.enter_context(WireLog(path, robot.to_url())) if path else None
            for path, robot in zip(files, robots, strict=True)
        ]
        control = Control(emulators, announce) if line.control else None
        supervisor = Supervisor.of(os.environ)
        daemon = Daemon(emulators[0], Clock(line.speed), control, supervisor)
        for served in zip(emulators, ports, channels, logs, strict=True):
            daemon.add(*served, follow_rate=options.baud == AUTO)
        for name, port, claim in zip(names, ports, claims, strict=True):
            if claim:
                claim.point_to(port.url)
            announce(f"{name} on {port.url}" + (f", link {claim.path}" if claim else ""))
        supervisor.ready(f"{count} robots on" if count > 1 else "the robot is on")
        ending.call(daemon.stop)
        daemon.run()


def _channels(
    stack: ExitStack, names: list[str], options: ZenohOptions
) -> list[SideChannel | None]:
    """Open the robots' side channels, all in the session of the first one."""
    channels: list[SideChannel] = []
    for name in names if options.zenoh else ():
        channel = SideChannel(
            name,
            [options.listen],
            options.connect,
            options.camera_rate,
            beside=channels[0] if channels else None,
            config=options.zenoh_config,
        )
        channels.append(stack.enter_context(channel))
    return [*channels] or [None] * len(names)


def _ports(stack: ExitStack, line: LineOptions, claims: list[Link | None]) -> list[Port]:
    """Open a port for each robot."""
    ports: list[Port] = []
    for place, claim in enumerate(claims):
        port = open_port(
            port=line.port,
            tcp=line.tcp,
            rfc2217=line.rfc2217,
            expose=line.expose,
            place=place,
            moved=claim.point_to if claim else lambda _: None,
        )
        stack.callback(port.close)
        ports.append(port)
    return ports


def _numbered(name: str, count: int) -> list[str]:
    """Return names of so many robots; a single one keeps the name."""
    return [name] if count == 1 else [f"{name}-{k}" for k in range(1, count + 1)]


def _links(path: Path | None, count: int) -> list[Path | None]:
    """Return paths with the robots' numbers at the end."""
    if path is None:
        return [None] * count
    check_name("--link", path)
    return [path.with_name(each) for each in _numbered(path.name, count)]


def _recordings(path: Path | None, count: int) -> list[Path | None]:
    """Return paths with the robots' numbers at the end of their stem, all of which can be written.

    Raises:
        EmulatorError: one of them cannot.
    """
    if path is None:
        return [None] * count
    check_name("--record", path)
    paths = [path.with_name(each + path.suffix) for each in _numbered(path.stem, count)]
    for each in paths:
        check_output(each)
    return [*paths]
