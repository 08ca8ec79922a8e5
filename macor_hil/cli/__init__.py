"""Command line of the controller: `macor-hil`.

Nothing heavy is imported here: a Ctrl-C while that happens ends the program without a traceback.
"""

import os
import sys
from types import FrameType

_INTERRUPTED = 130


def main() -> None:
    """Run the command line, and end the process with its exit status (docs/exit-status.md)."""
    try:
        status = _main()
    except KeyboardInterrupt:  # before it is taken care of
        os._exit(_INTERRUPTED)
    sys.exit(status)


def _main() -> int:
    import signal

    signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def end(number: int, _: FrameType | None) -> None:
        """Nothing has begun: nothing needs an end."""
        if number == signal.SIGINT:
            os.write(2, b"macor-hil: interrupted\n")
        os._exit(_INTERRUPTED if number == signal.SIGINT else 0)

    open_standard_files()
    for number in signals:
        # a script's background job ignores Ctrl-C, which a robot's controller must not
        if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, end)
    from macor_hil.cli.program import run

    status = run()
    for number in signals:
        signal.signal(number, signal.SIG_IGN)  # the end has begun
    return status


def open_standard_files() -> None:
    """Open those of the three standard files that are closed, for nobody.

    Otherwise the next file that is opened, a serial port perhaps, gets what is printed.
    """
    for descriptor, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, open(descriptor, mode, closefd=False))  # noqa: SIM115


def __getattr__(name: str) -> object:
    """Import the command line's parts when they are asked for."""
    if name != "app":
        raise AttributeError(name)
    from macor_hil.cli.program import app

    return app
