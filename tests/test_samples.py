"""Samples as they travel: keys, payloads and attachments, to the byte."""

from typing import Any, cast

import zenoh
from khepera_protocol.zenoh.keys import (
    CONTROLLER,
    CONTROLLER_ALIVE,
    EMULATOR,
    KEYS,
    LINK,
    STOP,
    Key,
)
from khepera_protocol.zenoh.payloads import Pose
from khepera_protocol.zenoh.sample import Content, SampleWriter, json_content

from macor_hil.telemetry.examples import EXAMPLES


class Session:
    """Gives time stamps and nothing else."""

    def new_timestamp(self) -> str:
        return "now"


class Query:
    """A query; holds the answer to it."""

    def __init__(self, parameters: str = "") -> None:
        self.parameters = parameters
        self.answer: Any = None

    def reply(self, *answer: object, **more: object) -> None:
        self.answer = answer, more


def writer_of(key: Key) -> SampleWriter:
    return SampleWriter(cast(zenoh.Session, Session()), key, "r1")


def as_query(query: Query) -> zenoh.Query:
    return cast(zenoh.Query, query)


_EMULATOR = ("camera", "truth", "reset", "arena", "push", "faults", "wire", "alive")
_CONTROLLER = ("frame", "decision", "map", "state", "link", "stop", "steer")


def test_keys_of_a_robot() -> None:
    assert [key.of("r1") for key in KEYS] == [
        *(f"khepera/r1/{leaf}" for leaf in _EMULATOR),
        *(f"macor/r1/{leaf}" for leaf in _CONTROLLER),
        "macor/r1/alive",
    ]
    assert CONTROLLER_ALIVE.pattern == "macor/<robot>/alive"


def test_a_payload_is_json_with_the_name_of_its_schema() -> None:
    data, encoding = json_content(EMULATOR, Pose(x=0.5, y=-1.0, heading=0.0))
    assert data == b'{"x":0.5,"y":-1.0,"heading":0.0}'
    assert str(encoding) == "application/json;khepera.Pose"
    (link,) = (example for kind, example in EXAMPLES.items() if kind is LINK.payload)
    assert (str(json_content(CONTROLLER, link).encoding),) == LINK.encodings


def test_samples_are_numbered_and_stamped() -> None:
    writer = writer_of(LINK)
    content = Content(b"{}", zenoh.Encoding.APPLICATION_JSON)
    assert writer.name == "macor/r1/link"
    stamps = [writer.sample(content, time).stamp for time in (0.25, 7.0)]
    assert stamps == ['{"sequence":0,"time":0.25}', '{"sequence":1,"time":7.0}']


def test_a_query_gets_the_sample_as_it_is() -> None:
    writer, query = writer_of(LINK), Query()
    sample = writer.sample(Content(b"\xff", zenoh.Encoding.IMAGE_JPEG), 1.5)
    writer.reply(as_query(query), sample)
    assert query.answer[0] == ("macor/r1/link", b"\xff")
    assert query.answer[1] == {
        "encoding": zenoh.Encoding.IMAGE_JPEG,
        "attachment": '{"sequence":0,"time":1.5}',
        "timestamp": "now",
    }


def test_only_keys_of_json_describe_themselves() -> None:
    described, plain, picture = Query("describe"), Query(), Query("describe")
    assert writer_of(LINK).describe(as_query(described))
    assert str(described.answer[1]["encoding"]) == "application/schema+json"
    assert not writer_of(LINK).describe(as_query(plain))
    assert not writer_of(STOP).describe(as_query(picture))
    assert plain.answer is picture.answer is None
