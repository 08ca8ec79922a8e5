"""Keys of a terminal one by one, as they are pressed, without an echo.

Ctrl-C and its like stay signals. Where the system has no such terminals, there are no single keys.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

try:
    import termios
    import tty
except ImportError:  # this system has no such terminals
    has_single_keys = False
else:
    has_single_keys = True


@contextmanager
def single_keys(descriptor: int) -> Iterator[None]:
    """Have a terminal pass each key on at once; its settings are put back at the end.

    Raises:
        OSError: it is no terminal, or the system has none.
    """
    if not has_single_keys:
        raise OSError("this system has no terminal that passes single keys on")
    try:
        before = termios.tcgetattr(descriptor)
    except termios.error as error:
        raise OSError(*error.args) from None
    tty.setcbreak(descriptor)
    try:
        yield
    finally:
        with suppress(termios.error):  # a terminal that has gone needs no settings
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
