"""Results as JSON lines: a header, then one line a seed; safe against a kill at any moment.

A line is appended when its trial is done, and the complete file is put in the order of the
seeds: the same trials give the same bytes, however they were run. Half a line, left by a kill,
counts as not written.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, LOCK_NB, flock
from hashlib import sha256
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from macor_hil.errors import MacorError
from macor_hil.mind.map_file import write_atomically

Result = dict[str, Any]
"""What came of one trial: JSON-able."""

Results = dict[int, Result]
"""Results by seed."""


def plain(settings: Any) -> Any:
    """A settings dataclass as JSON-able values."""
    return TypeAdapter(type(settings)).dump_python(settings, mode="json")


def key_of(settings: Any, code: str) -> str:
    """A digest of settings and code, 12 hexadecimal digits."""
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
        """Results by ascending seed."""
        header, *entries = read_lines(self.path) or [self._header]
        if header != self._header:
            raise MacorError(f"{self.path} holds results of something else; move it away")
        return {entry["seed"]: entry["result"] for entry in sorted(entries, key=_seed)}

    def append(self, seed: int, result: Result) -> None:
        """Add the result of one seed, durably."""
        if not self.path.exists():
            self.write({})
        append_line(self.path, {"seed": seed, "result": result})

    def write(self, results: Results) -> None:
        """Replace the file by these results, in the order of their seeds."""
        entries = [{"seed": seed, "result": results[seed]} for seed in sorted(results)]
        write_atomically(self.path, b"".join(map(_line, [self._header, *entries])))


def append_line(path: Path, value: dict[str, Any]) -> None:
    """Add a line to a file of JSON lines, durably."""
    with path.open("ab") as file:
        file.write(_line(value))
        file.flush()
        os.fsync(file.fileno())


def read_lines(path: Path) -> list[dict[str, Any]]:
    """All whole lines of a file of JSON lines; none if there is no file.

    Raises:
        MacorError: a line is no JSON.
    """
    try:
        whole, _, _ = path.read_bytes().rpartition(b"\n")
    except FileNotFoundError:
        return []
    try:
        return [json.loads(line) for line in whole.splitlines()]
    except json.JSONDecodeError as error:
        raise MacorError(f"{path} is damaged ({error}); move it away") from None


@contextmanager
def only_one(folder: Path) -> Iterator[None]:
    """Hold a folder against other sweeps, until the end of this one or of its process.

    Raises:
        MacorError: another sweep writes there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        flock(handle, LOCK_EX | LOCK_NB)
        yield
    except BlockingIOError:
        raise MacorError(f"another sweep is writing to {folder}; wait for it") from None
    finally:
        os.close(handle)


def _seed(entry: dict[str, Any]) -> int:
    return int(entry["seed"])


def _dump(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _line(value: Any) -> bytes:
    return f"{_dump(value)}\n".encode()
