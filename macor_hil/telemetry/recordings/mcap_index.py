"""The index at the end of an MCAP file: which part of it holds which time.

Nothing in it is believed without a bound: lengths and places lie inside the file, a time only tells
where to begin to read, and whatever is read there is checked as everything else
(`recordings.mcap_file`). A file without a whole index, such as that of a killed recorder, has none.
"""

import os
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import BinaryIO, Final

from macor_hil.telemetry.recordings.mcap_file import (
    CHANNEL,
    CHUNK_INDEX,
    FOOTER,
    HEAD,
    MAGIC,
    MESSAGE_INDEX,
    MOST,
    DamageError,
    Parts,
)

_FOOTER: Final = struct.Struct("<QQI")
_TAIL: Final = HEAD.size + _FOOTER.size + len(MAGIC)
_BOUNDS: Final = struct.Struct("<QQQQI")
_OFFSET: Final = struct.Struct("<HQ")
_ENTRY: Final = struct.Struct("<QQ")

_MOST_CHANNELS: Final = 10_000


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk of a file.

    Attributes:
        start: time of its first message, ns.
        end: time of its last one, ns.
        place: byte of the file where it begins.
    """

    start: int
    end: int
    place: int
    _channels: bytes

    @property
    def channels(self) -> dict[int, int]:
        """Places of the indexes of its messages, by the numbers of their channels."""
        return dict(_OFFSET.iter_unpack(self._channels))


@dataclass(frozen=True, slots=True)
class Index:
    """The index of a file.

    Attributes:
        topics: of channels, by their numbers.
        chunks: in the order of the file.
    """

    topics: dict[int, str]
    chunks: list[Chunk]

    @property
    def begin(self) -> int:
        """Time of the first message, ns."""
        return min(chunk.start for chunk in self.chunks)

    @property
    def end(self) -> int:
        """Time of the last message, ns."""
        return max(chunk.end for chunk in self.chunks)

    def place_of(self, time: int) -> int | None:
        """Return the byte from which on all messages of a time and later are; None: none are."""
        return min((chunk.place for chunk in self.chunks if chunk.end >= time), default=None)


def read_index(file: BinaryIO) -> Index | None:
    """Return the index of a file; None where it has none, or one that cannot be true."""
    try:
        return _read(file)
    except (DamageError, OSError, ValueError, struct.error):
        return None


def latest_before(
    file: BinaryIO, index: Index, time: int, wanted: Iterable[int]
) -> dict[int, tuple[int, int]]:
    """Return the latest message of channels before a time: its time, and its chunk's place.

    Args:
        file: the file.
        index: its index.
        time: ns.
        wanted: numbers of channels.
    """
    latest: dict[int, tuple[int, int]] = {}
    missing = set(wanted)
    for chunk in reversed(index.chunks):
        if not missing:
            break
        if chunk.start >= time:
            continue
        places = chunk.channels
        for number in missing & places.keys():
            when = _last_time(file, places[number], number, time)
            if when is not None:
                latest[number] = when, chunk.place
        missing -= latest.keys()
    return latest


def _last_time(file: BinaryIO, place: int, number: int, time: int) -> int | None:
    """Return the last time before another one in the index of a chunk's channel."""
    try:
        opcode, parts = _record(file, place)
        if opcode != MESSAGE_INDEX or parts.number(2) != number:
            return None
        entries = list(_ENTRY.iter_unpack(parts.take(parts.number(4))))
    except (DamageError, struct.error):
        return None
    return max((when for when, _ in entries if when < time), default=None)


def _read(file: BinaryIO) -> Index | None:
    size = file.seek(0, os.SEEK_END)
    if size < _TAIL:
        return None
    file.seek(size - _TAIL)
    tail = file.read(_TAIL)
    opcode, length = HEAD.unpack_from(tail)
    if not tail.endswith(MAGIC) or opcode != FOOTER or length != _FOOTER.size:
        return None
    begin, _, _ = _FOOTER.unpack_from(tail, HEAD.size)
    end = size - _TAIL
    if not 0 < begin <= end or end - begin > MOST:
        return None
    file.seek(begin)
    summary = file.read(end - begin)
    topics: dict[int, str] = {}
    chunks: list[Chunk] = []
    at = 0
    while at < len(summary):
        opcode, length = HEAD.unpack_from(summary, at)
        at += HEAD.size
        if opcode == CHANNEL and len(topics) < _MOST_CHANNELS:
            record = Parts(summary[at : at + length])
            number, _ = record.number(2), record.number(2)
            topics[number] = record.text()
        elif opcode == CHUNK_INDEX:
            chunks.append(_chunk(summary[at : at + length], begin))
        at += length
    return Index(topics, chunks) if topics and chunks else None


def _chunk(record: bytes, limit: int) -> Chunk:
    start, end, place, _, size = _BOUNDS.unpack_from(record)
    offsets = record[_BOUNDS.size : _BOUNDS.size + size]
    if len(offsets) != size or size % _OFFSET.size or place >= limit:
        raise DamageError("its index leads out of it")
    return Chunk(start, end, place, offsets)


def _record(file: BinaryIO, place: int) -> tuple[int, Parts]:
    file.seek(place)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        raise DamageError("it was cut off")
    opcode, length = HEAD.unpack(head)
    if length > MOST:
        raise DamageError(f"a part would have {length:,} bytes")
    return opcode, Parts(file.read(length))
