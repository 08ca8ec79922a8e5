"""Logs of programs that run for long: one line each, with time and level, on standard error.

As text, for people and for the journal:

    2026-11-29T04:05:06.789Z WARNING macor_hil.runs.live_run: recovering from: ...

or as JSON, an object a line with `time`, `level`, `logger`, `message` and, after an exception,
`exception`. Times are UTC.
"""

import json
import logging
import time
from enum import StrEnum
from typing import Final

from pydantic import BaseModel, ConfigDict, Field

from khepera_protocol.text import PrintableFormatter


class LogLevel(StrEnum):
    """Least importance of what is logged."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogFormat(StrEnum):
    """Forms of a log."""

    TEXT = "text"
    JSON = "json"


class LogOptions(BaseModel):
    """The log of a program, on its standard error output."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    log_level: LogLevel = Field(default=LogLevel.WARNING, description="What to log.")
    log_format: LogFormat = Field(
        default=LogFormat.TEXT, description="A line of text, or a JSON object, for each event."
    )


class JsonFormatter(logging.Formatter):
    """Formats a record as a JSON object, in one line of ASCII."""

    def format(self, record: logging.LogRecord) -> str:
        """Format a record with all that belongs to it."""
        entry = {
            "time": self.formatTime(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        return json.dumps(entry)

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: N802, ARG002 - the base's
        """Return the time of a record: UTC, to the millisecond."""
        return _time_of(record)


class TextFormatter(PrintableFormatter):
    """Formats a record as a line with time, level and logger before the message."""

    def __init__(self) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: N802, ARG002 - the base's
        """Return the time of a record: UTC, to the millisecond."""
        return _time_of(record)


_FORMATTERS: Final = {LogFormat.TEXT: TextFormatter, LogFormat.JSON: JsonFormatter}


def set_up_log(options: LogOptions) -> None:
    """Have everything that is logged written as options say, and as nothing said before."""
    handler = logging.StreamHandler()
    handler.setFormatter(_FORMATTERS[options.log_format]())
    logging.basicConfig(level=options.log_level.upper(), handlers=[handler], force=True)


def logs_json() -> bool:
    """Return True if the log is JSON: then all else on standard error has to be, too."""
    return any(isinstance(each.formatter, JsonFormatter) for each in logging.root.handlers)


def _time_of(record: logging.LogRecord) -> str:
    seconds = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
    return f"{seconds}.{record.msecs:03.0f}Z"
