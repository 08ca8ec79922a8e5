"""Camera, ground truth and reset over Zenoh, as another process sees them."""

import json
import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isclose
from pathlib import Path
from queue import Queue

import cv2
import numpy as np
import pytest
import serial
import zenoh
from as_type import not_none
from emulator_process import COMMAND, PATIENCE, emulator, free_endpoint
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.config import zenoh_config
from khepera_protocol.zenoh.payload_model import MOST_TEXT
from khepera_protocol.zenoh.payloads import (
    Outline,
    Stamp,
    Truth,
    Wire,
    WireEntry,
)

from khepera_emulator.app.side_channel import SideChannel
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.wire_tap import MOST_ENTRIES, WireTap

START = load_arena("corridor").start


@contextmanager
def session(listen: Sequence[str] = (), connect: Sequence[str] = ()) -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh.Config.from_json5(zenoh_config(listen, connect))) as opened:
        yield opened


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """The endpoint of an emulator."""
    place = free_endpoint()
    with emulator(*("--listen", place, "--seed", "1", "--camera-rate", "50")):
        yield place


@pytest.fixture
def peer(endpoint: str) -> Iterator[zenoh.Session]:
    """A session that knows the emulator."""
    with session(connect=[endpoint]) as opened:
        wait_for(opened, "khepera/khepera/alive")
        yield opened


def wait_for(opened: zenoh.Session, key: str) -> None:
    """Return when a liveliness token is there."""
    alive: Queue[zenoh.Sample] = Queue()
    with opened.liveliness().declare_subscriber(key, alive.put, history=True):
        assert alive.get(timeout=PATIENCE).kind == zenoh.SampleKind.PUT


def query(peer: zenoh.Session, leaf: str, payload: bytes | str | None = None) -> zenoh.Reply:
    (reply,) = peer.get(f"khepera/khepera/{leaf}", payload=payload, timeout=PATIENCE)
    return reply


def sample_of(peer: zenoh.Session, leaf: str, payload: bytes | str | None = None) -> zenoh.Sample:
    reply = query(peer, leaf, payload)
    assert reply.ok is not None, not_none(reply.err).payload.to_string()
    return reply.ok


def refusal_of(peer: zenoh.Session, leaf: str, payload: bytes | str | None) -> str:
    reply = query(peer, leaf, payload)
    assert reply.ok is None
    return not_none(reply.err).payload.to_string()


def truth_of(sample: zenoh.Sample) -> Truth:
    assert str(sample.encoding) == "application/json;khepera.Truth"
    return Truth.model_validate_json(sample.payload.to_bytes())


def stamp_of(sample: zenoh.Sample) -> Stamp:
    return Stamp.model_validate_json(not_none(sample.attachment).to_bytes())


def decode(sample: zenoh.Sample) -> np.ndarray:
    data = np.frombuffer(sample.payload.to_bytes(), np.uint8)
    return not_none(cv2.imdecode(data, cv2.IMREAD_COLOR))


class TestLifetime:
    def test_a_channel_beside_another_goes_alone(self, tmp_path: Path) -> None:
        """Its descriptor may be another file's by the time that somebody asks for it."""
        place = free_endpoint()
        log = tmp_path / "log"
        with (
            log.open("w") as other,
            SideChannel("first", [place]) as first,
            session(connect=[place]) as peer,
        ):
            with SideChannel("second", [], beside=first) as second:
                wait_for(peer, "khepera/second/alive")
                descriptor = second.fileno()
            os.dup2(other.fileno(), descriptor)
            assert list(peer.get("khepera/second/truth", timeout=PATIENCE)) == []
            assert list(peer.liveliness().get("khepera/second/alive", timeout=PATIENCE)) == []
            second._wake.ring()
            os.close(descriptor)
        assert log.read_bytes() == b""


class TestCamera:
    @pytest.mark.parametrize("request_payload", [None, "{}", '{"view": "mirror"}'])
    def test_gives_a_lossless_mirror_image(
        self, peer: zenoh.Session, request_payload: str | None
    ) -> None:
        sample = sample_of(peer, "camera", request_payload)
        assert sample.encoding == zenoh.Encoding.IMAGE_PNG
        image = decode(sample)
        assert image.shape == (Mirror().height, Mirror().width, 3)
        assert not image[0, 0].any()  # outside the mirror
        assert image[Mirror().height // 4, Mirror().width // 2].any()

    def test_gives_a_panorama_as_jpeg(self, peer: zenoh.Session) -> None:
        sample = sample_of(peer, "camera", '{"view": "panorama", "encoding": "jpeg"}')
        assert sample.encoding == zenoh.Encoding.IMAGE_JPEG
        height, width, _ = decode(sample).shape
        assert width > height

    def test_shows_the_moment_of_the_query(self, peer: zenoh.Session) -> None:
        sample_of(peer, "reset", json.dumps({"seed": 3}))
        ahead = decode(sample_of(peer, "camera")).astype(int)
        again = decode(sample_of(peer, "camera")).astype(int)
        place = {"x": START.x, "y": START.y, "heading": 1.5}
        sample_of(peer, "reset", json.dumps({"pose": place}))
        aside = decode(sample_of(peer, "camera")).astype(int)
        assert abs(aside - ahead).mean() > 3 * abs(again - ahead).mean()

    @pytest.mark.parametrize(
        ("payload", "sentence"),
        [
            ('{"view": "telescope"}', "view: String should match pattern"),
            ('{"zoom": 2}', "zoom: Extra inputs are not permitted"),
            ("no JSON", "the payload: Invalid JSON"),
            (b"\xff\xfe", "the payload: Invalid JSON"),
        ],
    )
    def test_refuses_what_it_does_not_understand(
        self, peer: zenoh.Session, payload: bytes | str, sentence: str
    ) -> None:
        assert refusal_of(peer, "camera", payload).startswith(sentence)

    def test_streams_numbered_frames_while_someone_listens(self, peer: zenoh.Session) -> None:
        frames: Queue[zenoh.Sample] = Queue()
        with peer.declare_subscriber("khepera/khepera/camera", frames.put):
            seen = [frames.get(timeout=PATIENCE) for _ in range(3)]
        assert {str(frame.encoding) for frame in seen} == {"image/jpeg"}
        assert decode(seen[0]).shape == (Mirror().height, Mirror().width, 3)
        stamps = [stamp_of(frame) for frame in seen]
        # nobody has listened before: nothing was rendered, but for what a first put may lose
        assert stamps[0].sequence <= 2
        assert [stamp.sequence - stamps[0].sequence for stamp in stamps] == [0, 1, 2]
        assert stamps[0].time < stamps[1].time < stamps[2].time
        assert seen[0].timestamp is not None


class TestTruth:
    def test_is_told_with_its_time_and_number(self, peer: zenoh.Session) -> None:
        samples = [sample_of(peer, "truth") for _ in range(2)]
        first, second = map(stamp_of, samples)
        assert second.sequence == first.sequence + 1
        assert second.time > first.time
        assert truth_of(samples[0]).time == first.time

    def test_is_streamed_while_someone_listens(self, peer: zenoh.Session) -> None:
        truths: Queue[zenoh.Sample] = Queue()
        with peer.declare_subscriber("khepera/khepera/truth", truths.put):
            seen = [truths.get(timeout=PATIENCE) for _ in range(2)]
        assert truth_of(seen[1]).time > truth_of(seen[0]).time


class TestReset:
    def test_puts_the_robot_where_it_is_told(self, peer: zenoh.Session) -> None:
        wanted = {"x": 0.3, "y": 0.02, "heading": -0.5}
        truth = truth_of(sample_of(peer, "reset", json.dumps({"pose": wanted})))
        assert truth.pose.model_dump() == pytest.approx(wanted)
        assert truth_of(sample_of(peer, "truth")).pose == truth.pose

    def test_goes_to_the_start_by_default(self, peer: zenoh.Session) -> None:
        pose = truth_of(sample_of(peer, "reset", "{}")).pose
        assert (pose.x, pose.y) == (START.x, START.y)

    @pytest.mark.parametrize("payload", [None, ""])
    def test_takes_a_payload_that_says_so(self, peer: zenoh.Session, payload: str | None) -> None:
        assert refusal_of(peer, "reset", payload) == (
            "khepera/khepera/reset takes a payload that says what to do, if only {}: a Reset in"
            " JSON, see docs/keys.md"
        )

    @pytest.mark.parametrize(
        "selector", ["khepera/**", "**", "khepera/*/reset", "khepera/khepera/re$*"]
    )
    @pytest.mark.parametrize("payload", [None, "{}"])
    def test_does_not_come_from_a_look_around(
        self, peer: zenoh.Session, selector: str, payload: str | None
    ) -> None:
        wanted = {"x": 0.3, "y": 0.02, "heading": -0.5}
        sample_of(peer, "reset", json.dumps({"pose": wanted}))
        replies = list(peer.get(selector, payload=payload, timeout=PATIENCE))
        told = {str(reply.ok.key_expr) for reply in replies if reply.ok}
        assert "khepera/khepera/reset" not in told
        assert all(reply.ok for reply in replies)
        assert ("khepera/khepera/truth" in told) == ("re" not in selector)
        assert truth_of(sample_of(peer, "truth")).pose.model_dump() == pytest.approx(wanted)

    def test_with_a_seed_depends_on_nothing_before(self, peer: zenoh.Session) -> None:
        request = json.dumps({"seed": 7, "random": True})
        first = truth_of(sample_of(peer, "reset", request))
        truth_of(sample_of(peer, "reset", json.dumps({"random": True})))
        second = truth_of(sample_of(peer, "reset", request))
        assert first.pose == second.pose
        assert first.drift == second.drift
        third = truth_of(sample_of(peer, "reset", json.dumps({"seed": 8, "random": True})))
        assert third.pose != first.pose

    @pytest.mark.parametrize(
        ("payload", "sentence"),
        [
            ('{"pose": {"x": 0.3, "y": 0.12, "heading": 0}}', "no room for the robot at x=0.300 m"),
            ('{"pose": {"x": 0.3}}', "pose.y: Field required"),
            ('{"seed": -1}', "seed should be greater"),
            ("[]", "the payload should be"),
            ('{"pose": {"x": 1e8, "y": 0, "heading": 0}}', "x=1e+08 m, y=0 m is in no arena"),
            ('{"pose": {"x": 0, "y": -11, "heading": 0}}', "x=0 m, y=-11 m is in no arena"),
            ('{"pose": {"x": 0.3, "y": 0, "heading": 1e8}}', "the heading 1e+08 is not an angle"),
            ('{"pose": {"x": 0.3, "y": 0.6, "heading": 0}}', "x=0.300 m, y=0.600 m is outside the"),
            ('{"pose": {"x": 9, "y": 9, "heading": 0}, "seed": 1}', "x=9.000 m, y=9.000 m is outs"),
            ('{"\\u001b[31m": 1}', r"\x1b[31m: Extra inputs"),
            (" " * 20_000, "the payload has 20,000 bytes, and 10,000 at most are read"),
        ],
    )
    def test_refuses_clearly_and_changes_nothing(
        self, peer: zenoh.Session, payload: str, sentence: str
    ) -> None:
        before = truth_of(sample_of(peer, "reset", "{}"))
        assert refusal_of(peer, "reset", payload).startswith(sentence)
        assert truth_of(sample_of(peer, "truth")).pose == before.pose

    @pytest.mark.parametrize("field", ["x", "y", "heading"])
    @pytest.mark.parametrize("value", ["1e308", "-1e155", "1e400", "NaN"])
    def test_numbers_beyond_all_bounds_do_not_end_the_emulator(
        self, peer: zenoh.Session, field: str, value: str
    ) -> None:
        pose = {"x": "0.3", "y": "0.0", "heading": "0.0", field: value}
        fields = ", ".join(f'"{name}": {number}' for name, number in pose.items())
        assert refusal_of(peer, "reset", f'{{"pose": {{{fields}}}}}')
        assert decode(sample_of(peer, "camera")) is not None


class TestTogether:
    def test_line_drives_what_truth_tells(self) -> None:
        place = free_endpoint()
        with (
            emulator("--listen", place, "--robot", "second", "--drift", "none") as running,
            session(connect=[place]) as peer,
            serial.Serial(running.path, timeout=PATIENCE) as port,
        ):
            wait_for(peer, "khepera/second/alive")
            port.write(b"G,0,0\nD,3,3\n")
            moved = 0
            while moved < 20:
                port.write(b"H\n")
                line = port.read_until(b"\n")
                moved = int(line.split(b",")[1]) if line.startswith(b"h,") else 0
            (reply,) = peer.get("khepera/second/truth", timeout=PATIENCE)
            pose = truth_of(not_none(reply.ok)).pose
            assert pose.x >= START.x + moved * 0.08e-3
            assert isclose(pose.y, START.y, abs_tol=1e-3)

    def test_peers_find_each_other_through_the_emulator(self, endpoint: str) -> None:
        with (
            session(listen=[free_endpoint()], connect=[endpoint]) as controller,
            session(connect=[endpoint]) as monitor,
        ):
            found: Queue[zenoh.Sample] = Queue()
            token = controller.liveliness().declare_token("macor/khepera/alive")
            with monitor.liveliness().declare_subscriber(
                "macor/khepera/alive", found.put, history=True
            ):
                assert found.get(timeout=PATIENCE).kind == zenoh.SampleKind.PUT
            token.undeclare()

    def test_peer_may_come_later_and_again(self) -> None:
        later = free_endpoint()
        with emulator("--listen", free_endpoint(), "--connect", later):
            for _ in range(2):
                with session(listen=[later]) as peer:
                    wait_for(peer, "khepera/khepera/alive")

    def test_endpoint_in_use_is_one_sentence(self, endpoint: str) -> None:
        second = subprocess.run(
            [*COMMAND, "--listen", endpoint],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
        assert (second.returncode, second.stdout) == (2, "")
        assert second.stderr == (
            f"khepera-emulator: another program listens on {endpoint} already;"
            " give another --listen endpoint, or --no-zenoh\n"
        )


class TestArena:
    def test_is_told_to_be_drawn(self, peer: zenoh.Session) -> None:
        outline = Outline.model_validate_json(sample_of(peer, "arena").payload.to_bytes())
        assert outline.title == load_arena("corridor").title
        assert (outline.start.x, outline.start.y) == (START.x, START.y)
        # the outer wall: its inner face is 12.5 cm to the right of the start
        assert any(
            min(y for _, y in solid.corners) < -0.125 <= max(y for _, y in solid.corners) + 1e-9
            for solid in outline.solids
        )


class TestWire:
    def test_what_passes_on_the_line_is_published_and_kept_for_queries(self) -> None:
        place = free_endpoint()
        with (
            emulator("--listen", place) as robot,
            session(connect=[place]) as peer,
            serial.Serial(robot.path, 9600, timeout=PATIENCE) as port,
        ):
            samples: Queue[zenoh.Sample] = Queue()
            peer.declare_subscriber("khepera/khepera/wire", samples.put)
            port.write(b"B\n")
            assert port.readline().startswith(b"b,")
            entries: list[WireEntry] = []
            replies = ""
            while not replies.endswith("\n"):
                wire = Wire.model_validate_json(samples.get(timeout=PATIENCE).payload.to_bytes())
                assert wire.first == len(entries)
                entries += wire.entries
                replies += "".join(entry.text for entry in wire.entries if entry.what == "reply")
            asked = Wire.model_validate_json(sample_of(peer, "wire").payload.to_bytes())
        assert [entry.what for entry in entries[:2]] == ["line", "request"]
        assert entries[0].text == "9600 8N1"
        assert entries[1].text == "B\n"
        assert replies.startswith("b,")
        assert asked.entries[: len(entries)] == entries


class TestWireTap:
    def test_keeps_the_latest_entries_and_numbers_all(self) -> None:
        tap = WireTap()
        for number in range(MOST_ENTRIES + 3):
            tap.request(float(number), b"N\n")
        assert tap.count == MOST_ENTRIES + 3
        assert (tap.since(0).first, len(tap.since(0).entries)) == (3, MOST_ENTRIES)
        late = tap.since(MOST_ENTRIES + 2)
        assert [entry.time for entry in late.entries] == [MOST_ENTRIES + 2.0]
        assert tap.since(tap.count).entries == []

    def test_settings_are_told_when_they_are_new(self) -> None:
        tap = WireTap()
        for baud in (9600, 9600, 19200):
            tap.line(1.0, LineFormat(baud, 8, "N", 2.0))
        assert [entry.text for entry in tap.since(0).entries] == ["9600 8N2", "19200 8N2"]

    def test_what_is_told_at_once_has_an_end(self) -> None:
        tap = WireTap()
        for number in range(100):
            tap.request(float(number), b"x" * 50_000)
        wire = tap.since(0)
        assert wire.first == 100 - len(wire.entries) > 0
        assert {len(entry.text) for entry in wire.entries} == {MOST_TEXT}
        assert Wire.parse(wire.model_dump_json().encode()) == wire

    def test_bytes_that_are_no_text_are_kept(self) -> None:
        tap = WireTap()
        tap.reply(1.0, bytes(range(256)))
        (entry,) = tap.since(0).entries
        assert entry.text.encode("latin-1") == bytes(range(256))
