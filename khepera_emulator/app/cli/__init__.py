"""Command line of the emulator: `khepera-emulator`.

Nothing heavy is imported here: a signal while that happens ends the program without a traceback.
"""

import sys

from khepera_protocol.system.startup import INTERRUPTED, begin, ignore_signals


def main() -> None:
    """Run the command line, and end the process with its exit status."""
    try:
        begin("khepera-emulator")
        from khepera_emulator.app.cli.program import run

        status = run()
        ignore_signals()
    except KeyboardInterrupt:  # between two takings over of the signals
        status = INTERRUPTED
    sys.exit(status)


def __getattr__(name: str) -> object:
    """Import the commands when they are asked for."""
    if name != "app":
        raise AttributeError(name)
    from khepera_emulator.app.cli.commands import app

    return app
