"""Recordings: what is written is read, published again, and survives what may happen."""

import json
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from as_type import as_type, not_none
from controller_helpers import ask, free_endpoint, wait_until_watched, watching
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.keys import ARENA, CAMERA, CONTROLLER, EMULATOR, KEYS
from khepera_protocol.zenoh.schema import schema_of
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from typer.testing import CliRunner
from watching_helpers import BEGIN, SECOND, a_life, a_picture

from macor_hil.cli.program import app
from macor_hil.errors import RecordingError
from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.mcap_index import latest_before, read_index
from macor_hil.telemetry.recordings.player import Player, play
from macor_hil.telemetry.recordings.recording import Recorder, play_recording, read_recording
from macor_hil.telemetry.session import open_session

PATIENCE = 20.0


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drive.mcap"
    with Recorder(path, "khepera") as recorder:
        for event in a_life():
            recorder.write(event)
    return path


def test_what_is_read_is_what_was_written(file: Path) -> None:
    assert read_recording(file) == ("khepera", a_life())


def test_an_independent_reader_finds_schemas_times_and_foxglove_messages(file: Path) -> None:
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        schemas = {
            c.topic: not_none(summary).schemas[c.schema_id]
            for c in not_none(summary).channels.values()
        }
        decision = schemas["macor/khepera/decision"]
        assert (decision.name, decision.encoding) == ("macor.Decision", "jsonschema")
        assert json.loads(decision.data) == schema_of(Decision)
        assert schemas["macor/khepera/frame"].name == "foxglove.CompressedImage"
        assert schemas["foxglove/khepera/pose"].name == "foxglove.PoseInFrame"
        assert schemas["foxglove/khepera/arena"].name == "foxglove.SceneUpdate"
        assert schemas["foxglove/khepera/infrared"].name == "foxglove.SceneUpdate"
        assert schemas["foxglove/khepera/wire"].name == "foxglove.Log"
        (_, _, message, picture), *_ = reader.iter_decoded_messages(["macor/khepera/frame"])
        assert picture.format == "jpeg"
        assert picture.data == a_picture(0)
        assert (message.log_time, message.publish_time) == (BEGIN + SECOND, SECOND)
        poses = [m for *_, m in reader.iter_decoded_messages(["foxglove/khepera/pose"])]
        assert [round(pose.pose.position.x, 3) for pose in poses] == [0.1, 0.12, 0.14, 0.16]
        logs = [m for *_, m in reader.iter_decoded_messages(["foxglove/khepera/wire"])]
        assert [log.message for log in logs] == ["H", "h,262,263"]


SIMPLE = {"boolean", "string", "number", "integer"}


def fields_as_viewers_read(schema: dict[str, Any], place: str) -> dict[str, Any]:
    """The fields of a JSON Schema, by the rules of the parsers of Foxglove and Lichtblick.

    Restated from `parseJsonSchema.ts`, which both have; anything else is an error there, and the
    topic cannot be opened.
    """
    assert schema.get("type") == "object", place
    fields: dict[str, Any] = {}
    for name, field in schema["properties"].items():
        where = f"{place}.{name}"
        assert "oneOf" not in field, where
        items = field["items"] if field.get("type") == "array" else field
        kind = items.get("type")
        assert isinstance(kind, str), where
        if kind == "string":
            assert "contentEncoding" not in items, where
        assert kind in SIMPLE or kind == "object", f"{where}: {kind}"
        fields[name] = fields_as_viewers_read(items, where) if kind == "object" else kind
    return fields


def test_the_parsers_of_viewers_read_every_json_topic(file: Path) -> None:
    with file.open("rb") as stream:
        topics = {}
        for schema, channel, message in make_reader(stream).iter_messages():
            if not_none(schema).encoding == "jsonschema":
                fields = fields_as_viewers_read(json.loads(not_none(schema).data), channel.topic)
                assert set(json.loads(message.data)) <= set(fields)
                topics[channel.topic] = fields
    assert len(topics) == 9
    corners = topics["khepera/khepera/arena"]["solids"]["corners"]
    assert corners == {"x": "number", "y": "number"}
    alternatives = topics["macor/khepera/decision"]["alternatives"]
    assert alternatives == {"command": "string", "evaluation": "number"}


def test_samples_that_cannot_be_read_are_kept_and_not_drawn(tmp_path: Path) -> None:
    odd = Arrival(EMULATOR, "truth", b'{"future":1}', "application/json", None, BEGIN)
    with Recorder(tmp_path / "x", "khepera") as recorder:
        recorder.write(odd)
    _, (event,) = read_recording(tmp_path / "x")
    assert as_type(Arrival, event).data == odd.data


def test_a_recording_that_was_cut_off_is_read_to_there(file: Path, tmp_path: Path) -> None:
    whole = read_recording(file)[1]
    data = file.read_bytes()
    # pictures are chunks of their own or end one: a cut in the middle keeps what came before
    cut = tmp_path / "cut.mcap"
    for share in (0.5, 0.9):
        cut.write_bytes(data[: int(share * len(data))])
        events = read_recording(cut)[1] if share > 0.5 else read_or_none(cut)
        assert events == whole[: len(events)]
    assert events


def read_or_none(path: Path) -> list[Arrival | Presence]:
    try:
        return read_recording(path)[1]
    except RecordingError:
        return []


@pytest.mark.parametrize("content", [b"", b"no recording", bytes(200)])
def test_what_is_no_recording_is_said_to_be_none(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x").write_bytes(content)
    with pytest.raises(RecordingError, match="is not a recording of a robot"):
        read_recording(tmp_path / "x")


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="cannot read"):
        read_recording(tmp_path / "x")
    with pytest.raises(RecordingError, match="cannot record to"):
        Recorder(tmp_path / "no" / "x", "khepera")


def test_a_full_disk_stops_the_recording_with_a_sentence(tmp_path: Path) -> None:
    path, events = tmp_path / "x.mcap", a_life(200)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))

    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from pathlib import Path\n"
        "from watching_helpers import a_life\n"
        "from macor_hil.errors import RecordingError\n"
        "from macor_hil.telemetry.recordings.recording import Recorder\n"
        "try:\n"
        "    with Recorder(Path(sys.argv[2]), 'khepera') as recorder:\n"
        "        for event in a_life(200):\n"
        "            recorder.write(event)\n"
        "except RecordingError as error:\n"
        "    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parent), str(path)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        preexec_fn=limit,
        check=True,
    )
    assert done.stdout == f"cannot record to {path}: File too large\n"
    read = read_recording(path)[1]
    assert 10 < len(read) < len(events)
    assert read == events[: len(read)]


def record_process(path: Path, endpoint: str, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "macor_hil.cli", "record", str(path), "--connect", endpoint]
    return subprocess.Popen([*command, *more], stdout=subprocess.PIPE, text=True)


def publish_to_recorder(endpoint: str, path: Path, events: Sequence[Arrival | Presence]) -> None:
    """Publish events to who records them at an endpoint, each picture when the last one is kept."""
    with open_session([endpoint], []) as session:
        wait_until_watched(session, "macor/khepera/decision", "macor/khepera/frame")
        with Player(session, "khepera") as player:
            pictures = 0
            for event in events:
                player.publish(event)
                if isinstance(event, Arrival) and event.leaf == "frame":
                    pictures += 1
                    wait_until(lambda: len(pictures_in(path)) == pictures)  # noqa: B023


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_recorder_that_is_ended_leaves_a_readable_file(
    tmp_path: Path, number: signal.Signals
) -> None:
    path, endpoint = tmp_path / "x.mcap", free_endpoint()
    pictures = 4
    process = record_process(path, endpoint)
    try:
        publish_to_recorder(endpoint, path, a_life(pictures))
        process.send_signal(number)
        said, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        process.wait()
    frames = pictures_in(path)
    assert len(frames) == pictures
    if number != signal.SIGKILL:
        assert process.returncode == (130 if number == signal.SIGINT else 0)
        assert "samples" in said
        with path.open("rb") as stream:
            assert make_reader(stream).get_summary() is not None


def test_a_recorder_tells_what_it_did_not_take(tmp_path: Path) -> None:
    path, endpoint = tmp_path / "x.mcap", free_endpoint()
    process = record_process(path, endpoint)
    try:
        with open_session([endpoint], []) as session:
            wait_until_watched(session, "macor/khepera/state")
            session.put("macor/*/state", "for everybody")
            session.put(
                "macor/khepera/state", "{}", attachment='{"sequence":1099511627776,"time":0}'
            )
            wait_until_watched(session, "macor/khepera/frame")
            session.put("macor/khepera/frame", a_picture())
            wait_until(lambda: pictures_in(path))
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        process.wait()
    assert "1 samples; 2 refused; the last one of state: its stamp cannot be read: sequence" in said


def wait_until(condition: Callable[..., Any]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def pictures_in(path: Path) -> list[Arrival]:
    events = read_or_none(path)
    return [event for event in events if isinstance(event, Arrival) and event.leaf == "frame"]


def test_a_recorder_ends_after_its_time(tmp_path: Path) -> None:
    path, endpoint = tmp_path / "x.mcap", free_endpoint()
    result = CliRunner().invoke(
        app, ["record", str(path), "--for", "0.2", "--connect", endpoint], catch_exceptions=False
    )
    assert result.stdout == f"{path}: 0 samples\n"


class Followed:
    """A player that waits for its watcher: what is shown too fast may be dropped, by design."""

    def __init__(self, player: Player, watcher: Follower) -> None:
        self.player, self.watcher, self.shown = player, watcher, 0

    def publish(self, event: Arrival | Presence) -> None:
        self.player.publish(event)
        if isinstance(event, Presence):
            self.watcher.follow(PATIENCE, until=lambda: self._alive(event.side) == event.alive)
        elif event.leaf == "decision":
            self.shown += 1
            self.watcher.follow(PATIENCE, until=self._followed)

    def _alive(self, side: str) -> bool:
        watched = self.watcher.watched
        return (watched.emulated if side == EMULATOR else watched.controlled).alive

    def _followed(self) -> bool:
        return len(self.watcher.watched.controlled.history) == self.shown


def test_a_replay_is_what_was_recorded(file: Path) -> None:
    _, events = read_recording(file)
    endpoint = free_endpoint()
    with open_session([endpoint], []) as session, Follower(session, "khepera") as watcher:
        with open_session([], [endpoint]) as other, Player(other, "khepera") as player:
            keys = [key for key in KEYS if key == ARENA or (key.published and key != CAMERA)]
            wait_until_watched(other, *(key.of("khepera") for key in keys))
            followed = cast(Player, Followed(player, watcher))
            play(events[:-2], followed, sleep=lambda _: None)
            watcher.follow(PATIENCE, until=lambda: watcher.watched.emulated.outline is not None)
            for event in events[-2:]:
                player.publish(event)
            watcher.follow(PATIENCE, until=lambda: not watcher.watched.controlled.alive)
        direct = RobotState("khepera")
        for event in events:
            direct.take(event)
        assert watcher.watched.controlled.decision == direct.controlled.decision
        assert watcher.watched.controlled.learned == direct.controlled.learned
        assert watcher.watched.emulated.outline == direct.emulated.outline
        # a burst: the last picture may have been dropped, as pictures are
        assert watcher.watched.frame in {a_picture(k) for k in range(3)}


def test_a_replay_keeps_the_distances_of_events() -> None:
    shown: list[Event] = []
    slept: list[float] = []

    class Recorded:
        def publish(self, event: Arrival | Presence) -> None:
            shown.append(event)

    events = a_life(2)
    play(events, cast(Player, Recorded()), speed=2.0, clock=lambda: sum(slept), sleep=slept.append)
    assert shown == events
    assert sum(slept) == pytest.approx((events[-1].received - BEGIN) / SECOND / 2.0)


def test_a_replay_answers_queries_with_the_latest_and_the_schema() -> None:
    endpoint = free_endpoint()
    with open_session([endpoint], []) as session, Player(session, "khepera") as player:
        decision = as_type(Arrival, a_life(1)[-5])
        assert decision.leaf == "decision"
        player.publish(decision)
        with watching(endpoint) as (watcher,):
            sample = ask(watcher, "macor/khepera/decision").ok
            assert not_none(sample).payload.to_bytes() == decision.data
            assert str(not_none(sample).encoding) == "application/json;macor.Decision"
            assert (
                json.loads(not_none(not_none(sample).attachment).to_bytes())["time"]
                == not_none(decision.stamp).time
            )
            schema = ask(watcher, "macor/khepera/decision?describe").ok
            assert json.loads(not_none(schema).payload.to_bytes()) == schema_of(Decision)
            assert ask(watcher, "macor/khepera/state").ok is None


def test_presence_is_kept_apart_for_each_side() -> None:
    watched = RobotState("khepera")
    for event in (Presence(EMULATOR, True, 0), Presence(CONTROLLER, True, 0)):
        watched.take(event)
    watched.take(Presence(EMULATOR, False, 0))
    assert watched.controlled.alive
    assert not watched.emulated.alive
    watched.take(Presence(CONTROLLER, False, 0))
    assert not watched.controlled.alive
    assert watched.controlled.met


@pytest.fixture(scope="module")
def long_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("long") / "long.mcap"
    with Recorder(path, "khepera") as recorder:
        for event in a_life(120):
            recorder.write(event)
    return path


class CountingFile(BytesIO):
    """A file that counts the bytes that are read of it."""

    read_bytes = 0

    def read(self, size: int | None = -1) -> bytes:
        data = super().read(size)
        self.read_bytes += len(data)
        return data


def in_order(event: Event) -> tuple[int, str]:
    return event.received, repr(event)[:60]


@pytest.mark.parametrize("begin", [0.001, 0.65, 2.5, 60.25, 119.9, 1e6])
@pytest.mark.parametrize("indexed", [True, False])
def test_a_recording_is_begun_with_what_was_so_then(
    long_file: Path, tmp_path: Path, begin: float, indexed: bool
) -> None:
    path, whole = long_file, read_recording(long_file)[1]
    if not indexed:
        path = tmp_path / "killed.mcap"
        path.write_bytes(long_file.read_bytes()[:-1])
    name, events = play_recording(path, begin)
    played = list(events)
    time = whole[0].received + round(begin * SECOND)
    before = [event for event in whole if event.received < time]
    kinds = {(event.side, getattr(event, "leaf", "alive")): event for event in before}
    assert name == "khepera"
    assert sorted(played[: len(kinds)], key=in_order) == sorted(kinds.values(), key=in_order)
    assert played[len(kinds) :] == [event for event in whole if event.received >= time]


def test_a_jump_reads_the_index_and_a_few_chunks(long_file: Path) -> None:
    data = long_file.read_bytes()
    file = CountingFile(data)
    index = not_none(read_index(file))
    wanted = [n for n, topic in index.topics.items() if not topic.startswith("foxglove")]
    begin, end = index.begin, index.end
    found = latest_before(file, index, (begin + end) // 2, wanted)
    assert len(found) == len(wanted)
    assert file.read_bytes < 0.05 * len(data)
    places = {place for _, place in found.values()}
    assert len(places) < 10


@pytest.mark.parametrize("cut", [1, 20, 40, 1000])
def test_a_file_without_its_end_has_no_index(long_file: Path, cut: int) -> None:
    assert read_index(BytesIO(long_file.read_bytes()[:-cut])) is None


def test_damage_of_an_index_is_no_harm(long_file: Path) -> None:
    data = bytearray(long_file.read_bytes())
    rng = np.random.default_rng(1)
    for _ in range(200):
        damaged = bytearray(data)
        for place in rng.integers(len(data) - 20_000, len(data), 5):
            damaged[place] = rng.integers(256)
        file = BytesIO(bytes(damaged))
        index = read_index(file)
        if index is not None:
            latest_before(file, index, int(rng.integers(2**62)), index.topics)


def test_times_only_grow_whatever_clocks_do(tmp_path: Path) -> None:
    events = a_life(2)
    moved = [
        replace(event, received=event.received - (k % 3) * SECOND) for k, event in enumerate(events)
    ]
    with Recorder(tmp_path / "x", "khepera") as recorder:
        for event in moved:
            recorder.write(event)
    with (tmp_path / "x").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        times = [m.log_time for _, _, m in reader.iter_messages(log_time_order=False)]
        stamps = [
            m.timestamp.ToNanoseconds()
            for *_, m in reader.iter_decoded_messages(["foxglove/khepera/pose"])
        ]
    assert times == sorted(times)
    assert stamps == sorted(stamps)
    assert times[-1] == max(event.received for event in moved)
