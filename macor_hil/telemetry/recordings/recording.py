"""Recordings: the events of a robot as an MCAP file, which other tools open, too.

They are kept as `telemetry.viewers.topics` tells them. A message's log time is when it came, its
publish time is the stamp's, on the robot's clock.

Chunks are small and go to the file at once: a recorder that is killed loses the last one, and what
was written before can be read. Needs the extra 'recording'.
"""

import logging
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, NamedTuple, Self

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from khepera_protocol.zenoh.keys import ALIVE, KEYS_BY_PLACE
from khepera_protocol.zenoh.payloads import Stamp
from mcap.writer import CompressionType, Writer

from macor_hil.errors import RecordingError
from macor_hil.files import MIB, InputError, open_regular
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.mcap_file import (
    Damage,
    Message,
    Topics,
    read_messages,
    read_on,
    read_record,
)
from macor_hil.telemetry.recordings.mcap_index import Index, latest_before, read_index
from macor_hil.telemetry.viewers.topics import Alive, Told
from macor_hil.telemetry.viewers.topics import Topics as ViewerTopics

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
        self._topics = ViewerTopics(robot)
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
            for told in self._topics.tell(event):
                self._writer.add_message(
                    self._channel(told),
                    log_time=told.time,
                    data=told.data,
                    publish_time=told.published,
                    sequence=told.sequence,
                )
            self._file.flush()  # what is whole is the system's, whatever becomes of this process
        except OSError as error:
            raise self._failed(error) from None
        self.samples += isinstance(event, Arrival)

    def _channel(self, told: Told) -> int:
        if told.topic not in self._channels:
            form = told.form
            if form.name not in self._schemas:
                self._schemas[form.name] = self._writer.register_schema(
                    form.name, form.schema_encoding, form.schema
                )
            self._channels[told.topic] = self._writer.register_channel(
                told.topic, form.encoding, self._schemas[form.name]
            )
        return self._channels[told.topic]

    def _close(self) -> None:
        with suppress(OSError):  # there is no room for what is left
            self._file.close()

    def _failed(self, error: OSError) -> RecordingError:
        return RecordingError(f"cannot record to {self._path}: {error.strerror}")


def play_recording(
    path: Path, begin: float = 0.0, *, tell: bool = True
) -> tuple[str, Iterator[Event]]:
    """Read a recording while it is used, as far as it goes.

    One that is begun later begins with the latest event of each kind before that: what was so then.
    It is found by the index at the end of the file; without one, the file is read to there.

    Args:
        path: the file.
        begin: seconds after its first message at which to begin.
        tell: whether a warning says what is left out.

    Returns:
        The robot's name, and its events in their order.

    Raises:
        RecordingError: there is no such file, or nothing of a robot in it.
    """
    events = _events(path, begin, tell=tell)
    first = next(events, None)
    if first is None:
        raise RecordingError(f"{path} is not a recording of a robot: no sample of one is in it")
    robot, event = first
    return robot, chain([event], (event for name, event in events if name == robot))


def has_index(path: Path) -> bool:
    """Return True if a recording can be played from its middle without reading what is before.

    Raises:
        RecordingError: there is no such file.
    """
    try:
        with open_regular(path) as file:
            return read_index(file) is not None
    except InputError as error:
        raise RecordingError(f"cannot read {path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from None


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


class _Source(NamedTuple):
    """The robot and the key that a topic is of."""

    side: str
    robot: str
    leaf: str


@lru_cache(maxsize=1000)
def _source(topic: str) -> _Source | None:
    """Return what a topic is of; None for topics of viewers, and of strangers."""
    found = _TOPIC.fullmatch(topic)
    return _Source(*found.groups()) if found else None


def _events(path: Path, begin: float, *, tell: bool) -> Iterator[tuple[str, Event]]:
    """Read the events from a time on, with the names of their robots.

    Raises:
        RecordingError: the file cannot be read.
    """
    left_out = _LeftOut()
    try:
        with open_regular(path) as file:
            room = _ROOM + _RATIO * os.fstat(file.fileno()).st_size
            for message in _messages(file, round(begin * _SECOND)):
                if isinstance(message, Damage):
                    left_out.add(f"a part at byte {message.place:,}: {message.reason}")
                    continue
                source = _source(message.topic)
                room -= len(message.data) + (_EVENT if source else 0)
                if room < 0:
                    left_out.add("the rest: it expands to far more than a recording does")
                    return
                try:
                    event = _event(source, message) if source else None
                except ValueError:
                    left_out.add(f"a sample of {message.topic}, which cannot be read")
                    continue
                if source and event:
                    yield source.robot, event
    except InputError as error:
        raise RecordingError(f"cannot read {path}: {error}") from None
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from None
    finally:
        if tell:
            left_out.tell(path)


def _messages(file: BinaryIO, begin: int) -> Iterator[Message | Damage]:
    """Read messages from a time after the first one (ns) on, the latest before that first."""
    if begin <= 0:
        yield from read_messages(file)
        return
    index = read_index(file)
    if index is None:
        file.seek(0)
        yield from _read_to(read_messages(file), begin)
        return
    time = index.begin + begin
    yield from _latest(file, index, time)
    if (place := index.place_of(time)) is not None:
        file.seek(place)
        for message in read_on(file, Topics(index.topics)):
            if isinstance(message, Damage) or message.log_time >= time:
                yield message


def _latest(file: BinaryIO, index: Index, time: int) -> Iterator[Message]:
    """Read the latest message of each topic before a time, in the order of their times."""
    found: dict[str, Message] = {}
    wanted = {number for number, topic in index.topics.items() if _source(topic)}
    for place in {place for _, place in latest_before(file, index, time, wanted).values()}:
        file.seek(place)
        for message in read_record(file, Topics(index.topics)):
            if message.log_time < time and _source(message.topic):
                last = found.get(message.topic)
                if last is None or message.log_time >= last.log_time:
                    found[message.topic] = message
    yield from sorted(found.values(), key=lambda message: message.log_time)


def _read_to(messages: Iterable[Message | Damage], begin: int) -> Iterator[Message | Damage]:
    """Read from the beginning to a time after it, and keep the latest message of each topic."""
    latest: dict[str, Message] = {}
    time: int | None = None
    for message in messages:
        if isinstance(message, Damage):
            yield message
            continue
        time = message.log_time + begin if time is None else time
        if message.log_time < time:
            latest[message.topic] = message
            continue
        yield from sorted(latest.values(), key=lambda each: each.log_time)
        latest.clear()
        yield message
    yield from sorted(latest.values(), key=lambda each: each.log_time)


def _event(source: _Source, message: Message) -> Event | None:
    """Return the event of a message; None for messages of other kinds.

    Raises:
        ValueError: it cannot be read.
    """
    side, _, leaf = source
    key = KEYS_BY_PLACE.get((side, leaf))
    if key is None:
        return None
    if leaf == ALIVE[side].leaf:
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
