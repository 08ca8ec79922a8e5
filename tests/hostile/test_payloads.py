"""Payloads over Zenoh: what keeps to the bounds is shown and recorded, all else is refused."""

import contextlib
import io
import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from hostile_inputs import Hostile
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.zenoh.controller_payloads import Decision, Learned
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR, KEYS, PAYLOADS
from khepera_protocol.zenoh.payload_model import MOST_JSON, PayloadError
from khepera_protocol.zenoh.payloads import CameraQuery, Stamp
from khepera_protocol.zenoh.schema import schema_of
from rich.console import Console
from watching_helpers import BEGIN, a_picture

from macor_hil.monitor.dashboard.board import Board
from macor_hil.monitor.robot_state import RobotState
from macor_hil.monitor.terminal_view import render
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.recording import Recorder, read_recording

MODELS = sorted(EXAMPLES, key=lambda model: model.__name__)
JSON_KEYS = sorted(PAYLOADS)

WORDS = st.one_of(
    st.text(max_size=40),
    st.sampled_from(
        [
            "\x1b[2J\x1b]0;title\x07",
            "[red]x[/red][link=http://evil.example]y[/link]",
            "<script>alert(1)</script>",
            "</svg><img src=x onerror=alert(1)>",
            "\u202etfel-ot-thgir",
            "a\r\nb\x00c",
            "-",
            "",
            "x" * 4096,
        ]
    ),
)

# not taken by json.dumps as they stand; put into a text where they are named
BEYOND = {
    "@inf": "Infinity",
    "@-inf": "-Infinity",
    "@nan": "NaN",
    "@1e308": "1e308",
    "@1e999": "1e999",
    "@long": "1" + "0" * 400,
    "@longer": "9" * 5000,
    "@deep": "[" * 500 + "]" * 500,
    "@-0.0": "-0.0",
    "@escape": r'"\ud800"',
}
ODD = st.one_of(
    st.sampled_from([None, True, [], {}, [[]], "", 0, -1, 2**31, 2**40, 2**53, 2**63, -(2**63)]),
    st.sampled_from([1e10, 1e300, -1e300, 5e-324, 1e-300, *BEYOND]),
    WORDS,
    st.integers(),
    st.floats(allow_nan=False, allow_infinity=False),
    st.just(["x"] * 1000),
    st.just([0.5] * 3000),
)


def written(value: Any) -> bytes:
    text = json.dumps(value)
    for name, stands_for in BEYOND.items():
        text = text.replace(f'"{name}"', stands_for)
    return text.encode(errors="surrogatepass")


def places(value: Any, place: tuple[int | str, ...] = ()) -> Iterator[tuple[int | str, ...]]:
    """Every place in a JSON value."""
    yield place
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places(each, (*place, key))


def put(value: Any, place: tuple[int | str, ...], odd: Any) -> Any:
    if not place:
        return odd
    copy: Any = dict(value) if isinstance(value, dict) else list(value)
    copy[place[0]] = put(copy[place[0]], place[1:], odd)
    return copy


@st.composite
def damaged(draw: st.DrawFn, model: Any) -> bytes:
    """An example with some of its places replaced, or damaged as a text."""
    value = json.loads(EXAMPLES[model].model_dump_json())
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.sampled_from(list(places(value))))
        value = put(value, place, draw(ODD))
    if isinstance(value, dict) and draw(st.booleans()):
        value = {**value, draw(WORDS): draw(ODD)}
    data = written(value)
    if draw(st.integers(0, 3)) == 0 and data:
        where = draw(st.integers(0, len(data) - 1))
        data = data[:where] + draw(st.binary(max_size=4)) + data[where + draw(st.integers(0, 4)) :]
    return data


def numbers(schema: dict[str, Any]) -> st.SearchStrategy[float]:
    low = schema.get("minimum", schema.get("exclusiveMinimum", 0))
    high = schema["maximum"]
    if schema["type"] == "integer":
        return st.one_of(st.sampled_from([low, high]), st.integers(low, high))
    least = math.nextafter(low, math.inf) if "exclusiveMinimum" in schema else low
    return st.one_of(st.sampled_from([least, high]), st.floats(least, high))


def within(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Values at and between the bounds of a schema."""
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if "const" in schema:
        return st.just(schema["const"])
    kind = schema["type"]
    if kind == "boolean":
        return st.booleans()
    if kind == "string":
        if "pattern" in schema:
            return st.from_regex(schema["pattern"], fullmatch=True)
        return WORDS.map(lambda text: text[: schema["maxLength"]])
    if kind == "array":
        least, most = schema.get("minItems", 0), min(schema["maxItems"], 12)
        return st.lists(within(schema["items"]), min_size=least, max_size=max(least, most))
    if kind == "object":
        fields = {name: within(field) for name, field in schema["properties"].items()}
        needed = {name: fields.pop(name) for name in schema.get("required", [])}
        return st.fixed_dictionaries(needed, optional=fields)
    return numbers(schema)


def bounded(value: Any, limit: float = 1e10) -> bool:
    if isinstance(value, dict):
        return all(map(bounded, value.values()))
    if isinstance(value, list):
        return all(map(bounded, value))
    return not isinstance(value, float) or abs(value) <= limit


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_damaged_payloads_are_bounded_or_refused(
    model: type[CameraQuery] | type[Decision], hostile: Hostile
) -> None:
    refusals = []

    @settings(max_examples=hostile.examples(40))
    @given(damaged(model))
    def taken_or_refused(data: bytes) -> None:
        hostile.count("payloads")
        try:
            payload = model.parse(data)
        except PayloadError as error:
            refusals.append(str(error))
        else:
            assert bounded(payload.model_dump())
            assert model.parse(payload.model_dump_json().encode()) == payload

    taken_or_refused()
    assert all(text.isprintable() and 0 < len(text) < 1000 for text in refusals)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        b"null",
        b"[" * 1_000_000,
        b"[" * 100 + b"]" * 100,
        b'{"a":' * 100_000,
        b"[" + b"0," * 1_999_000 + b"0]",
        b'{"x":"' + b"x" * MOST_JSON + b'"}',
        b"9" * 1_000_000,
    ],
    ids=range(9),
)
def test_large_and_deep_texts_are_refused(
    model: type[CameraQuery] | type[Decision], data: bytes, hostile: Hostile
) -> None:
    hostile.count("payloads")
    with pytest.raises(PayloadError) as refused:
        model.parse(data)
    assert len(str(refused.value)) < 1000


@pytest.mark.parametrize("count", [361, 100_000, 2**40, 10**400])
def test_a_map_of_too_many_sectors_is_refused(count: int, hostile: Hostile) -> None:
    hostile.count("payloads")
    value = json.loads(EXAMPLES[Learned].model_dump_json())
    value["fields"]["sectors"] = count
    with pytest.raises(PayloadError, match=r"fields\.sectors"):
        Learned.parse(json.dumps(value).encode())


@pytest.mark.parametrize("name", ["activities", "features", "hypotheses", "sequence_ahead"])
@pytest.mark.parametrize("item", ["x", 1e300, None, {}])
def test_long_lists_of_nonsense_end_at_the_first(
    name: str, item: float | str | None, hostile: Hostile
) -> None:
    hostile.count("payloads")
    value = json.loads(EXAMPLES[Decision].model_dump_json())
    value[name] = [item] * 200_000
    with pytest.raises(PayloadError, match=name):
        Decision.parse(json.dumps(value).encode()[:MOST_JSON])


def show_everything(watched: RobotState, now: float) -> None:
    """All that is drawn and said of a robot; drawings are well-formed, texts harmless."""
    for name, part in Board().parts(watched, {watched.robot: watched}, now).items():
        if not isinstance(part, str):
            continue
        assert len(part) < 20_000_000
        if "@" in name:
            assert part.isprintable()
            continue
        for element in ElementTree.fromstring(f"<g>{part}</g>").iter():
            assert element.tag not in ("script", "img", "foreignObject", "a")
            assert not any(name.startswith("on") for name in element.attrib)
            assert (element.text or "").isprintable()
    screen = io.StringIO()
    console = Console(file=screen, width=80, height=24, force_terminal=True)
    console.print(render(watched, now))
    picture = screen.getvalue()
    assert "\x1b]" not in picture  # neither titles nor links
    assert "\x1b[2J" not in picture
    # 24 lines, and those of a name that is as wide as a line
    assert picture.count("\n") < 40


def arrival(key: tuple[str, str], data: bytes) -> Arrival:
    side, leaf = key
    stamp = Stamp(sequence=2**32 - 1, time=1e10)
    return Arrival(side, leaf, data, "application/json", stamp, BEGIN)


def test_whatever_keeps_to_the_bounds_is_shown_and_recorded(
    hostile: Hostile, tmp_path: Path
) -> None:
    payloads = [st.tuples(st.just(key), within(schema_of(PAYLOADS[key]))) for key in JSON_KEYS]
    moments = st.lists(st.one_of(payloads), min_size=1, max_size=4)

    @settings(max_examples=hostile.examples(30))
    @given(moments)
    def shown(samples: Sequence[tuple[tuple[str, str], dict[str, float | object | str]]]) -> None:
        watched = RobotState("khepera")
        events: list[Event] = [Presence(EMULATOR, True, BEGIN), Presence(CONTROLLER, True, BEGIN)]
        events += [arrival(key, written(value)) for key, value in samples]
        hostile.count("payloads", len(samples))
        with Recorder(tmp_path / "x.mcap", "khepera") as recorder:
            for event in events:
                watched.take(event)
                recorder.write(event)
        assert not watched.not_taken.refused
        watched.see(a_picture(), 0.0)
        show_everything(watched, 10.0)
        assert len(read_recording(tmp_path / "x.mcap")[1]) == len(events)

    shown()


def test_whatever_comes_on_any_key_ends_nobody(hostile: Hostile, tmp_path: Path) -> None:
    keys = [(key.side, key.leaf) for key in KEYS if key.published]

    def of(key: tuple[str, str]) -> st.SearchStrategy[tuple[tuple[str, str], bytes]]:
        texts = damaged(PAYLOADS[key]) if key in PAYLOADS else st.binary(max_size=100)
        return st.tuples(st.just(key), st.one_of(texts, st.binary(max_size=20)))

    @settings(max_examples=hostile.examples(30))
    @given(st.lists(st.sampled_from(keys).flatmap(of), min_size=1, max_size=4))
    def survived(samples: list[tuple[tuple[str, str], bytes]]) -> None:
        watched = RobotState("khepera")
        hostile.count("payloads", len(samples))
        with Recorder(tmp_path / "x.mcap", "khepera") as recorder:
            for key, data in samples:
                watched.take(arrival(key, data))
                recorder.write(arrival(key, data))
        show_everything(watched, 10.0)
        with contextlib.suppress(ValueError):
            read_recording(tmp_path / "x.mcap")

    survived()
