"""Command line of the controller: `macor-hil`.

Nothing heavy is imported here: a Ctrl-C while that happens ends the program without a traceback.
"""

import os
import sys

from khepera_protocol.system.startup import INTERRUPTED, begin, ignore_signals


def main() -> None:
    """Run the command line, and end the process with its exit status (docs/exit-status.md)."""
    try:
        begin("macor-hil")
        from macor_hil.cli.program import run

        status = run()
        ignore_signals()  # the end has begun
    except KeyboardInterrupt:  # before it is taken care of
        os._exit(INTERRUPTED)
    sys.exit(status)


def __getattr__(name: str) -> object:
    """Import the command line's parts when they are asked for."""
    if name != "app":
        raise AttributeError(name)
    from macor_hil.cli.program import app

    return app
