"""Events of a robot as messages on topics: what recordings hold, and what live viewers get.

Samples stay as they came, under their keys as topics: JSON with its schema, pictures as
`foxglove.CompressedImage`. Beside them stands what Foxglove draws by itself (`viewers.scene`).
Times only grow, whatever clocks do.
"""

import json
from collections.abc import Iterator
from typing import Final, NamedTuple

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import Message as Protobuf
from khepera_protocol.zenoh.keys import ALIVE, KEYS, KEYS_BY_PLACE, Key, schema_name
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Stamp
from khepera_protocol.zenoh.schema import schema_of
from mcap_protobuf.schema import build_file_descriptor_set

from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.viewers.scene import SCENES, Scene

_SECOND: Final = 1_000_000_000


class Alive(Payload):
    """The presence of a side: in recordings and viewers only, for its liveliness token."""

    alive: bool


class Form(NamedTuple):
    """The form of a topic's messages: their encoding, and the name and text of their schema."""

    encoding: str
    name: str
    schema_encoding: str
    schema: bytes


class Told(NamedTuple):
    """A message on a topic.

    Attributes:
        topic: where.
        form: of all messages there.
        data: its payload.
        time: when it came, ns since 1970.
        published: stamp on the robot's clock, ns; the same as `time` without one.
        sequence: its number; 0 without one.
    """

    topic: str
    form: Form
    data: bytes
    time: int
    published: int
    sequence: int


class Topics:
    """Turns the events of one robot, in their order, into messages.

    Args:
        robot: its name in the keys.
    """

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._scene = Scene()
        self._forms: dict[str, Form] = {}
        self._now = 0

    def all(self) -> Iterator[tuple[str, Form]]:
        """Yield all topics that there may be messages on, and the form of these."""
        for key in KEYS:
            if key in ALIVE.values():
                yield key.of(self._robot), self._json(key, Alive)
            elif key.payload and not key.acts:
                yield key.of(self._robot), self._json(key, key.payload)
            elif key.published:
                yield key.of(self._robot), self._protobuf(CompressedImage())
        for leaf, kind in SCENES.items():
            yield f"foxglove/{self._robot}/{leaf}", self._protobuf(kind())

    def tell(self, event: Event) -> Iterator[Told]:
        """Yield the messages of an event: its sample, and what is drawn of it."""
        # threads of Zenoh pass events on, and one may overtake another
        self._now = max(self._now, event.received)
        if isinstance(event, Presence):
            key, payload = ALIVE[event.side], Alive(alive=event.alive)
            yield self._told(
                key.of(self._robot),
                self._json(key, Alive),
                payload.model_dump_json().encode(),
            )
        else:
            yield self._sample(event)
        for leaf, message in self._scene.draw(event, self._now):
            topic = f"foxglove/{self._robot}/{leaf}"
            yield self._told(topic, self._protobuf(message), message.SerializeToString())

    def _sample(self, arrival: Arrival) -> Told:
        key = KEYS_BY_PLACE[arrival.side, arrival.leaf]
        topic = key.of(self._robot)
        if key.payload:
            return self._told(topic, self._json(key, key.payload), arrival.data, arrival.stamp)
        picture = CompressedImage(
            frame_id="camera", data=arrival.data, format=arrival.encoding.partition("/")[2]
        )
        picture.timestamp.FromNanoseconds(self._now)
        form = self._protobuf(picture)
        return self._told(topic, form, picture.SerializeToString(), arrival.stamp)

    def _told(self, topic: str, form: Form, data: bytes, stamp: Stamp | None = None) -> Told:
        published = max(0, round(stamp.time * _SECOND)) if stamp else self._now
        return Told(topic, form, data, self._now, published, stamp.sequence if stamp else 0)

    def _json(self, key: Key, payload: type[Payload]) -> Form:
        name = schema_name(key.side, payload)
        if name not in self._forms:
            schema = json.dumps(schema_of(payload)).encode()
            self._forms[name] = Form("json", name, "jsonschema", schema)
        return self._forms[name]

    def _protobuf(self, message: Protobuf) -> Form:
        name = message.DESCRIPTOR.full_name
        if name not in self._forms:
            schema = build_file_descriptor_set(type(message)).SerializeToString()
            self._forms[name] = Form("protobuf", name, "protobuf", schema)
        return self._forms[name]
