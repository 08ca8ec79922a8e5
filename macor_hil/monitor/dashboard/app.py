"""Serves the page on this machine, to any number of browsers."""

from collections.abc import Callable
from contextlib import suppress
from typing import Final

from nicegui import app, ui

from macor_hil.monitor.dashboard.page import Page
from macor_hil.monitor.dashboard.sources import Source

HOST: Final = "127.0.0.1"

_PERIOD: Final = 0.1
"""Seconds between two looks at what has come, whether anyone looks at the page or not."""


def serve(source: Source, port: int, ready: Callable[[], None]) -> None:
    """Serve until Ctrl-C or SIGTERM; nothing is fetched from elsewhere.

    Args:
        source: what to show.
        port: TCP port on this machine.
        ready: called when the page is served.
    """
    app.on_startup(ready)
    app.timer(_PERIOD, source.poll)

    def page() -> None:
        Page(source)

    with suppress(KeyboardInterrupt):  # the way to end it
        ui.run(
            page,
            host=HOST,
            port=port,
            title="macor-hil",
            dark=True,
            reload=False,
            show=False,
            show_welcome_message=False,
            tailwind=False,
        )
