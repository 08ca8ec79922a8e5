"""`macor-hil monitor`: a controller in the terminal."""

import time
from collections.abc import Sequence
from math import inf
from typing import Final

from rich.console import Console
from rich.live import Live

from macor_hil.monitor.view import render
from macor_hil.monitor.watcher import Watcher
from macor_hil.telemetry.session import check_robot_name, open_session

_REFRESH: Final = 0.2
"""Seconds between two pictures."""

_ONCE_PATIENCE: Final = 2.0
"""Seconds that a single picture waits for a controller."""


def watch(
    robot: str,
    listen: Sequence[str],
    connect: Sequence[str],
    once: bool = False,
    duration: float | None = None,
    *,
    console: Console | None = None,
) -> bool:
    """Show a controller until Ctrl-C; it may come, go and come again.

    Args:
        robot: the robot's name in Zenoh keys.
        listen: Zenoh endpoints to be found at; usually none.
        connect: Zenoh endpoints of the controller, or of a peer that knows it.
        once: show a single picture, of a controller that is there or after two seconds.
        duration: seconds after which to end; None: never.
        console: where to draw; the standard output if not given.

    Returns:
        Whether a controller was there at the end.

    Raises:
        TelemetryError: the name or an endpoint cannot be used.
    """
    check_robot_name(robot)
    console = console or Console()
    with open_session(listen, connect) as session, Watcher(session, robot) as watcher:
        if once:
            watcher.follow(_ONCE_PATIENCE, until=lambda: watcher.introduced)
            console.print(render(watcher.watched, time.time()))
        else:
            _show(watcher, console, inf if duration is None else duration)
        return watcher.watched.controlled.alive


def _show(watcher: Watcher, console: Console, duration: float) -> None:
    end = time.monotonic() + duration
    with Live(console=console, auto_refresh=False, transient=False) as live:
        try:
            while (now := time.monotonic()) < end:
                live.update(render(watcher.watched, time.time()), refresh=True)
                watcher.follow(min(_REFRESH, end - now))
        except KeyboardInterrupt:
            pass  # the way to end it
