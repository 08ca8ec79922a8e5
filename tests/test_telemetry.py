"""Frames, decisions and states as watchers receive them over Zenoh."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh
from as_type import not_none
from controller_helpers import (
    PATIENCE,
    a_decision,
    a_frame,
    a_state,
    ask,
    ask_until,
    free_endpoint,
    publishing,
    receive,
    wait_until_watched,
    watching,
)
from khepera_protocol.zenoh.controller_payloads import Decision, Phase, State
from khepera_protocol.zenoh.payloads import Stamp
from pydantic import ValidationError

from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.cameras import Frame
from macor_hil.telemetry.publisher import Publisher, PublishingCamera
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop, stop_key

STOP = '{"stop": true}'
FRAME, DECISION, STATE = (f"macor/khepera/{leaf}" for leaf in ("frame", "decision", "state"))


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


def stamp(sample: zenoh.Sample) -> Stamp:
    return Stamp.model_validate_json(not_none(sample.attachment).to_bytes())


def test_a_decision_arrives_as_it_was_with_encoding_stamp_and_timestamp(endpoint: str) -> None:
    with publishing(endpoint) as (session, publisher), watching(endpoint, DECISION) as (_, samples):
        wait_until_watched(session, DECISION)
        for sequence in (0, 1):
            publisher.decision(a_decision(sequence))
        for sequence in (0, 1):
            sample = receive(samples)
            assert Decision.model_validate_json(sample.payload.to_bytes()) == a_decision(sequence)
            assert str(sample.encoding) == "application/json;macor.Decision"
            assert stamp(sample) == Stamp(sequence=sequence, time=1.5 + sequence)
            assert sample.timestamp is not None


def test_a_frame_arrives_as_a_jpeg_with_its_own_time(endpoint: str) -> None:
    with publishing(endpoint) as (session, publisher), watching(endpoint, FRAME) as (_, samples):
        wait_until_watched(session, FRAME)
        publisher.frame(a_frame(time=0.25))
        sample = receive(samples)
    image = cv2.imdecode(np.frombuffer(sample.payload.to_bytes(), np.uint8), cv2.IMREAD_COLOR)
    assert not_none(image).shape == (16, 16, 3)
    assert abs(int(not_none(image).mean()) - 128) < 3
    assert sample.encoding == zenoh.Encoding.IMAGE_JPEG
    assert stamp(sample) == Stamp(sequence=0, time=0.25)
    assert sample.timestamp is not None


def test_nothing_is_encoded_while_nobody_listens(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    encoded = []
    monkeypatch.setattr(cv2, "imencode", lambda *args: encoded.append(args))
    with publishing(endpoint) as (_, publisher):
        publisher.frame(a_frame())
    assert not encoded


def test_a_watched_camera_publishes_what_it_gives() -> None:
    class Camera:
        live = True
        closed = False

        def grab(self) -> Frame:
            return a_frame()

        def close(self) -> None:
            self.closed = True

    published: list[Frame] = []
    camera = Camera()
    watched = PublishingCamera(camera, published.append)
    assert published == [watched.grab()]
    watched.close()
    assert camera.closed


def test_a_late_joiner_gets_the_latest_decision_and_state(endpoint: str) -> None:
    with publishing(endpoint) as (_, publisher):
        publisher.decision(a_decision(0))
        publisher.decision(a_decision(1))
        publisher.state(a_state(Phase.STOPPED, reason="collision"), time=9.0)
        with watching(endpoint) as (session,):
            decision = ask_until(session, DECISION, lambda sample: stamp(sample).sequence == 1)
            assert Decision.model_validate_json(decision.payload.to_bytes()) == a_decision(1)
            assert str(decision.encoding) == "application/json;macor.Decision"
            assert stamp(decision) == Stamp(sequence=1, time=2.5)
            state = ask_until(session, STATE, stamp)
            assert State.model_validate_json(state.payload.to_bytes()).reason == "collision"
            assert stamp(state) == Stamp(sequence=0, time=9.0)


def test_an_answer_does_not_overtake_what_is_on_its_way(
    endpoint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent = threading.Event()
    with publishing(endpoint) as (_, publisher), watching(endpoint) as (session,):
        monkeypatch.setattr(publisher._frames, "put", lambda _: sent.wait(PATIENCE))
        publisher.frame(a_frame())
        publisher.decision(a_decision())
        # the picture before it is not through yet
        assert ask(session, DECISION).err
        sent.set()
        assert ask_until(session, DECISION, stamp)


def test_the_answer_to_a_query_is_known_as_the_sample_that_was_published(endpoint: str) -> None:
    with (
        publishing(endpoint) as (session, publisher),
        watching(endpoint, DECISION) as (watcher, samples),
    ):
        wait_until_watched(session, DECISION)
        publisher.decision(a_decision())
        assert ask_until(watcher, DECISION, stamp).timestamp == receive(samples).timestamp


def test_a_query_before_the_first_decision_is_told_so(endpoint: str) -> None:
    with publishing(endpoint), watching(endpoint) as (session,):
        assert not_none(ask(session, DECISION).err).payload.to_string() == "no decision yet"


@pytest.mark.parametrize(("key", "payload"), [(DECISION, a_decision()), (STATE, a_state())])
def test_describe_gives_the_schema_of_the_payload(
    endpoint: str, key: str, payload: Decision | State
) -> None:
    with publishing(endpoint), watching(endpoint) as (session,):
        reply = ask(session, f"{key}?describe").ok
    assert str(not_none(reply).encoding) == "application/schema+json"
    schema = json.loads(not_none(reply).payload.to_string())
    check(json.loads(payload.model_dump_json()), schema)
    with pytest.raises(AssertionError):
        check({**json.loads(payload.model_dump_json()), "unknown": 1}, schema)


def check(value: Any, schema: dict[str, Any]) -> None:
    """Assert that a value follows a schema."""
    if "enum" in schema:
        assert value in schema["enum"]
    kinds: dict[str, Any] = {
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "integer": int,
        "number": (int, float),
        "null": type(None),
    }
    assert isinstance(value, kinds[schema["type"]]), (value, schema)
    if schema["type"] == "object":
        assert set(schema["required"]) <= set(value) <= set(schema["properties"])
        for name, item in value.items():
            check(item, schema["properties"][name])
    if schema["type"] == "array":
        assert schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
        for item in value:
            check(item, schema["items"])


def looks_and_puts(session: zenoh.Session) -> Iterator[list[zenoh.Reply]]:
    """All that is no wish to end the run of khepera, on the stop key and on keys that match it."""
    for selector in ("**", "macor/**", "macor/*/stop", "macor/khepera/stop", "macor/khepera/sto$*"):
        for payload in (None, "stop", "{}", '{"stop": false}', '{"stop": true, "more": 1}'):
            yield list(session.get(selector, payload=payload, timeout=PATIENCE))
    for key in ("**", "macor/**", "macor/*/stop"):
        yield list(session.get(key, payload=STOP, timeout=PATIENCE))
        session.put(key, STOP)
        session.delete(key)
    for payload in ("", "stop", "{}", STOP * 100):
        session.put("macor/khepera/stop", payload)
    session.delete("macor/khepera/stop")


def test_a_look_at_all_keys_ends_no_run_that_has_a_stop_key(endpoint: str) -> None:
    asked: list[str] = []
    told: SimpleQueue[zenoh.Sample] = SimpleQueue()
    with (
        open_session([endpoint], []) as session,
        stop_key(session, "khepera", asked.append),
        open_session([], [endpoint]) as other,
    ):
        for replies in looks_and_puts(other):
            assert all("with the payload" in not_none(r.err).payload.to_string() for r in replies)
        # who is heard after all of these has come after them
        session.declare_subscriber("end", told.put)
        wait_until_watched(other, "end")
        other.put("end", "")
        receive(told)
        assert not asked
        ask_to_stop(other, "khepera")
        assert asked == ["the stop key"]


def test_a_sample_with_the_wish_on_the_very_key_ends_a_run(endpoint: str) -> None:
    asked: SimpleQueue[str] = SimpleQueue()
    with (
        open_session([endpoint], []) as session,
        stop_key(session, "khepera", asked.put),
        open_session([], [endpoint]) as other,
    ):
        wait_until_watched(other, "macor/khepera/stop")
        other.put("macor/khepera/stop", STOP)
        assert receive(asked) == "the stop key"


def test_a_controller_that_does_not_let_itself_be_stopped_says_why(endpoint: str) -> None:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply_err(b"\x1b[31mno\xff")

    with open_session([endpoint], []) as session:
        session.declare_queryable("macor/khepera/stop", answer)
        with (
            open_session([], [endpoint]) as other,
            pytest.raises(TelemetryError, match=r"refuses to stop: \\x1b\[31mno\\xff"),
        ):
            ask_to_stop(other, "khepera")


def test_liveliness_tells_of_coming_and_going(endpoint: str) -> None:
    with open_session([endpoint], []) as session:
        samples: SimpleQueue[zenoh.Sample] = SimpleQueue()
        session.liveliness().declare_subscriber("macor/khepera/alive", samples.put, history=True)
        with open_session([], [endpoint]) as other, Publisher(other, "khepera"):
            assert receive(samples).kind == zenoh.SampleKind.PUT
        assert receive(samples).kind == zenoh.SampleKind.DELETE


STUCK = """
import sys, zenoh
from macor_hil.telemetry.session import open_session
with open_session([], [sys.argv[1]]) as session:
    session.declare_subscriber("macor/**", lambda sample: None)
    print("listening", flush=True)
    sys.stdin.readline()
"""


def test_a_stuck_watcher_does_not_hold_up_the_controller(endpoint: str) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (200, 200, 3)).astype(np.uint8)
    frame = Frame(noise, 0.0, 0)  # a thousand of some 40 kB: more than the link's buffers hold
    with publishing(endpoint) as (session, publisher):
        watcher = subprocess.Popen(
            [sys.executable, "-c", STUCK, endpoint],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert not_none(watcher.stdout).readline() == "listening\n"
            wait_until_watched(session, FRAME, DECISION)
            os.kill(watcher.pid, signal.SIGSTOP)
            longest = 0.0
            for sequence in range(1000):
                start = time.perf_counter()
                publisher.frame(frame)
                publisher.decision(a_decision(sequence))
                longest = max(longest, time.perf_counter() - start)
        finally:
            os.kill(watcher.pid, signal.SIGCONT)
            watcher.communicate("\n")
    assert longest < 1.0  # a blocking put waits for five seconds


def test_an_endpoint_in_use_is_one_clear_sentence(endpoint: str) -> None:
    with (
        open_session([endpoint], []),
        pytest.raises(TelemetryError) as failure,
        open_session([endpoint], []),
    ):
        pass
    assert endpoint in str(failure.value)
    assert "already" in str(failure.value)
    assert "--listen" in str(failure.value)
    assert "\n" not in str(failure.value)
    assert isinstance(failure.value, MacorError)


def test_a_malformed_endpoint_is_one_clear_sentence() -> None:
    refused = pytest.raises(TelemetryError, match=r"nonsense.*looks like tcp/")
    with refused, open_session(["nonsense"], []):
        pass


def test_a_session_that_does_not_close_is_told_and_no_more(
    endpoint: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    class Stubborn:
        def close(self) -> None:
            raise zenoh.ZError("close operation timed out! at /somewhere.rs:1.")

    monkeypatch.setattr(zenoh, "open", lambda _: Stubborn())
    with open_session([endpoint], []):
        pass
    assert caplog.messages == ["a Zenoh session does not close: close operation timed out!"]


@pytest.mark.parametrize("name", ["", "*", "a/b", "a b", "robot#1", "rob\not"])
def test_a_robot_needs_a_name_that_can_be_a_key(endpoint: str, name: str) -> None:
    with pytest.raises(TelemetryError), publishing(endpoint, name):
        pass


def test_a_decision_takes_eight_infrared_readings() -> None:
    with pytest.raises(ValidationError):
        a_decision(infrared=[1, 2, 3])
