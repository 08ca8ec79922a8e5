"""Serves the page on this machine, to any number of browsers."""

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from nicegui import app, ui

from macor_hil.monitor.dashboard.failures import Failures, OnceEach
from macor_hil.monitor.dashboard.guard import Guard
from macor_hil.monitor.dashboard.page import Page
from macor_hil.monitor.dashboard.sources import Source
from macor_hil.monitor.dashboard.ticks import again_and_again

HOST: Final = "127.0.0.1"

_PERIOD: Final = 0.1
"""Seconds between two looks at what has come, whether anyone looks at the page or not."""


def serve(
    open_source: Callable[[], Source],
    port: int,
    ready: Callable[[], None],
    poll: Callable[[], None] | None = None,
) -> None:
    """Serve until Ctrl-C or SIGTERM; nothing is fetched from elsewhere.

    Args:
        open_source: gives what to show, to every page that is opened: the one live robot, or a
            recording that each page plays for itself.
        port: TCP port on this machine.
        ready: called when the page is served.
        poll: called again and again, whether a page is open or not.
    """
    failures = Failures()
    logging.getLogger("nicegui").addFilter(OnceEach())
    app.on_exception(failures.add)
    app.on_startup(ready)
    app.add_middleware(Guard)
    if poll is not None:
        again_and_again(_PERIOD, poll)

    def page() -> None:
        Page(open_source(), failures)

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
