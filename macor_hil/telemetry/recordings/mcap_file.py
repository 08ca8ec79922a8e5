"""Messages of an MCAP file, as far as it can be read.

The library that writes recordings believes every length that stands in a file. Files from outside
are read here: nothing is taken into memory or expanded before its size is known to be within
bounds, and damage is told together with its place. A chunk whose contents are damaged is left out,
and reading goes on behind it; where a record's own length cannot be true, reading ends.

Layout: a magic number, then records of an opcode (1 byte), a length (8) and contents, with numbers
in little-endian order (https://mcap.dev/spec). What follows the data, such as an index, is not
needed. Needs the extra 'recording'.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from io import BytesIO
from typing import BinaryIO, Final, NamedTuple

import lz4.frame
import zstandard
from khepera_protocol.text import quoted

from macor_hil.files import MIB

MAGIC: Final = b"\x89MCAP0\r\n"
HEAD: Final = struct.Struct("<BQ")
_CHUNK_HEAD: Final = struct.Struct("<QQQI")
_MESSAGE: Final = struct.Struct("<HIQQ")

CHANNEL: Final = 0x04
_MESSAGE_OPCODE: Final = 0x05
CHUNK: Final = 0x06
MESSAGE_INDEX: Final = 0x07
CHUNK_INDEX: Final = 0x08
FOOTER: Final = 0x02
_DATA_END: Final = 0x0F
_PRIVATE: Final = 0x80

MOST: Final = 64 * MIB
"""Bytes of a record, and of a chunk when it is expanded."""

_LONGEST_NAME: Final = 1024
_LONGER: Final = "a part of it is longer than the whole"


class Message(NamedTuple):
    """A message.

    Attributes:
        topic: of its channel.
        sequence: number that it was given.
        log_time, publish_time: ns.
        data: its payload.
    """

    topic: str
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Damage(NamedTuple):
    """A part that cannot be read.

    Attributes:
        place: byte of the file where it begins.
        reason: in words.
    """

    place: int
    reason: str


class DamageError(Exception):
    """A part cannot be read; the message says why."""


class Parts:
    """The contents of a record, taken from the front."""

    def __init__(self, data: bytes) -> None:
        self._data = memoryview(data)
        self._at = 0

    def __bool__(self) -> bool:
        return self._at < len(self._data)

    def numbers(self, form: struct.Struct) -> tuple[int, ...]:
        """Take numbers of a form."""
        return form.unpack(self.take(form.size))

    def number(self, size: int) -> int:
        """Take a number of so many bytes."""
        return int.from_bytes(self.take(size), "little")

    def take(self, length: int) -> bytes:
        """Take so many bytes.

        Raises:
            DamageError: there are fewer.
        """
        end = self._at + length
        if end > len(self._data):
            raise DamageError(_LONGER)
        taken = bytes(self._data[self._at : end])
        self._at = end
        return taken

    def text(self) -> str:
        """Take a short text.

        Raises:
            DamageError: it is long, cut off, or no text.
        """
        length = self.number(4)
        if length > _LONGEST_NAME:
            raise DamageError("a name has no end")
        try:
            return self.take(length).decode()
        except UnicodeDecodeError:
            raise DamageError("a name is not UTF-8 text") from None

    def rest(self) -> bytes:
        """Take all that is left."""
        return self.take(len(self._data) - self._at)


class Topics:
    """Topics of channels, by their numbers.

    Args:
        known: those that need not be described any more.
    """

    def __init__(self, known: Mapping[int, str] | None = None) -> None:
        self._topics = dict(known or {})

    def hear(self, opcode: int, contents: bytes) -> Message | None:
        """Remember a channel, or return a message; other records are not needed.

        Raises:
            DamageError: it cannot be read, or its channel is not known.
        """
        if opcode == _MESSAGE_OPCODE:
            return self._message(contents)
        if opcode == CHANNEL:
            parts = Parts(contents)
            number, _ = parts.number(2), parts.number(2)
            self._topics[number] = parts.text()
        return None

    def _message(self, contents: bytes) -> Message:
        if len(contents) < _MESSAGE.size:
            raise DamageError(_LONGER)
        number, sequence, log_time, publish_time = _MESSAGE.unpack_from(contents)
        topic = self._topics.get(number)
        if topic is None:
            raise DamageError("it is of a channel that is not described")
        return Message(topic, sequence, log_time, publish_time, contents[_MESSAGE.size :])


def read_messages(file: BinaryIO) -> Iterator[Message | Damage]:
    """Read all messages of a file, in their order, with what cannot be read between them."""
    if file.read(len(MAGIC)) != MAGIC:
        yield Damage(0, "it does not begin as MCAP does")
        return
    yield from read_on(file, Topics())


def read_on(file: BinaryIO, topics: Topics) -> Iterator[Message | Damage]:
    """Read the messages of a file from where a record begins, likewise."""
    while True:
        place = file.tell()
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            yield Damage(place, "it was cut off")
            return
        opcode, length = HEAD.unpack(head)
        if opcode in (_DATA_END, FOOTER):
            return
        if length > MOST:
            yield Damage(place, f"a part would have {length:,} bytes")
            return
        contents = file.read(length)
        if len(contents) < length:
            yield Damage(place, "it was cut off")
            return
        try:
            yield from _messages(topics, opcode, contents)
        except DamageError as error:
            yield Damage(place, str(error))


def read_record(file: BinaryIO, topics: Topics) -> Iterator[Message]:
    """Read the messages of the one record that begins here; those behind damage are left out."""
    head = file.read(HEAD.size)
    if len(head) == HEAD.size:
        opcode, length = HEAD.unpack(head)
        if length <= MOST:
            with suppress(DamageError):
                yield from _messages(topics, opcode, file.read(length))


def _messages(topics: Topics, opcode: int, contents: bytes) -> Iterator[Message]:
    """Read the messages of a record, which is one itself or a chunk of many.

    Raises:
        DamageError: it cannot be read, or not to its end.
    """
    if opcode == 0 or _DATA_END < opcode < _PRIVATE:
        raise DamageError("it is of an unknown kind")
    if opcode != CHUNK:
        message = topics.hear(opcode, contents)
        if message is not None:
            yield message
        return
    # thousands of messages are read for a leap: no object is made for a part of one
    records = _chunk(Parts(contents))
    at, size = 0, len(records)
    while at < size:
        begin = at + HEAD.size
        if begin > size:
            raise DamageError(_LONGER)
        opcode, length = HEAD.unpack_from(records, at)
        at = begin + length
        if at > size:
            raise DamageError(_LONGER)
        message = topics.hear(opcode, records[begin:at])
        if message is not None:
            yield message


def _chunk(parts: Parts) -> bytes:
    """Return the records of a chunk.

    Raises:
        DamageError: they cannot be expanded, or are not those that were written.
    """
    _, _, size, checksum = parts.numbers(_CHUNK_HEAD)
    if size > MOST:
        raise DamageError(f"a chunk would have {size:,} bytes when it is expanded")
    compression = parts.text()
    data = parts.take(parts.number(8))
    records = _expanded(compression, data, size)
    if len(records) != size or (checksum and zlib.crc32(records) != checksum):
        raise DamageError("a chunk is not what its checksum says")
    return records


def _expanded(compression: str, data: bytes, size: int) -> bytes:
    """Return at most a byte more than the size that is stated, whatever there is."""
    match compression:
        case "":
            return data
        case "zstd":
            try:
                with zstandard.ZstdDecompressor().stream_reader(BytesIO(data)) as reader:
                    return reader.read(size + 1)
            except (zstandard.ZstdError, MemoryError):
                raise DamageError("a chunk cannot be expanded") from None
        case "lz4":
            try:
                expanded = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
            except (RuntimeError, EOFError, ValueError, MemoryError):
                raise DamageError("a chunk cannot be expanded") from None
            return bytes(expanded)
    raise DamageError(f"a chunk is compressed as {quoted(compression, 20)}; zstd and lz4 are read")
