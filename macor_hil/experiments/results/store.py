"""Results as JSON lines: a header, then one line a seed; safe against a kill at any moment.

A line is appended when its trial is done, and the complete file is put in the order of the
seeds: the same trials give the same bytes, however they were run. Half a line, left by a kill,
counts as not written, and so does a line that is not what its checksum says.
"""

import json
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from khepera_protocol.system.locking import lock_now
from pydantic import TypeAdapter
from pydantic_core import from_json

from macor_hil.errors import MacorError
from macor_hil.files import MIB, InputError, read_bounded, write_atomically

_log = logging.getLogger(__name__)

_MOST_BYTES: Final = 256 * MIB

Result = dict[str, Any]
"""The result of one trial: JSON-able."""

TOOK: Final = "took"
"""The entry of a result for the time that its parts took."""

Results = dict[int, Result]
"""Results by seed."""


def plain(settings: Any) -> Any:
    """Return a settings dataclass as JSON-able values."""
    return TypeAdapter(type(settings)).dump_python(settings, mode="json")


def key_of(settings: Any, code: str) -> str:
    """Return a digest of settings and code, 12 hexadecimal digits."""
    return sha256(f"{_dump(plain(settings))} {code}".encode()).hexdigest()[:12]


class ResultsFile:
    """The results of one experiment under one set of settings.

    Args:
        folder: where results are kept.
        name: of the experiment.
        settings: its settings, written into the header.
        code: digest of the code that decides the results.

    Raises:
        MacorError: the file is there and holds something else.
    """

    def __init__(self, folder: Path, name: str, settings: Any, code: str) -> None:
        key = key_of(settings, code)
        self.path = folder / f"{name}-{key}.jsonl"
        self._header = {"experiment": name, "code": code, "settings": plain(settings)}

    def read(self) -> Results:
        """Return results by ascending seed; damaged lines are left out, and that is told."""
        lines = read_lines(self.path)
        if not lines:
            return {}
        header, *entries = lines
        if header is None:
            raise MacorError(f"{self.path} is damaged: its first line cannot be read; move it away")
        if header != self._header:
            raise MacorError(f"{self.path} holds results of something else; move it away")
        good = [pair for pair in map(_result, entries) if pair is not None]
        if damaged := len(entries) - len(good):
            _log.warning("%s: damaged lines that are left out: %d", self.path, damaged)
        return dict(sorted(good))

    def append(self, seed: int, result: Result) -> None:
        """Add the result of one seed, durably."""
        if not self.path.exists():
            self.write({})
        append_line(self.path, _entry(seed, result))

    def write(self, results: Results) -> None:
        """Replace the file by these results, in the order of their seeds."""
        entries = [_entry(seed, results[seed]) for seed in sorted(results)]
        write_atomically(self.path, b"".join(map(_line, [self._header, *entries])))


def append_line(path: Path, value: dict[str, Any]) -> None:
    """Add a line to a file of JSON lines, durably.

    Raises:
        MacorError: it cannot be written.
    """
    try:
        with path.open("ab") as file:
            file.write(_line(value))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise MacorError(f"cannot write {path}: {error.strerror}") from None


def read_lines(path: Path) -> list[dict[str, Any] | None]:
    """Return all whole lines of a file of JSON lines, None for one that is no object.

    Raises:
        MacorError: the file cannot be read.
    """
    try:
        whole, _, _ = read_bounded(path, _MOST_BYTES).rpartition(b"\n")
    except FileNotFoundError:
        return []
    except InputError as error:
        raise MacorError(f"cannot read {path}: {error}; move it away") from None
    return [_object(line) for line in whole.splitlines()]


def _object(line: bytes) -> dict[str, Any] | None:
    try:
        value = from_json(line, allow_inf_nan=False)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _entry(seed: int, result: Result) -> dict[str, Any]:
    """Return a line of results, with a checksum of itself."""
    return {"seed": seed, "result": result, "check": _check(seed, result)}


def _check(seed: int, result: Result) -> str:
    return sha256(_dump([seed, result]).encode()).hexdigest()[:8]


def _result(line: dict[str, Any] | None) -> tuple[int, Result] | None:
    """Return seed and result of a line; None if it is not as it was written."""
    match line:
        case {"seed": int(seed), "result": dict(result), **rest}:
            try:
                whole = rest == {"check": _check(seed, result)}
            except ValueError:  # a number beyond JSON
                whole = False
            return (seed, result) if whole else None
    return None


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Hold a folder against other sweeps, until the end of this one or of its process.

    Raises:
        MacorError: another sweep writes there, or nobody can.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise MacorError(f"cannot write to {folder}: {error.strerror}") from None
    try:
        lock_now(handle)
        yield
    except BlockingIOError:
        raise MacorError(f"another sweep is writing to {folder}; wait for it") from None
    finally:
        os.close(handle)


def _dump(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _line(value: Any) -> bytes:
    return f"{_dump(value)}\n".encode()
