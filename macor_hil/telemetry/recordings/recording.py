"""Recordings: the events of a robot as an MCAP file, which other tools open, too.

Samples are kept as they came, under their keys as topics: JSON with its schema, pictures as
`foxglove.CompressedImage`. A message's log time is when it came, its publish time is the stamp's,
on the robot's clock. Beside them stands what Foxglove draws by itself; see `telemetry.foxglove`.

Chunks are small and go to the file at once: a recorder that is killed loses the last one, and what
was written before can be read. Needs the extra 'recording'.
"""

import json
import logging
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from google.protobuf.message import Message as Protobuf
from khepera_protocol.zenoh.keys import ALIVE, KEYS_BY_PLACE, Key, schema_name
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Stamp
from khepera_protocol.zenoh.schema import schema_of
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from macor_hil.errors import RecordingError
from macor_hil.files import MIB, InputError, open_regular
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.foxglove import drawings
from macor_hil.telemetry.recordings.mcap_file import Damage, Message, read_messages

_CHUNK: Final = 16 * 1024
"""Bytes in a chunk at most, but for a larger sample: what a killed recorder loses."""

_LIBRARY: Final = "macor-hil"
_SECOND: Final = 1_000_000_000

_log = logging.getLogger(__name__)

_TOPIC: Final = re.compile(r"(khepera|macor)/([A-Za-z0-9_.-]{1,64})/(\w{1,64})", re.ASCII)
_FORMAT: Final = re.compile(r"[a-z0-9.+-]{1,20}")

_EVENT: Final = 1000
"""Bytes that an event takes beside its data, at most."""

_ROOM: Final = 64 * MIB
_RATIO: Final = 256
"""A recording has as much data as _ROOM and _RATIO times its file, or it was made to do harm."""

_MOST_MEMORY: Final = 2048 * MIB


class Alive(Payload):
    """The presence of a side; in recordings only, for its liveliness token."""

    alive: bool


class Recorder:
    """A writer of events to a file; use as a context.

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
                self._json(ALIVE[event.side], Alive(alive=event.alive), event.received)
            else:
                self._sample(event)
                self.samples += 1
            for topic, message in drawings(event):
                self._protobuf(f"foxglove/{self._robot}/{topic}", message, event.received)
            self._file.flush()  # what is whole is the system's, whatever becomes of this process
        except OSError as error:
            raise self._failed(error) from None

    def _sample(self, arrival: Arrival) -> None:
        key = KEYS_BY_PLACE[arrival.side, arrival.leaf]
        topic = key.of(self._robot)
        if key.payload:
            channel = self._json_channel(topic, arrival.side, key.payload)
            data = arrival.data
        else:
            picture = CompressedImage(
                frame_id="camera", data=arrival.data, format=arrival.encoding.partition("/")[2]
            )
            picture.timestamp.FromNanoseconds(arrival.received)
            channel = self._protobuf_channel(topic, picture)
            data = picture.SerializeToString()
        self._add(channel, data, arrival.received, arrival.stamp)

    def _json(self, key: Key, payload: Payload, received: int) -> None:
        channel = self._json_channel(key.of(self._robot), key.side, type(payload))
        self._add(channel, payload.model_dump_json().encode(), received, None)

    def _protobuf(self, topic: str, message: Protobuf, received: int) -> None:
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
                schema = json.dumps(schema_of(payload)).encode()
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema)
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[name]
            )
        return self._channels[topic]

    def _protobuf_channel(self, topic: str, message: Protobuf) -> int:
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


def play_recording(path: Path) -> tuple[str, Iterator[Event]]:
    """Read a recording while it is used, as far as it goes; what is left out is told.

    Returns:
        The robot's name, and its events in their order.

    Raises:
        RecordingError: there is no such file, or nothing of a robot in it.
    """
    events = _events(path)
    first = next(events, None)
    if first is None:
        raise RecordingError(f"{path} is no recording of a robot: no sample of one is in it")
    robot, event = first
    return robot, chain([event], (event for name, event in events if name == robot))


def read_recording(path: Path, most: int = _MOST_MEMORY) -> tuple[str, list[Event]]:
    """Read a recording into memory, as far as it goes and there is room; what is left out is told.

    Args:
        path: the file.
        most: bytes that the events may have.

    Returns:
        The robot's name, and its events in their order.

    Raises:
        RecordingError: there is no such file, or nothing of a robot in it.
    """
    robot, played = play_recording(path)
    events = list[Event]()
    for event in played:
        most -= _cost(event)
        if most < 0:
            _log.warning("%s: there is room for its first %d events only", path, len(events))
            break
        events.append(event)
    return robot, events


class _LeftOut:
    """A count of what of a recording cannot be used."""

    def __init__(self) -> None:
        self._count = 0
        self._first = ""

    def add(self, what: str) -> None:
        self._count += 1
        self._first = self._first or what

    def tell(self, path: Path) -> None:
        if self._count:
            more = f", and {self._count - 1:,} more" if self._count > 1 else ""
            _log.warning("%s: left out %s%s", path, self._first, more)


def _events(path: Path) -> Iterator[tuple[str, Event]]:
    """Read the events, with the names of their robots.

    Raises:
        RecordingError: the file cannot be read.
    """
    left_out = _LeftOut()
    try:
        with open_regular(path) as file:
            room = _ROOM + _RATIO * os.fstat(file.fileno()).st_size
            for message in read_messages(file):
                if isinstance(message, Damage):
                    left_out.add(f"a part at byte {message.place:,}: {message.reason}")
                    continue
                topic = _TOPIC.fullmatch(message.topic)
                room -= len(message.data) + (_EVENT if topic else 0)
                if room < 0:
                    left_out.add("the rest: it expands to far more than a recording does")
                    return
                try:
                    event = _event(topic[1], topic[3], message) if topic else None
                except ValueError:
                    left_out.add(f"a sample of {message.topic}, which cannot be read")
                    continue
                if topic and event:
                    yield topic[2], event
    except InputError as error:
        raise RecordingError(f"cannot read {path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from None
    finally:
        left_out.tell(path)


def _event(side: str, leaf: str, message: Message) -> Event | None:
    """Return the event of a message; None for messages of other kinds.

    Raises:
        ValueError: it cannot be read.
    """
    key = KEYS_BY_PLACE.get((side, leaf))
    if key is None:
        return None
    if key == ALIVE[side]:
        alive = Alive.parse(message.data).alive
        return Presence(side, alive, message.log_time)
    if key.payload:
        (encoding,), data = key.encodings, message.data
    else:
        data, encoding = _picture(message.data)
    stamp = Stamp(sequence=message.sequence, time=message.publish_time / _SECOND)
    return Arrival(side, leaf, data, encoding, stamp, message.log_time)


def _picture(data: bytes) -> tuple[bytes, str]:
    """Return an encoded picture and its media type.

    Raises:
        ValueError: it is none.
    """
    try:
        picture = CompressedImage.FromString(data)
    except DecodeError:
        raise ValueError("it is no picture") from None
    if not _FORMAT.fullmatch(picture.format):
        raise ValueError("it is a picture of an odd format")
    return picture.data, f"image/{picture.format}"


def _cost(event: Event) -> int:
    return _EVENT + (len(event.data) if isinstance(event, Arrival) else 0)
