"""`macor-hil monitor`: a controller in the terminal."""

import time
from math import inf
from typing import Final

import zenoh
from rich.console import Console
from rich.live import Live

from macor_hil.monitor.follower import Follower
from macor_hil.monitor.terminal_view import render

_REFRESH: Final = 0.2
"""Seconds between two pictures."""

_ONCE_PATIENCE: Final = 2.0
"""Seconds that a single picture waits for a controller."""


def watch(
    session: zenoh.Session,
    robot: str,
    once: bool = False,
    duration: float | None = None,
    *,
    console: Console | None = None,
) -> bool:
    """Show a controller until Ctrl-C; it may come, go and come again.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in Zenoh keys.
        once: show a single picture, of a controller that is there or after two seconds.
        duration: seconds after which to end; None: never.
        console: where to draw; the standard output if not given.

    Returns:
        Whether a controller was there at the end.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """
    console = console or Console()
    with Follower(session, robot) as follower:
        if once:
            follower.follow(_ONCE_PATIENCE, until=lambda: follower.introduced)
            console.print(render(follower.watched, follower.now))
        else:
            _show(follower, console, inf if duration is None else duration)
        return follower.watched.controlled.alive


def _show(follower: Follower, console: Console, duration: float) -> None:
    end = time.monotonic() + duration
    with Live(console=console, auto_refresh=False, transient=False) as live:
        try:
            while (now := time.monotonic()) < end:
                live.update(render(follower.watched, follower.now), refresh=True)
                follower.follow(min(_REFRESH, end - now))
        except KeyboardInterrupt:
            pass  # the way to end it
