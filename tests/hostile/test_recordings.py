"""Recordings from outside: what came before the damage is used, and what is left out is told."""

import io
import os
import re
import struct
import tracemalloc
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from as_type import as_type
from damage import damaged
from hostile_inputs import Hostile
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.zenoh.keys import EMULATOR
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.writer import CompressionType, Writer
from watching_helpers import BEGIN, a_life

from macor_hil.errors import MacorError, RecordingError
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.recorded_drives import learn
from macor_hil.telemetry.feed import Arrival, Presence
from macor_hil.telemetry.recordings.mcap_file import Damage, read_messages
from macor_hil.telemetry.recordings.mcap_file import Message as KeptMessage
from macor_hil.telemetry.recordings.recording import Recorder, play_recording, read_recording

MIB = 1 << 20
PEAK = 200 * MIB
LEARNED = ("frame", "decision")
CODECS = {
    "": lambda data: data,
    "zstd": zstandard.ZstdCompressor().compress,
    "lz4": lz4.frame.compress,
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recordings") / "whole.mcap"
    with Recorder(path, "khepera") as recorder:
        for event in a_life(2):
            recorder.write(event)
    return path.read_bytes()


def rewritten(whole: bytes, compression: CompressionType, chunk_size: int = 1 << 20) -> bytes:
    """The same messages, as other tools write them."""
    buffer = io.BytesIO()
    writer = Writer(buffer, chunk_size=chunk_size, compression=compression)
    writer.start()
    schemas, channels = {}, {}
    for record in StreamReader(io.BytesIO(whole)).records:
        match record:
            case Schema() if record.id not in schemas:
                schemas[record.id] = writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in channels:
                channels[record.id] = writer.register_channel(
                    record.topic, record.message_encoding, schemas[record.schema_id]
                )
            case Message():
                writer.add_message(
                    channels[record.channel_id],
                    record.log_time,
                    record.data,
                    record.publish_time,
                    record.sequence,
                )
    writer.finish()
    return buffer.getvalue()


def read(path: Path, data: bytes) -> list[Arrival | Presence]:
    path.write_bytes(data)
    try:
        return read_recording(path)[1]
    except RecordingError as error:
        assert_one_sentence(error, path)
        return []


def assert_one_sentence(error: MacorError, path: Path | str) -> None:
    assert str(path) in str(error)
    assert str(error).isprintable()


def is_part(some: Sequence[Arrival | Presence], whole: Sequence[Arrival | Presence]) -> bool:
    """Return whether all of some are in the whole, in this order."""
    rest = iter(whole)
    return all(event in rest for event in some)


def safe_counts(data: bytes) -> dict[int, int]:
    """Yield the end of each chunk, with how many events there are up to there."""
    messages = read_messages(file := io.BytesIO(data))
    ends = {0: 0}
    count = 0
    for message in messages:
        assert not isinstance(message, Damage)
        ours = not message.topic.startswith("foxglove/")
        # the file has been read to the end of the chunk that the message is in
        count += ours
        ends[file.tell()] = count
    return ends


def first_difference(one: bytes, other: bytes) -> int:
    pairs = enumerate(zip(one, other, strict=False))
    return next((k for k, (a, b) in pairs if a != b), min(len(one), len(other)))


def test_damaged_copies_keep_what_came_before(
    hostile: Hostile, whole: bytes, tmp_path: Path
) -> None:
    ends, events = safe_counts(whole), a_life(2)

    @settings(max_examples=hostile.examples(150))
    @given(damaged(whole))
    def check(data: bytes) -> None:
        hostile.count("recordings")
        kept = read(tmp_path / "x.mcap", data)
        assert is_part(kept, events)
        before = max(count for end, count in ends.items() if end <= first_difference(data, whole))
        assert kept[:before] == events[:before]

    check()


def test_a_recording_cut_off_anywhere_keeps_its_whole_chunks(
    hostile: Hostile, whole: bytes, tmp_path: Path
) -> None:
    ends, events = safe_counts(whole), a_life(2)
    assert len(ends) > 3
    for cut in range(0, len(whole), max(1, len(whole) // hostile.examples(60))):
        hostile.count("recordings")
        kept = read(tmp_path / "x.mcap", whole[:cut])
        assert kept == events[: max(count for end, count in ends.items() if end <= cut)]


@pytest.mark.parametrize("compression", list(CompressionType))
def test_recordings_that_other_tools_have_rewritten_are_read(
    whole: bytes, tmp_path: Path, compression: CompressionType
) -> None:
    for chunk_size in (1000, 1 << 22):
        assert read(tmp_path / "x.mcap", rewritten(whole, compression, chunk_size)) == a_life(2)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_damaged_copies_of_compressed_recordings(
    hostile: Hostile, whole: bytes, tmp_path: Path, compression: CompressionType
) -> None:
    data, events = rewritten(whole, compression, 2000), a_life(2)

    @settings(max_examples=hostile.examples(100))
    @given(damaged(data))
    def check(copy: bytes) -> None:
        hostile.count("recordings")
        assert is_part(read(tmp_path / "x.mcap", copy), events)

    check()


def test_recordings_with_damage_behind_their_checksums(
    hostile: Hostile, whole: bytes, tmp_path: Path
) -> None:
    chunks = [
        record
        for record in StreamReader(io.BytesIO(whole), emit_chunks=True).records
        if isinstance(record, Chunk)
    ]
    records = b"".join(chunk.data for chunk in chunks)
    codecs = sorted(CODECS)

    @settings(max_examples=hostile.examples(100))
    @given(damaged(records), st.sampled_from(codecs))
    def check(data: bytes, codec: str) -> None:
        hostile.count("recordings")
        read(tmp_path / "x.mcap", file_of(chunk_of(data, codec)))

    check()


def test_a_damaged_chunk_is_left_out_told_and_read_over(
    whole: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ends = sorted(safe_counts(whole).items())
    (_, before), (end, after) = next(
        pair for pair in pairwise(ends[1:]) if pair[1][1] > pair[0][1] and pair[0][1] > 9
    )
    data = bytearray(whole)
    data[end - 100] ^= 1
    kept, events = read(tmp_path / "x.mcap", bytes(data)), a_life(2)
    assert kept[:before] == events[:before]
    assert kept == events[:before] + events[after:]
    (said,) = caplog.messages
    assert re.search(r"left out a part at byte [\d,]+: a chunk is not what its checksum says", said)


def test_a_cut_is_told(whole: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    read(tmp_path / "x.mcap", whole[: len(whole) // 2])
    assert "x.mcap: left out a part at byte" in caplog.text
    assert "it was cut off" in caplog.text


def record_of(opcode: int, contents: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(contents)) + contents


def text_of(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def channel_of(number: int, topic: str) -> bytes:
    return record_of(4, struct.pack("<HH", number, 0) + text_of(topic) + text_of("json") + bytes(4))


def message_of(number: int, data: bytes, received: int = BEGIN) -> bytes:
    return record_of(5, struct.pack("<HIQQ", number, 0, received, received) + data)


def chunk_of(
    records: bytes, codec: str = "", size: int | None = None, compressed: bytes | None = None
) -> bytes:
    data = CODECS[codec](records) if compressed is None else compressed
    size = len(records) if size is None else size
    head = struct.pack("<QQQI", 0, 0, size, zlib.crc32(records)) + text_of(codec)
    return record_of(6, head + struct.pack("<Q", len(data)) + data)


def file_of(*records: bytes) -> bytes:
    header = record_of(1, text_of("") + text_of("test"))
    return b"\x89MCAP0\r\n" + header + b"".join(records)


ALIVE = channel_of(1, "khepera/k/alive") + message_of(1, b'{"alive":true}')


@pytest.mark.parametrize(
    "part",
    [
        record_of(5, b""),
        record_of(5, bytes(21)),
        record_of(5, struct.pack("<HIQQ", 99, 0, 0, 0)),
        record_of(4, struct.pack("<HHI", 1, 0, 2**32 - 1)),
        record_of(4, struct.pack("<HHI", 1, 0, 2) + b"\xff\xfe"),
        record_of(6, b"\0" * 10),
        record_of(0, b""),
        record_of(0x46, b"?"),
        chunk_of(b"", size=1),
        chunk_of(b"", size=2**60),
        chunk_of(b"\5" + b"\xff" * 8),
        chunk_of(b"x", codec="zstd", compressed=b"no zstd"),
        chunk_of(b"x", codec="lz4", compressed=b"no lz4"),
        chunk_of(b"x", codec="zstd", compressed=zstandard.compress(bytes(MIB))),
        chunk_of(b"x", codec="lz4", compressed=lz4.frame.compress(bytes(MIB))),
        message_of(1, b"\xff"),
        message_of(1, b'{"alive":' + b"[" * 100_000),
        channel_of(2, "macor/k/frame") + message_of(2, b"\xff\xff\xff"),
        channel_of(2, "macor/k/frame") + message_of(2, b"\x22\x05\x1b[31m"),
    ],
)
def test_a_part_that_cannot_be_read_is_left_out_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, part: bytes
) -> None:
    path = tmp_path / "x.mcap"
    after = message_of(1, b'{"alive":false}', BEGIN + 1)
    path.write_bytes(file_of(ALIVE, part, after))
    expected = [Presence(EMULATOR, True, BEGIN), Presence(EMULATOR, False, BEGIN + 1)]
    assert read_recording(path) == ("k", expected)
    (said,) = caplog.messages
    assert "left out" in said
    assert "and 1 more" in said  # the end was cut off, too


def test_learning_from_damaged_samples(hostile: Hostile) -> None:
    events = a_life(3)
    samples = [k for k, event in enumerate(events) if getattr(event, "leaf", "") in LEARNED]
    damages = st.sampled_from(samples).flatmap(
        lambda k: st.tuples(st.just(k), damaged(as_type(Arrival, events[k]).data))
    )

    @settings(max_examples=hostile.examples(60))
    @given(st.lists(damages, min_size=1, max_size=4))
    def check(damage: list[tuple[int, bytes]]) -> None:
        hostile.count("learning")
        odd = list(events)
        for k, data in damage:
            odd[k] = replace(as_type(Arrival, odd[k]), data=data)
        brain = build_brain(MindSettings(nodes=5))
        try:
            assert 0 < learn(brain, [odd], np.random.default_rng(0)) <= 3
        except MacorError as error:
            assert_one_sentence(error, "")
        else:
            assert np.isfinite(as_type(FuzzyArt, brain.clusterer).weights).all()

    check()


def test_an_unknown_compression_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "x.mcap"
    head = struct.pack("<QQQI", 0, 0, 1, 0) + text_of("xz\x1b[2J") + struct.pack("<Q", 1) + b"x"
    path.write_bytes(file_of(record_of(6, head)))
    with pytest.raises(RecordingError, match="no sample of one is in it"):
        read_recording(path)
    assert r"is compressed as 'xz\x1b[2J'; zstd and lz4 are read" in caplog.text


def test_channels_of_other_shapes_are_no_robot_s(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    odd = ["macor/frame", "a/b/c/d", "khepera//alive", "khepera/\x1b[2J/alive", "k/k/k", "", "/"]
    records = [channel_of(2 + k, topic) + message_of(2 + k, b"{}") for k, topic in enumerate(odd)]
    path.write_bytes(file_of(*records, ALIVE))
    assert read_recording(path) == ("k", [Presence(EMULATOR, True, BEGIN)])


def test_other_robots_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    other = channel_of(2, "khepera/other/alive") + message_of(2, b'{"alive":true}')
    path.write_bytes(file_of(ALIVE, other))
    assert read_recording(path) == ("k", [Presence(EMULATOR, True, BEGIN)])


STATE = channel_of(2, "macor/k/state")


def zstd_claiming(size: int) -> bytes:
    """A frame that says it has so many bytes, and has one."""
    return b"\x28\xb5\x2f\xfd\xe0" + size.to_bytes(8, "little") + b"\x09\0\0x"


@pytest.mark.parametrize(
    "bomb",
    [
        # 44 kB that expand to more than a GB
        lambda: [chunk_of(STATE + message_of(2, bytes(30 * MIB)), "zstd")] * 40,
        lambda: [chunk_of(STATE + message_of(2, bytes(10 * MIB)), "lz4")] * 10,
        lambda: [chunk_of(b"x", "zstd", 2**40, zstd_claiming(2**40))],
        lambda: [chunk_of(b"x", "zstd", 30 * MIB, zstd_claiming(2**40))],
        lambda: [struct.pack("<BQ", 6, 2**40)],
        lambda: [struct.pack("<BQ", 8, 2**63) + bytes(1000)],
        lambda: [chunk_of(bytes(65 * MIB), "zstd")],
    ],
)
def test_what_expands_without_end_is_left_out(tmp_path: Path, bomb: Callable[..., Any]) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(file_of(ALIVE, *bomb()))
    tracemalloc.start()
    try:
        robot, events = read_recording(path)
        assert (robot, events[0]) == ("k", Presence(EMULATOR, True, BEGIN))
        assert tracemalloc.get_traced_memory()[1] < PEAK
    finally:
        tracemalloc.stop()


def test_events_without_data_are_bounded_in_number(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(file_of(ALIVE, *[chunk_of(STATE + message_of(2, b"") * 200_000, "zstd")] * 9))
    assert len(read_recording(path)[1]) < 100_000
    assert "left out the rest: it expands to far more than a recording does" in caplog.text


def test_playing_a_long_recording_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    peaks = []
    for length in (5, 60):
        path = tmp_path / f"{length}.mcap"
        with Recorder(path, "khepera") as recorder:
            for event in a_life(length):
                recorder.write(event)
        tracemalloc.start()
        _, events = play_recording(path)
        count = sum(1 for _ in events)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert count == len(a_life(length))
    assert peaks[1] < 1.5 * peaks[0] + MIB / 4


def test_memory_that_is_not_there_is_not_used_and_that_is_told(
    whole: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(whole)
    events = read_recording(path, most=30_000)[1]
    assert 0 < len(events) < len(a_life(2))
    assert events == a_life(2)[: len(events)]
    assert f"there is room for its first {len(events)} events only" in caplog.text


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for odd in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(RecordingError, match=r"cannot read .*(not a regular|Is a directory)"):
            read_recording(odd)


def test_an_independent_reader_agrees_on_every_message(whole: bytes) -> None:
    theirs: list[Message] = []
    for record in StreamReader(io.BytesIO(whole), emit_chunks=True).records:
        if isinstance(record, Chunk):
            theirs += [r for r in breakup_chunk(record) if isinstance(r, Message)]
    ours = [as_type(KeptMessage, m) for m in read_messages(io.BytesIO(whole))]
    assert [(m.sequence, m.log_time, m.publish_time, m.data) for m in ours] == [
        (m.sequence, m.log_time, m.publish_time, m.data) for m in theirs
    ]
