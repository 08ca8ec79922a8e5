"""Wire logs: of damaged ones the beginning is read and replayed, and a URL in them opens robots."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import serial
from as_type import as_type
from hostile_inputs import Hostile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn
from typer.testing import CliRunner

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app.cli.commands import app
from khepera_emulator.app.replay import Difference, replay
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.wire_log import Recording, WireLog, read_log
from khepera_emulator.ports.protocol_khepera import Serial

URL = "khepera://open-box?seed=3&baud=unpaced"
REQUESTS = (b"B\n", b"D,5,3\n", b"N\n", b"H\n", b"\xff\x00\n", b"D,0,0\n", b"K\n", b"memory\n")

NASTY = [
    b"1e308",
    b"-1",
    b"NaN",
    b"-Infinity",
    b"9" * 400,
    b"9" * 5000,
    b"true",
    b"null",
    b"[" * 3000,
    b'{"a":' * 3000,
    b'"\\u001b[2J"',
    b'"\\ud800"',
    b'"\\u0100"',
    b"\n",
    b"\n\n",
    b"\0",
    b"\xff\xfe",
    b"x" * 120_000,
    b'"what": "line", "baud": 0, ',
    b'"what": "battery", ',
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, Recording]:
    """A log of two clients, as it was written, and what it says."""
    path = tmp_path_factory.mktemp("log") / "wire.jsonl"
    with (
        WireLog(path, URL) as log,
        as_type(Serial, serial.serial_for_url(URL, timeout=0.2)) as port,
    ):
        for rate in (9600, 38400):
            log.line(port.now, LineFormat(rate))
            for request in REQUESTS:
                log.request(port.now, request)
                port.write(request)
                said = port.read(200)
                log.reply(port.now, said)
            log.close(port.now)
    data = path.read_bytes()
    assert len(data.splitlines()) > 30
    return data, read_log(path)


@st.composite
def damages(draw: DrawFn, length: int) -> tuple[list[tuple[tuple[int, int], bytes]], bool]:
    """Damage of a log: places, how many bytes go, what comes instead."""
    places = st.tuples(st.integers(0, length), st.integers(0, 40))
    new = st.sampled_from(NASTY) | st.binary(max_size=8)
    return draw(st.lists(st.tuples(places, new), min_size=1, max_size=3)), draw(st.booleans())


def read_or_refused(path: Path) -> Recording | str:
    """A log, or the sentence in which it is refused."""
    try:
        return read_log(path)
    except EmulatorError as error:
        return str(error)


def test_damaged_logs_are_read_and_replayed_up_to_the_damage(
    hostile: Hostile, tmp_path: Path, whole: tuple[bytes, Recording]
) -> None:
    path = tmp_path / "wire.jsonl"
    data, log = whole

    @settings(
        max_examples=hostile.examples(100),
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )
    @given(damages(len(data)))
    def read(damage: Any) -> None:
        hostile.count("wire logs: damaged files")
        changes, cut = damage
        bad = data
        for (first, size), new in changes:
            bad = bad[:first] + new + bad[first + size :]
        if cut:
            bad = bad[: changes[0][0][0]]
        path.write_bytes(bad)
        recording = read_or_refused(path)
        if isinstance(recording, str):
            assert recording.isprintable()
            assert len(recording) < 1000
            return
        assert recording.damage.isprintable()
        # lines before the first byte that differs say what they said
        first = min(first for (first, _), _ in changes)
        same = max(0, data.count(b"\n", 0, first) - 1)
        assert recording.entries[:same] == log.entries[:same]
        with (
            suppress(ValueError, OSError),  # which the command names
            serial.serial_for_url(URL, timeout=0.2) as port,
        ):
            assert isinstance(replay(recording, port), int | Difference)

    read()


SCHEMES = ["", "khepera", "KHEPERA", "spy", "loop", "socket", "alt", "rfc2217", "hwgrep", "cp2110"]


def test_a_log_opens_emulated_robots_alone(
    hostile: Hostile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = []

    def open_robot(url: str, **_: Any) -> None:
        opened.append(url)
        raise ValueError("enough")

    monkeypatch.setattr(serial, "serial_for_url", open_robot)
    log = tmp_path / "wire.jsonl"

    @settings(
        max_examples=hostile.examples(100),
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )
    @given(st.sampled_from(SCHEMES), st.sampled_from(["", ":", "/", "://", "://spy://"]), st.text())
    def refused_or_a_robot(scheme: str, between: str, rest: str) -> None:
        hostile.count("wire logs: URLs")
        opened.clear()
        url = f"{scheme}{between}{rest}"
        header = {"format": "khepera-wire-log", "version": 1, "url": url}
        log.write_text(json.dumps(header) + "\n")
        done = CliRunner().invoke(app, ["replay", str(log)])
        assert isinstance(done.exception, EmulatorError)
        assert all(each.startswith("khepera://") for each in opened)

    refused_or_a_robot()
