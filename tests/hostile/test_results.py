"""Results and kept drives of experiments: what is damaged is left out or made again, and told."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from as_type import as_type
from damage import damaged
from hostile_inputs import Hostile
from hypothesis import given, settings
from test_experiments import DRIVE

from macor_hil.errors import MacorError, MapError
from macor_hil.experiments.drives.training_drive import Recordings
from macor_hil.experiments.results.store import ResultsFile, append_line, only_one, read_lines
from macor_hil.experiments.sweep.runner import _costs
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt

RESULTS = {
    seed: {"trials": {"graded": [{"r": [0.62, 0.54, 0.1 * seed], "path": [[0.0, 0.25, 1e-05]]}]}}
    for seed in (1, 2, 3)
}


@pytest.fixture
def file(tmp_path: Path) -> ResultsFile:
    file = ResultsFile(tmp_path, "table1", DRIVE, "code")
    file.write(RESULTS)
    return file


def test_damaged_results_are_left_out(hostile: Hostile, file: ResultsFile) -> None:
    whole = file.path.read_bytes()

    @settings(max_examples=hostile.examples(150))
    @given(damaged(whole))
    def check(data: bytes) -> None:
        hostile.count("results")
        file.path.write_bytes(data)
        try:
            kept = file.read()
        except MacorError as error:
            assert_one_sentence(error, file.path)
            assert not data.startswith(whole.partition(b"\n")[0] + b"\n")
        else:
            assert kept.items() <= RESULTS.items()

    check()


def assert_one_sentence(error: MacorError | MapError, path: Path) -> None:
    assert str(path) in str(error)
    assert str(error).isprintable()


def test_one_damaged_line_costs_one_result_and_is_told(
    file: ResultsFile, caplog: pytest.LogCaptureFixture
) -> None:
    lines = file.path.read_bytes().splitlines(keepends=True)
    lines[2] = lines[2].replace(b"0.62", b"0.63")
    file.path.write_bytes(b"".join(lines))
    assert file.read() == {seed: RESULTS[seed] for seed in (1, 3)}
    assert "damaged lines that are left out: 1" in caplog.text


@pytest.mark.parametrize(
    "line",
    [
        b"[" * 100_000,
        b'{"seed":' + b"9" * 5000 + b"}",
        b'{"seed":4,"result":{}}',
        b'{"seed":4,"result":{},"check":"0"}',
        b'{"seed":"4","result":{},"check":null}',
        b'{"seed":4,"result":{"a":NaN},"check":null}',
        b'{"seed":4,"result":{"a":1e999},"check":null}',
        b"[]",
        b"4",
        b"\xff\xfe",
        b"",
    ],
)
def test_lines_that_nobody_wrote_are_left_out(file: ResultsFile, line: bytes) -> None:
    with file.path.open("ab") as stream:
        stream.write(line + b"\n")
    assert file.read() == RESULTS


def test_files_that_cannot_be_used_are_named(tmp_path: Path, file: ResultsFile) -> None:
    with pytest.raises(MacorError, match=r"cannot read .* regular file|Is a directory"):
        read_lines(tmp_path)
    with pytest.raises(MacorError, match="cannot write"):
        append_line(tmp_path, {})
    with pytest.raises(MacorError, match="cannot write to"), only_one(file.path):
        pass


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recordings, dict[Path, bytes]]:
    """A drive that is kept, and the bytes of its files."""
    drive = replace(DRIVE, tuning=10, random=6, reactive=0)
    recordings = Recordings(tmp_path_factory.mktemp("drives"), drive)
    recordings.make(1)
    return recordings, {path: path.read_bytes() for path in recordings.folder.iterdir()}


def test_damaged_drives_are_refused_in_one_sentence(
    hostile: Hostile, kept: tuple[Recordings, dict[Path, bytes]]
) -> None:
    recordings, files = kept
    (path,) = (path for path in files if "frames" in path.name)

    @settings(max_examples=hostile.examples(100))
    @given(damaged(files[path]))
    def check(data: bytes) -> None:
        hostile.count("kept drives")
        path.write_bytes(data)
        try:
            loaded = recordings._load(1)
        except MacorError as error:
            assert_one_sentence(error, path)
        else:
            assert np.isfinite(loaded.inputs).all()

    check()
    path.write_bytes(files[path])


@pytest.mark.parametrize("part", ["frames", "map"])
def test_a_damaged_drive_is_driven_again(
    kept: tuple[Recordings, dict[Path, bytes]], part: str, caplog: pytest.LogCaptureFixture
) -> None:
    recordings, files = kept
    good = recordings[1]
    (path,) = (path for path in files if part in path.name)
    path.write_bytes(files[path][:-40])
    again = recordings[1]
    assert (again.raw == good.raw).all()
    assert (
        as_type(FuzzyArt, again.brain.clusterer).weights
        == as_type(FuzzyArt, good.brain.clusterer).weights
    ).all()
    assert {path: path.read_bytes() for path in files} == files
    assert "it is driven again" in caplog.text


@pytest.mark.parametrize(
    "change",
    [
        {"raw": np.zeros((3, 36))},
        {"raw": np.full((8, 36), np.nan)},
        {"raw": np.zeros((8, 35))},
        {"commands": np.full(8, 3)},
        {"commands": np.array(0)},
        {"collided": np.zeros(8)},
    ],
)
def test_impossible_frames_are_refused(
    kept: tuple[Recordings, dict[Path, bytes]], change: dict[str, np.ndarray]
) -> None:
    recordings, files = kept
    (path,) = (path for path in files if "frames" in path.name)
    good: dict[str, Any] = {
        "raw": np.zeros((8, 36)),
        "commands": np.zeros(8, dtype=np.int64),
        "collided": np.zeros(8, dtype=bool),
    }
    np.savez(path, **{**good, **change})
    with pytest.raises(MacorError, match=r"the recording .* is damaged: "):
        recordings._load(1)
    path.write_bytes(files[path])


def test_costs_that_cannot_be_read_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "costs.jsonl"
    good = {"what": "table1", "seed": 1, "seconds": 2.5}
    odd = [{}, [], {"what": 1, "seconds": 1}, {"what": "a", "seconds": "long"}, good]
    path.write_text("".join(f"{json.dumps(each)}\n" for each in odd) + "{\n")
    assert _costs(path) == [good]
