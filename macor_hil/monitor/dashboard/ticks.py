"""Does something again and again in the thread that serves the page."""

from collections.abc import Callable

from nicegui import app


def again_and_again(
    seconds: float, action: Callable[[], None], going: Callable[[], bool] = lambda: True
) -> None:
    """Call an action every so many seconds, whatever becomes of it, while something holds.

    NiceGUI's own repeating timers count on the wall clock, and sleep for as long as it is set back.
    """

    def turn() -> None:
        if going():
            app.timer(seconds, turn, once=True)
            action()

    app.timer(seconds, turn, once=True)
