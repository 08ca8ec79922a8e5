"""Recordings: what was told of a robot, as an MCAP file that other tools open, too.

Samples are kept as they came, under their keys as topics: JSON with its schema, pictures as
`foxglove.CompressedImage`. A message's log time is when it came, its publish time is the stamp's,
on the robot's clock. Beside them stands what Foxglove draws by itself; see `telemetry.foxglove`.

Chunks are small and go to the file at once: a recorder that is killed loses the last one, and what
was written before can be read. Needs the extra 'recording'.
"""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError, Message
from mcap.exceptions import McapError
from mcap.records import Channel, Schema
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from macor_hil.errors import RecordingError
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.foxglove import drawings
from macor_hil.telemetry.keys import ALIVE, KEYS, PAYLOADS
from protocol.keys import schema_name
from protocol.side_channel import Payload, Stamp

_CHUNK: Final = 16 * 1024
"""Bytes in a chunk at most, but for a larger sample: what a killed recorder loses."""

_LIBRARY: Final = "macor-hil"
_SECOND: Final = 1_000_000_000


class Alive(Payload):
    """Whether a side is there; in recordings only, for its liveliness token."""

    alive: bool


class Recorder:
    """Writes events to a file; use as a context.

    Args:
        path: the file; one that is there is replaced.
        robot: the robot's name in the keys.

    Attributes:
        samples: samples written.

    Raises:
        RecordingError: the file cannot be written.
    """

    def __init__(self, path: Path, robot: str) -> None:
        self.samples = 0
        self._path = path
        self._robot = robot
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise self._failed(error) from None
        # not compressed: JPEG pictures are already, and a chunk costs the less
        self._writer = Writer(
            self._file,
            chunk_size=_CHUNK,
            compression=CompressionType.NONE,
        )
        try:
            self._writer.start(profile="", library=_LIBRARY)
        except OSError as error:
            self._close()
            raise self._failed(error) from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if isinstance(error, RecordingError):
            self._close()  # what was written stays; there is no room for an index
            return
        try:
            self._writer.finish()
            self._file.close()
        except OSError as failure:
            self._close()
            raise self._failed(failure) from None

    def write(self, event: Event) -> None:
        """Write an event down.

        Raises:
            RecordingError: the disk is full, or gone.
        """
        try:
            if isinstance(event, Presence):
                self._json(event.side, ALIVE, Alive(alive=event.alive), event.received)
            else:
                self._sample(event)
                self.samples += 1
            for topic, message in drawings(event):
                self._protobuf(f"foxglove/{self._robot}/{topic}", message, event.received)
            self._file.flush()  # what is whole is the system's, whatever becomes of this process
        except OSError as error:
            raise self._failed(error) from None

    def _sample(self, arrival: Arrival) -> None:
        payload = PAYLOADS.get((arrival.side, arrival.leaf))
        topic = f"{arrival.side}/{self._robot}/{arrival.leaf}"
        if payload:
            channel = self._json_channel(topic, arrival.side, payload)
            data = arrival.data
        else:
            picture = CompressedImage(
                frame_id="camera", data=arrival.data, format=arrival.encoding.partition("/")[2]
            )
            picture.timestamp.FromNanoseconds(arrival.received)
            channel = self._protobuf_channel(topic, picture)
            data = picture.SerializeToString()
        self._add(channel, data, arrival.received, arrival.stamp)

    def _json(self, side: str, leaf: str, payload: Payload, received: int) -> None:
        channel = self._json_channel(f"{side}/{self._robot}/{leaf}", side, type(payload))
        self._add(channel, payload.model_dump_json().encode(), received, None)

    def _protobuf(self, topic: str, message: Message, received: int) -> None:
        channel = self._protobuf_channel(topic, message)
        self._add(channel, message.SerializeToString(), received, None)

    def _add(self, channel: int, data: bytes, received: int, stamp: Stamp | None) -> None:
        self._writer.add_message(
            channel,
            log_time=received,
            data=data,
            publish_time=max(0, round(stamp.time * _SECOND)) if stamp else received,
            sequence=stamp.sequence if stamp else 0,
        )

    def _json_channel(self, topic: str, side: str, payload: type[Payload]) -> int:
        if topic not in self._channels:
            name = schema_name(side, payload)
            if name not in self._schemas:
                schema = json.dumps(payload.model_json_schema()).encode()
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema)
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[name]
            )
        return self._channels[topic]

    def _protobuf_channel(self, topic: str, message: Message) -> int:
        if topic not in self._channels:
            name = message.DESCRIPTOR.full_name
            if name not in self._schemas:
                self._schemas[name] = register_schema(self._writer, type(message))
            self._channels[topic] = self._writer.register_channel(
                topic, "protobuf", self._schemas[name]
            )
        return self._channels[topic]

    def _close(self) -> None:
        with suppress(OSError):  # there is no room for what is left
            self._file.close()

    def _failed(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot record to {self._path}: {error.strerror}")


def read_recording(path: Path) -> tuple[str, list[Event]]:
    """Read a recording, as far as it goes: one that was cut off ends where it was.

    Returns:
        The robot's name, and the events in their order.

    Raises:
        RecordingError: there is no such file, or nothing of a robot in it.
    """
    robot, events = "", list[Event]()
    try:
        for topic, event in _events(path):
            robot = robot or topic.split("/")[1]
            events.append(event)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from None
    if not events:
        raise RecordingError(f"{path} is no recording of a robot: no sample of one is in it")
    return robot, events


def _events(path: Path) -> Iterator[tuple[str, Event]]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    with path.open("rb") as file:
        records: Iterator[Any] = StreamReader(file).records
        while True:
            try:
                record = next(records, None)
            except (McapError, ValueError, MemoryError):
                return  # cut off, or damaged from here on
            match record:
                case None:
                    return
                case Schema():
                    schemas[record.id] = record
                case Channel():
                    channels[record.id] = record
                case McapMessage():
                    channel = channels[record.channel_id]
                    event = _event(channel.topic, schemas.get(channel.schema_id), record)
                    if event is not None:
                        yield channel.topic, event


def _event(topic: str, schema: Schema | None, message: McapMessage) -> Event | None:
    side, leaf = topic.partition("/")[0], topic.rpartition("/")[2]
    if not any(key.side == side and key.leaf == leaf for key in KEYS):
        return None
    if leaf == ALIVE:
        alive = Alive.model_validate_json(message.data).alive
        return Presence(side, alive, message.log_time)
    data, encoding = message.data, f"application/json;{schema.name if schema else ''}"
    if (side, leaf) not in PAYLOADS:
        try:
            picture = CompressedImage.FromString(data)
        except DecodeError:
            return None
        data, encoding = picture.data, f"image/{picture.format}"
    stamp = Stamp(sequence=message.sequence, time=message.publish_time / _SECOND)
    return Arrival(side, leaf, data, encoding, stamp, message.log_time)
