"""Pictures that are damaged, cut, huge or something else: refused by name, in every place."""

import os
import struct
import zlib
from pathlib import Path
from queue import SimpleQueue

import cv2
import numpy as np
import pytest
import zenoh
from controller_helpers import PATIENCE, free_endpoint, wait_until_watched
from hostile_inputs import Hostile
from hypothesis import example, given, settings
from hypothesis import strategies as st

from macor_hil.errors import CameraError, WrongPictureError
from macor_hil.hardware.cameras.decoding import MAX_BYTES, decode_picture, read_picture
from macor_hil.hardware.cameras.files import ImagesCamera
from macor_hil.hardware.cameras.zenoh_camera import ZenohCamera
from macor_hil.monitor.dashboard.board import Board
from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.ros2.bridge import Bridge
from macor_hil.telemetry.session import open_session


def a_view(seed: int = 0, side: int = 48) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return cv2.GaussianBlur(rng.integers(0, 256, (side, side, 3), dtype=np.uint8), (5, 5), 2)


def encoded(kind: str, image: np.ndarray | None = None, *options: int) -> bytes:
    return cv2.imencode(kind, a_view() if image is None else image, options)[1].tobytes()


WHOLE = {
    "JPEG": encoded(".jpg"),
    "progressive JPEG": encoded(".jpg", None, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
    "JPEG with restarts": encoded(".jpg", None, cv2.IMWRITE_JPEG_RST_INTERVAL, 2),
    "PNG": encoded(".png"),
    "BMP": encoded(".bmp"),
}


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def a_png(
    width: int, height: int, depth: int = 8, colour: int = 2, rows: bytes = b"", extra: bytes = b""
) -> bytes:
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    body = chunk(b"IHDR", head) + extra + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def resized(jpeg: bytes, width: int, height: int) -> bytes:
    """A JPEG that claims another size."""
    at = jpeg.index(b"\xff\xc0") + 5
    return jpeg[:at] + struct.pack(">HH", height, width) + jpeg[at + 4 :]


def a_bmp(width: int, height: int, bits: int = 24, start: int = 54) -> bytes:
    head = struct.pack("<IHHIIiiHHIIiiII", 54, 0, 0, start, 40, width, height, 1, bits, *[0] * 6)
    return b"BM" + head + bytes(64)


def rows_of(image: np.ndarray) -> bytes:
    return b"".join(b"\0" + row[:, ::-1].tobytes() for row in image)


MANY_CHUNKS = chunk(b"aaAa", b"") * 20_000
A_SCAN = b"\xff\xda\0\x0c\x03\x01\0\x02\x11\x03\x11\0\x3f\0\0"

BOMBS = {
    "PNG of 69 bytes that claims 40,000 x 40,000": a_png(40_000, 40_000),
    "PNG of the largest size there is": a_png(2**31 - 1, 2**31 - 1),
    "PNG that is wide": a_png(2**31 - 1, 1),
    "PNG without a row": a_png(48, 0),
    "PNG with half its rows": a_png(48, 48, rows=rows_of(a_view())[: 24 * 145]),
    "PNG with 20,000 chunks": a_png(48, 48, rows=rows_of(a_view()), extra=MANY_CHUNKS),
    "JPEG of the largest size there is": resized(WHOLE["JPEG"], 65_535, 65_535),
    "JPEG without a column": resized(WHOLE["JPEG"], 0, 48),
    "JPEG of scans": WHOLE["JPEG"][:-2] + A_SCAN * 100 + b"\xff\xd9",
    "JPEG that ends before it begins": b"\xff\xd8\xff\xd9",
    "JPEG of markers": b"\xff\xd8" + b"\xff\x01" * 50_000,
    "BMP of the largest size there is": a_bmp(2**31 - 1, 2**31 - 1),
    "BMP upside down": a_bmp(2**31 - 1, -(2**31)),
    "BMP of negative width": a_bmp(-48, 48),
    "BMP that begins beyond its end": a_bmp(48, 48, start=2**32 - 1),
}

CHANNELS = [
    ("alpha", encoded(".png", np.dstack([a_view(), a_view()[..., :1]]))),
    ("it is grey", encoded(".png", a_view()[..., 0])),
    ("1 channels", encoded(".jpg", a_view()[..., 0])),
    ("16 bits", encoded(".png", a_view().astype(np.uint16) << 8)),
    ("a palette", a_png(48, 48, 8, 3, bytes(48 * 49), chunk(b"PLTE", bytes(range(48))))),
    ("a transparent colour", a_png(48, 48, 8, 2, rows_of(a_view()), chunk(b"tRNS", bytes(6)))),
    ("8 bits a pixel", encoded(".bmp", a_view()[..., 0])),
    ("32 bits a pixel", encoded(".bmp", np.dstack([a_view(), a_view()[..., :1]]))),
    ("neither JPEG, PNG nor BMP", encoded(".tiff")),
]


def taken(data: bytes, says: str = "") -> bool:
    """Return whether a picture is taken; it may only be refused by its name."""
    try:
        image = decode_picture(data, "no picture")
    except WrongPictureError as refused:
        error = str(refused)
    else:
        assert image.dtype == np.uint8
        assert image.ndim == 3
        return True
    assert error.startswith("no picture")
    assert says in error
    return False


@pytest.mark.parametrize("kind", WHOLE)
def test_a_whole_picture_is_taken(kind: str) -> None:
    image = decode_picture(WHOLE[kind], "no picture")
    assert image.shape == (48, 48, 3)
    assert np.abs(image.astype(int) - a_view()).mean() < 6


@pytest.mark.parametrize("kind", WHOLE)
def test_every_beginning_of_a_picture_is_refused(kind: str, hostile: Hostile) -> None:
    whole = WHOLE[kind]
    for size in range(len(whole)):
        assert not taken(whole[:size])
    hostile.count("picture, cut", len(whole))


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused(name: str, hostile: Hostile, monkeypatch: pytest.MonkeyPatch) -> None:
    if "half" not in name:  # its header is good
        monkeypatch.setattr(cv2, "imdecode", None)  # it is refused before it is decoded
    assert not taken(BOMBS[name])
    hostile.count("picture, bomb")


@pytest.mark.parametrize(("says", "data"), CHANNELS, ids=lambda value: str(value)[:20])
def test_other_channels_are_refused(says: str, data: bytes, hostile: Hostile) -> None:
    assert not taken(data, says)
    hostile.count("picture, channels")


def test_a_picture_of_too_many_bytes_is_not_decoded() -> None:
    assert not taken(WHOLE["PNG"] + bytes(MAX_BYTES), "at most are read")


ways = st.sampled_from(["flip", "cut", "insert", "drop"])
damages = st.lists(st.tuples(ways, st.integers(0), st.binary(max_size=8)), min_size=1, max_size=6)


def damaged(whole: bytes, damage: list[tuple[str, int, bytes]]) -> bytes:
    data = bytearray(whole)
    for what, number, some in damage:
        at = number % (len(data) + 1)
        if what == "flip" and at < len(data):
            data[at] ^= 1 << number % 8
        elif what == "cut":
            del data[at:]
        elif what == "insert":
            data[at:at] = some
        elif what == "drop":
            del data[at : at + len(some)]
    return bytes(data)


def test_a_damaged_picture_is_refused_by_its_name_or_taken(hostile: Hostile) -> None:
    @settings(max_examples=hostile.examples(300))
    @given(st.sampled_from(sorted(WHOLE)), damages)
    def check(kind: str, damage: list[tuple[str, int, bytes]]) -> None:
        taken(damaged(WHOLE[kind], damage))
        hostile.count("picture, damaged")

    check()


def test_any_bytes_are_refused(hostile: Hostile) -> None:
    @settings(max_examples=hostile.examples(200))
    @given(st.sampled_from([b"", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM"]), st.binary())
    @example(b"", b"")
    def check(start: bytes, data: bytes) -> None:
        assert not taken(start + data)
        hostile.count("picture, any bytes")

    check()


def test_a_file_of_a_folder_is_refused_as_bytes_are(hostile: Hostile, tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    tried = [
        *BOMBS.values(),
        *(data for _, data in CHANNELS),
        *(whole[:-3] for whole in WHOLE.values()),
    ]
    for data in tried:
        path.write_bytes(data)
        with pytest.raises(WrongPictureError, match=r"cannot read the picture .*a\.png"):
            ImagesCamera(str(tmp_path)).grab()
    hostile.count("picture file", len(tried))


def test_what_is_no_file_is_refused(tmp_path: Path, hostile: Hostile) -> None:
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    (tmp_path / "link.png").symlink_to("nowhere")
    for name in ("folder.png", "pipe.png", "link.png", "none.png", "a" * 300 + ".png"):
        with pytest.raises(CameraError, match="cannot read the picture"):
            read_picture(tmp_path / name)
        hostile.count("picture file")


def test_the_dashboard_neither_draws_nor_passes_on_what_is_no_picture(hostile: Hostile) -> None:
    for data in (*BOMBS.values(), *(whole[:-3] for whole in WHOLE.values())):
        watched = RobotState("khepera")
        watched.see(data, 1.0)
        board = Board()
        board.parts(watched, {watched.robot: watched}, 1.0)
        # of half a PNG a browser finds out
        assert not board.picture or data == BOMBS["PNG with half its rows"]
        hostile.count("picture on the dashboard")


STAMPS = [
    b"",
    b"now",
    b"{}",
    b'{"sequence": -1, "time": 0.0}',
    b'{"sequence": 1, "time": 1e999}',
    b'{"sequence": 1, "time": NaN}',
    b'{"sequence": ' + b"9" * 5000 + b', "time": 0.0}',
    b"[" * 100_000,
    b"\xff\x1b[2J" * 10,
]


def test_a_camera_on_zenoh_is_refused_by_name_whatever_it_answers(hostile: Hostile) -> None:
    cut = [whole[:-3] for whole in WHOLE.values()]
    pictures = [*BOMBS.values(), *(data for _, data in CHANNELS), *cut, b"", b"flour"]
    answers: list[tuple[bytes, bytes | None]] = [(picture, None) for picture in pictures]
    answers += [(WHOLE["PNG"], stamp) for stamp in STAMPS]
    left = iter(answers)
    endpoint = free_endpoint()

    def answer(query: zenoh.Query) -> None:
        with query:
            payload, attachment = next(left)
            query.reply("any/key", payload, attachment=attachment)

    with (
        open_session([endpoint], []) as source,
        open_session([], [endpoint]) as session,
        source.declare_queryable("any/key", answer),
    ):
        camera = ZenohCamera(session, "any/key")
        for _ in answers:
            with pytest.raises(WrongPictureError) as refused:
                camera.grab()
            assert str(refused.value).isprintable()
            hostile.count("camera on Zenoh")


def test_the_ros_bridge_forwards_no_picture_that_cannot_be_used(hostile: Hostile) -> None:
    endpoint = free_endpoint()
    with (
        open_session([endpoint], []) as source,
        Bridge(source, "khepera") as bridge,
        open_session([], [endpoint]) as watcher,
    ):
        forwarded: SimpleQueue[zenoh.Sample] = SimpleQueue()
        watcher.declare_subscriber("0/khepera/image/**", forwarded.put)
        wait_until_watched(source, "0/khepera/image/compressed/*/*")
        bad = [*BOMBS.values(), *(whole[:-3] for whole in WHOLE.values())]
        bad.remove(BOMBS["PNG with half its rows"])  # whole but for what it packs
        for number, data in enumerate([*bad, WHOLE["JPEG"]]):
            source.put("macor/khepera/frame", data)
            bridge.forward(PATIENCE)
            assert bridge._not_taken.refused == min(number + 1, len(bad))
        assert WHOLE["JPEG"] in forwarded.get(timeout=PATIENCE).payload.to_bytes()
        assert forwarded.empty()
        hostile.count("picture over ROS 2", len(bad))
