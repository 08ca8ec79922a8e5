"""Queries: whatever is asked, each is answered, and no answer ends the emulator or changes it."""

import contextlib
import json
import select
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pybullet
import pytest
import zenoh
from as_type import not_none
from emulator_process import PATIENCE, free_endpoint
from hostile_inputs import Hostile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from khepera_protocol.zenoh.config import zenoh_config
from khepera_protocol.zenoh.keys import EMULATOR_KEYS
from khepera_protocol.zenoh.payloads import Reset, Truth

from khepera_emulator.app.side_channel import SideChannel
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.robot import emulator as emulator_module
from khepera_emulator.robot.emulator import Emulator, Setup

LEAVES = [key.leaf for key in EMULATOR_KEYS if key.leaf != "alive"]


class Bench:
    """An emulator whose queries are answered in the test's own thread."""

    def __init__(self, channel: SideChannel, session: zenoh.Session, emulator: Emulator) -> None:
        self.channel, self.session, self.emulator = channel, session, emulator

    def ask(self, key: str, payload: bytes | str | None = None) -> list[zenoh.Reply]:
        """All replies to a query that reaches one of the keys."""
        replies = self.session.get(key, payload=payload, timeout=PATIENCE)
        with ThreadPoolExecutor(1) as other:
            told = other.submit(list, replies)
            while not told.done():
                select.select([self.channel.fileno()], [], [], 0.01)
                self.channel.serve(self.emulator)
        return told.result()

    def reply(self, leaf: str, payload: bytes | str | None = None) -> zenoh.Reply:
        (reply,) = self.ask(f"khepera/khepera/{leaf}", payload)
        return reply

    def refusal(self, leaf: str, payload: bytes | str | None = None) -> str:
        reply = self.reply(leaf, payload)
        assert reply.ok is None
        return not_none(reply.err).payload.to_string()

    def truth(self) -> Truth:
        return Truth.model_validate_json(not_none(self.reply("truth").ok).payload.to_bytes())


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    place = free_endpoint()
    emulator = Emulator(Setup(load_arena("corridor"), baud=None))
    config = zenoh.Config.from_json5(zenoh_config([], [place]))
    with SideChannel("khepera", [place]) as channel, zenoh.open(config) as session:
        yield Bench(channel, session, emulator)
    emulator.close()


BREAKS = [
    OverflowError("cannot convert float infinity to integer"),
    ZeroDivisionError(),
    MemoryError(),
    RecursionError("maximum recursion depth exceeded"),
    AssertionError(),
    KeyError("\x1b[2J"),
    OSError(28, "No space left on device"),
    cv2.error("OpenCV: \x1b]0;title\x07\n"),
    pybullet.error("Not connected to physics server."),
    zenoh.ZError("closed"),
    EmulatorError("\x1b[31mred"),
]


@pytest.mark.parametrize("error", BREAKS, ids=lambda error: type(error).__name__)
def test_whatever_fails_while_a_query_is_answered_is_the_answer(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    hostile: Hostile,
    error: OverflowError | ZeroDivisionError,
) -> None:
    def fail(*_: Reset) -> None:
        raise error

    methods = {"camera": "mirror_image", "truth": "truth", "reset": "reset", "arena": "outline"}
    for leaf, method in methods.items():
        hostile.count("queries: failing answers")
        with monkeypatch.context() as patch:
            patch.setattr(bench.emulator, method, fail)
            reason = bench.refusal(leaf, "{}")
        assert reason.isprintable()
        assert reason
        named = isinstance(error, EmulatorError) or type(error).__name__ in reason
        assert named
        logged = [record.getMessage() for record in caplog.records if record.exc_info]
        expected = f"a query on khepera/khepera/{leaf} failed"
        assert isinstance(error, EmulatorError) or logged[-1] == expected
    assert bench.truth().pose.x == pytest.approx(load_arena("corridor").start.x)


def test_a_sample_that_fails_is_told_once_and_the_others_go_on(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(bench.emulator, "mirror_image", lambda: 1 / 0)
        truths = bench.session.declare_subscriber("khepera/khepera/truth")
        pictures = bench.session.declare_subscriber("khepera/khepera/camera")
        for _ in range(3):
            for stream in bench.channel._streams[:2]:
                while not stream._publisher.heard:
                    pass
                stream.next = 0.0
            bench.channel.serve(bench.emulator)
            assert truths.recv() is not None
    failures = [each.getMessage() for each in caplog.records if each.exc_info]
    assert failures == ["a sample of khepera/khepera/camera failed"]
    bench.channel._streams[0].next = 0.0
    bench.channel.serve(bench.emulator)
    assert pictures.recv() is not None


def test_a_reset_that_fails_leaves_the_robot_as_it_was(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = bench.truth()
    with monkeypatch.context() as patch:
        patch.setattr("khepera_emulator.robot.fleet.World", lambda *_, **__: 1 / 0)
        assert "ZeroDivisionError" in bench.refusal("reset", '{"seed": 3}')
    with monkeypatch.context() as patch:
        patch.setattr(emulator_module, "random_pose", lambda *_: 1 / 0)
        assert "ZeroDivisionError" in bench.refusal("reset", '{"random": true}')
    assert bench.truth() == before
    bench.emulator.write(b"C,100,100\n")
    bench.emulator.advance(bench.emulator.now + 2.0)
    assert bench.truth().pose.x > before.pose.x + 0.005


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=6,
)
NUMBERS = st.floats() | st.integers(-(10**400), 10**400) | st.floats(-1.0, 1.0)
RESETS = st.fixed_dictionaries(
    {},
    optional={
        "pose": st.fixed_dictionaries({"x": NUMBERS, "y": NUMBERS, "heading": NUMBERS}) | ANYTHING,
        "random": ANYTHING,
        "seed": NUMBERS,
    },
)
PICTURES = st.fixed_dictionaries(
    {}, optional={"view": st.sampled_from(["mirror", "panorama"]) | ANYTHING, "encoding": ANYTHING}
)


def test_every_payload_is_answered(bench: Bench, hostile: Hostile) -> None:
    payloads = (
        st.binary(max_size=200)
        | st.sampled_from([b"{" * 9_000, b"[" * 9_000, b" " * 20_000, b'{"seed": ' + b"9" * 9_000])
        | (ANYTHING | RESETS | PICTURES).map(lambda value: json.dumps(value).encode())
    )

    @settings(
        max_examples=hostile.examples(150),
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    )
    @given(st.sampled_from(LEAVES), payloads)
    def answered(leaf: str, payload: bytes | str | None) -> None:
        hostile.count("queries: payloads")
        reply = bench.reply(leaf, payload)
        if reply.ok is None:
            reason = not_none(reply.err).payload.to_string()
            assert reason.isprintable()
            assert "failed" not in reason
        # where it is, it can see, and be put back
        with contextlib.suppress(AttributeError):
            image = np.frombuffer(not_none(bench.reply("camera").ok).payload.to_bytes(), np.uint8)
            assert cv2.imdecode(image, cv2.IMREAD_COLOR) is not None
        assert bench.truth().pose.x == pytest.approx(0.5, abs=0.65)

    answered()


@pytest.mark.parametrize(
    "selector",
    ["**", "khepera/**", "khepera/*/*", "*/khepera/*", "khepera/khepera/*", "khepera/*/reset"],
)
@pytest.mark.parametrize("payload", [None, b"", b"{}", b'{"random": true}', b"\xff"])
def test_a_look_around_changes_nothing(
    bench: Bench, hostile: Hostile, selector: str, payload: bytes | None
) -> None:
    hostile.count("queries: looks around")
    bench.reply("reset", '{"pose": {"x": 0.3, "y": 0.0, "heading": 1.0}}')
    bench.emulator.write(b"G,7,8\n")
    bench.emulator.advance(bench.emulator.now + 0.1)
    before = bench.truth()
    replies = bench.ask(selector, payload)
    assert all("reset" not in str(reply.ok.key_expr) for reply in replies if reply.ok)
    assert bench.truth() == before
    bench.emulator.read()
    bench.emulator.write(b"H\n")
    bench.emulator.advance(bench.emulator.now + 0.1)
    assert bench.emulator.read() == b"h,7,8\r\n"
