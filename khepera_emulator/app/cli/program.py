"""The program `khepera-emulator`, and what becomes of its errors and signals."""

import logging
import sys
from contextlib import suppress
from typing import Final

from khepera_protocol.logs import logs_json
from khepera_protocol.options import OptionError
from khepera_protocol.text import printable

from khepera_emulator.app.cli.commands import app
from khepera_emulator.app.ending import Ending
from khepera_emulator.errors import EmulatorError

_log = logging.getLogger(__name__)

_FAILED: Final = 2
_LONGEST_SENTENCE: Final = 4000


def run() -> int:
    """Run the command line; errors are one sentence. Returns the exit status."""
    with Ending() as ending:
        try:
            app(prog_name="khepera-emulator", obj=ending)
            status = 0
        except SystemExit as ended:
            status = int(ended.code or 0)
            if isinstance(ended.__context__, BrokenPipeError):
                _say("nobody reads the standard output")
                return _FAILED
        except (EmulatorError, OptionError) as error:
            _say(printable(str(error), _LONGEST_SENTENCE))
            return _FAILED
        except KeyboardInterrupt:
            _say("interrupted")
        return ending.status if ending.number else status


def _say(sentence: str) -> None:
    if logs_json():
        _log.error(sentence)
        return
    with suppress(OSError):  # nobody reads that
        print(f"khepera-emulator: {sentence}", file=sys.stderr)  # noqa: T201
