"""Cameras by one string, and pictures that must not be acted upon."""

import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh
from as_type import not_none
from controller_helpers import PATIENCE, free_endpoint, watching
from interrupting import interrupt_after
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Stamp

from macor_hil.errors import (
    CameraDarkError,
    CameraError,
    CameraFlatError,
    CameraFrozenError,
    CameraLateError,
    CameraLostError,
    CameraSourceError,
    WrongPictureError,
)
from macor_hil.hardware.cameras import Frame, open_camera
from macor_hil.hardware.cameras.camera import Camera
from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, PictureLimits, limits_for
from macor_hil.hardware.cameras.live_video import LiveVideoCamera, is_device
from macor_hil.telemetry.session import open_session


def noise(seed: int = 0, shape: tuple[int, ...] = (16, 16, 3)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def opened(name: str, session: zenoh.Session | None = None) -> Camera:
    return open_camera(name, port=None, session=session, robot="khepera")


def test_a_folder_of_images_is_shown_in_the_order_of_names(tmp_path: Path) -> None:
    for number in (2, 0, 1):
        cv2.imwrite(str(tmp_path / f"{number}.png"), noise(number))
    (tmp_path / "notes.txt").write_text("no picture")
    camera = opened(f"images:{tmp_path}")
    for number in range(3):
        frame = camera.grab()
        assert (frame.sequence, frame.time) == (number, float(number))
        np.testing.assert_array_equal(frame.image, noise(number))
    with pytest.raises(CameraLostError, match="all 3 have been shown"):
        camera.grab()


def test_a_folder_with_a_broken_picture_says_which(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"flour")
    with pytest.raises(CameraError, match=r"cannot read the picture .*a\.png"):
        opened(f"images:{tmp_path}").grab()


@pytest.mark.parametrize(("name", "says"), [("empty", "no pictures"), ("none", "cannot read")])
def test_a_folder_without_pictures_is_refused(tmp_path: Path, name: str, says: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(CameraError, match=says):
        opened(f"images:{tmp_path / name}")


def test_a_video_file_is_shown_to_its_end(tmp_path: Path) -> None:
    path = str(tmp_path / "drive.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 64))
    for level in (50, 100, 150):
        writer.write(np.full((64, 64, 3), level, np.uint8))
    writer.release()
    camera = opened(f"video:{path}")
    frames = [camera.grab() for _ in range(3)]
    assert [round(float(f.image.mean()) / 50) for f in frames] == [1, 2, 3]
    assert [f.time for f in frames] == pytest.approx([0.0, 0.1, 0.2], abs=0.01)
    with pytest.raises(CameraLostError, match="no more pictures"):
        camera.grab()
    camera.close()


@pytest.mark.parametrize(
    ("name", "device"),
    [("0", True), ("/dev/video0", True), ("rtsp://cam/1", True), ("drive.mp4", False)],
)
def test_what_shows_the_present(name: str, device: bool) -> None:
    assert is_device(name) == device


class FakeCapture:
    """A video device that gives what is put into it, and waits meanwhile."""

    def __init__(self, opened: bool = True) -> None:
        self.pictures: SimpleQueue[np.ndarray | None] = SimpleQueue()
        self.opened = opened
        self.released = False
        self.reads = threading.Semaphore(0)

    def isOpened(self) -> bool:
        return self.opened

    def read(self) -> tuple[bool, np.ndarray | None]:
        self.reads.release()
        picture = self.pictures.get(timeout=PATIENCE)
        return picture is not None, picture

    def get(self, _: int) -> float:
        return 16.0

    def release(self) -> None:
        self.released = True


def test_a_live_video_gives_no_picture_that_was_begun_before_it_was_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits = threading.Semaphore(0)
    monkeypatch.setattr(
        "macor_hil.hardware.cameras.live_video.time.sleep", lambda _: waits.release()
    )
    device = FakeCapture()
    camera = LiveVideoCamera("0", lambda _: device)
    device.reads.acquire()  # it is being read
    got: SimpleQueue[Frame] = SimpleQueue()
    thread = threading.Thread(target=lambda: got.put(camera.grab()))
    thread.start()
    assert waits.acquire(timeout=PATIENCE)
    device.pictures.put(noise(1))
    device.pictures.put(noise(2))
    np.testing.assert_array_equal(got.get(timeout=PATIENCE).image, noise(2))
    thread.join()
    device.pictures.put(noise(3))
    camera.close()
    assert device.released


def test_a_live_video_that_was_unplugged_is_opened_again() -> None:
    devices = [FakeCapture(), FakeCapture()]
    for device in devices:
        device.pictures.put(None)
    for number in range(3):
        devices[1].pictures.put(noise(number))
    devices[1].pictures.get()
    left = iter(devices)
    camera = LiveVideoCamera("0", lambda _: next(left))
    np.testing.assert_array_equal(camera.grab().image[0, 0], not_none(camera._newest).image[0, 0])
    assert devices[0].released
    devices[1].pictures.put(noise(9))
    camera.close()


def test_a_live_video_whose_reader_has_died_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", heard.append)
    device = FakeCapture()
    monkeypatch.setattr(device, "read", lambda: 1 / 0)
    camera = LiveVideoCamera("0", lambda _: device)
    with pytest.raises(CameraLostError, match=r"read no more: .*ZeroDivisionError"):
        camera.grab()
    camera._thread.join(PATIENCE)
    assert heard


def test_a_live_video_in_grey_is_a_wrong_picture() -> None:
    device = FakeCapture()
    camera = LiveVideoCamera("0", lambda _: device)
    device.pictures.put(noise(shape=(16, 16)))
    with pytest.raises(WrongPictureError, match="three channels of 8 bits"):
        camera.grab()
    camera.close()


def test_a_video_too_large_to_be_decoded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    device = FakeCapture()
    monkeypatch.setattr(device, "get", lambda _: 40_000.0)
    with pytest.raises(WrongPictureError, match="40000 x 40000 pixels"):
        LiveVideoCamera("0", lambda _: device)
    assert device.released


class StreamServer:
    """A network camera, JPEG pictures over HTTP; its first connection can go silent."""

    def __init__(self, picture: bytes) -> None:
        self._picture = picture
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._server.getsockname()[1]}/stream"
        self.silent = threading.Event()
        self.connections: list[socket.socket] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):  # the server is closed
            while True:
                self.connections.append(self._server.accept()[0])
                threading.Thread(target=self._send, args=self.connections[-1:]).start()

    def _send(self, connection: socket.socket) -> None:
        head = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n"
        part = b"--b\r\nContent-Type: image/jpeg\r\n\r\n" + self._picture + b"\r\n"
        first = len(self.connections) == 1
        with suppress(OSError):  # one of both ends has been closed
            connection.recv(4096)
            connection.sendall(head)
            while not (first and self.silent.is_set()):
                connection.sendall(part)
                time.sleep(0.01)

    def close(self) -> None:
        for end in (self._server, *self.connections):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()


def test_a_network_camera_that_goes_silent_is_opened_again_within_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("macor_hil.hardware.cameras.video._SILENCE", 0.5)
    with closing(StreamServer(cv2.imencode(".jpg", noise(shape=(64, 64, 3)))[1].tobytes())) as net:
        camera = LiveVideoCamera(net.address)
        before = camera.grab()
        net.silent.set()
        lost = 0
        while len(net.connections) == 1:
            try:
                camera.grab()
            except CameraLostError:
                lost += 1
        assert lost < 4  # of two seconds each; OpenCV's own limit is 30 s
        assert camera.grab().sequence > before.sequence
        camera.close()


def test_a_video_device_that_is_not_there_is_named() -> None:
    with pytest.raises(CameraError, match="cannot open the video source '7'"):
        LiveVideoCamera("7", lambda _: FakeCapture(opened=False))


@pytest.mark.parametrize("name", ["9" * 20, "no://where"])
def test_a_video_source_that_cannot_be_is_named(name: str) -> None:
    with pytest.raises(CameraError, match="cannot open the video source"):
        opened(f"video:{name}")


PNG = cv2.imencode(".png", noise())[1].tobytes()


def test_a_source_that_only_publishes_is_heard() -> None:
    endpoint = free_endpoint()
    with watching(endpoint) as (watcher,), open_session([endpoint], []) as source:
        camera = opened("zenoh:any/key", watcher)
        got: SimpleQueue[Frame] = SimpleQueue()
        thread = threading.Thread(target=lambda: got.put(camera.grab()))
        thread.start()
        with source.declare_publisher("any/key") as publisher:
            while got.empty() and thread.is_alive():
                publisher.put(PNG)
                thread.join(0.01)
        np.testing.assert_array_equal(got.get(timeout=PATIENCE).image, noise())
        camera.close()


@pytest.mark.parametrize(
    ("payload", "attachment", "says"),
    [
        (b"flour", None, r"no picture .*5 bytes"),
        (b"", None, "0 bytes"),
        (PNG, b"now", "no time stamp"),
    ],
)
def test_an_answer_that_is_no_picture_is_named(
    payload: bytes, attachment: bytes | None, says: str
) -> None:
    endpoint = free_endpoint()
    with open_session([endpoint], []) as source, watching(endpoint) as (watcher,):

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply("any/key", payload, attachment=attachment)

        camera = opened("zenoh:any/key", watcher)
        with (
            source.declare_queryable("any/key", answer),
            pytest.raises(WrongPictureError, match=says),
        ):
            camera.grab()


def test_an_answer_is_placed_by_its_stamp() -> None:
    endpoint = free_endpoint()
    stamp = Stamp(sequence=5, time=1.25).model_dump_json()
    with open_session([endpoint], []) as source, watching(endpoint) as (watcher,):

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply("any/key", PNG, attachment=stamp)

        with source.declare_queryable("any/key", answer):
            frame = opened("zenoh:any/key", watcher).grab()
    assert (frame.sequence, frame.time) == (5, 1.25)


def answering(session: zenoh.Session, payload: bytes, **options: Any) -> zenoh.Queryable[None]:
    """A queryable that answers with a picture, or what it is given."""

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply("any/key", payload, timestamp=session.new_timestamp())

    return session.declare_queryable("any/key", answer, **options)


@contextmanager
def three_sessions() -> Iterator[tuple[zenoh.Session, zenoh.Session, zenoh.Session]]:
    """Of the camera's owner, of who drives, and of a stranger who connects to both."""
    source, driver = free_endpoint(), free_endpoint()
    with (
        open_session([source], []) as owner,
        open_session([driver], [source]) as driving,
        open_session([], [source, driver]) as stranger,
    ):
        yield owner, driving, stranger


OTHER = cv2.imencode(".png", noise(9))[1].tobytes()


@pytest.mark.parametrize("payload", [OTHER, b"flour", b""])
@pytest.mark.parametrize("complete", [False, True])
def test_a_stranger_s_pictures_are_not_taken(
    payload: bytes, complete: bool, caplog: pytest.LogCaptureFixture
) -> None:
    with three_sessions() as (owner, driving, stranger), answering(owner, PNG):
        camera = opened("zenoh:any/key", driving)
        camera.grab()
        with answering(stranger, payload, complete=complete):
            until_answers(driving, 2)
            for _ in range(20):
                np.testing.assert_array_equal(camera.grab().image, noise())
    assert "1 other sources answer" in caplog.text


def until_answers(session: zenoh.Session, number: int) -> None:
    """Wait until so many sources answer."""
    options: dict[str, Any] = {
        "target": zenoh.QueryTarget.ALL,
        "consolidation": zenoh.ConsolidationMode.NONE,
        "timeout": PATIENCE,
    }
    end = time.monotonic() + PATIENCE
    while len(list(session.get("any/key", **options))) < number:
        assert time.monotonic() < end


def test_a_stranger_who_keeps_his_answer_back_delays_nothing() -> None:
    kept: list[zenoh.Query] = []
    with three_sessions() as (owner, driving, stranger), answering(owner, PNG):
        camera = CheckedCamera(opened("zenoh:any/key", driving), PictureLimits(repeats=10_000))
        camera.grab()
        with stranger.declare_queryable("any/key", kept.append):
            while not kept:
                camera.grab()  # within half a second, or it is an error
            camera.grab()
        kept.clear()


def test_the_camera_is_not_chosen_among_several() -> None:
    with (
        three_sessions() as (owner, driving, stranger),
        answering(owner, PNG),
        answering(stranger, OTHER),
    ):
        until_answers(driving, 2)
        with pytest.raises(CameraSourceError, match="2 sources answer on the Zenoh key any/key"):
            opened("zenoh:any/key", driving).grab()


def test_a_camera_that_was_started_again_is_followed_once_the_change_was_told() -> None:
    endpoint = free_endpoint()
    told = 0
    with open_session([endpoint], []) as driving:
        camera = opened("zenoh:any/key", driving)
        for payload, image in ((PNG, noise()), (OTHER, noise(9))):
            with open_session([], [endpoint]) as owner, answering(owner, payload):
                while True:
                    try:
                        frame = camera.grab()
                        break
                    except CameraSourceError:
                        told += 1
                np.testing.assert_array_equal(frame.image, image)
    assert told > 0


def test_a_stranger_does_not_take_the_place_of_a_camera_that_has_gone() -> None:
    with three_sessions() as (owner, driving, stranger), answering(stranger, OTHER):
        camera = opened("zenoh:any/key", driving)
        until_answers(driving, 1)
        camera.grab()
        with answering(owner, PNG):  # here the stranger
            until_answers(driving, 2)
            camera.grab()
            until_answers(driving, 2)  # both have been heard by now
            stranger.close()
            with pytest.raises(CameraLostError, match="no camera answers"):
                camera.grab()


@pytest.mark.parametrize("key", ["khepera/**", "", "a//b", "/a", "a?b"])
def test_a_key_on_which_no_camera_can_be_is_refused(key: str) -> None:
    with open_session([free_endpoint()], []) as session, pytest.raises(CameraError):
        opened(f"zenoh:{key or '*'}", session)


def test_a_session_that_was_closed_is_a_lost_camera() -> None:
    with open_session([free_endpoint()], []) as session:
        camera = opened("zenoh:any/key", session)
    with pytest.raises(CameraLostError, match="session closed"):
        camera.grab()


class Pictures:
    """A camera that shows what it is given, then fails."""

    def __init__(
        self, *images: np.ndarray, live: bool = True, act: Callable[[], object] = lambda: None
    ) -> None:
        self.live = live
        self.images = list(images)
        self.act = act
        self.grabbed = threading.Semaphore(0)

    def grab(self) -> Frame:
        self.act()
        self.grabbed.release()
        if not self.images:
            raise CameraLostError("none left")
        image = self.images.pop(0) if len(self.images) > 1 else self.images[0]
        return Frame(image, 0.0, 0)

    def close(self) -> None:
        pass


LIMITS = PictureLimits(size=(16, 16))


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (noise(shape=(16, 12, 3)), WrongPictureError),
        (noise(shape=(16, 16)), WrongPictureError),
        (noise() // 12, CameraDarkError),
        (np.full((16, 16, 3), 255, np.uint8), CameraFlatError),
        (np.full((16, 16, 3), 128, np.uint8), CameraFlatError),
        (noise() // 32 + 90, CameraFlatError),  # grey, and noise
    ],
)
def test_a_picture_that_cannot_be_used_is_named(
    image: np.ndarray, error: type[WrongPictureError]
) -> None:
    with pytest.raises(error):
        CheckedCamera(Pictures(image), LIMITS).grab()


def test_a_night_with_a_lamp_in_it_is_not_dark() -> None:
    image = noise() // 12
    image[:8, :8] = 200
    assert CheckedCamera(Pictures(image), LIMITS).grab().image is image


@pytest.mark.parametrize("level", [255, 128])
def test_a_mirror_in_which_nothing_can_be_seen_is_flat_whatever_is_around_it(level: int) -> None:
    mirror = Mirror()
    disc = cv2.circle(np.zeros((160, 160, 3), np.uint8), (80, 80), 78, (level,) * 3, -1)
    disc = cv2.GaussianBlur(disc, (3, 3), 1)
    with pytest.raises(CameraFlatError, match=f"about {level}, {level}, {level}"):
        CheckedCamera(Pictures(disc), limits_for(mirror)).grab()


def test_two_colours_of_equal_brightness_are_not_flat() -> None:
    image = np.zeros((16, 16, 3), np.uint8)
    image[:, :8, 1] = image[:, 8:, 2] = 200
    CheckedCamera(Pictures(image), LIMITS).grab()


def test_a_live_camera_that_shows_the_same_picture_again_is_frozen() -> None:
    camera = CheckedCamera(Pictures(noise(1), noise(2), noise(2), noise(3)), LIMITS)
    camera.grab()
    camera.grab()
    with pytest.raises(CameraFrozenError, match="bit for bit"):
        camera.grab()
    camera.grab()  # it thaws


def test_a_recording_may_show_the_same_picture_again() -> None:
    camera = CheckedCamera(Pictures(noise(), live=False), LIMITS)
    assert camera.grab() == camera.grab()


def test_a_picture_that_takes_too_long_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("macor_hil.hardware.cameras.checked_camera.time.monotonic", lambda: now[0])

    def take() -> None:
        now[0] += 0.6

    with pytest.raises(CameraLateError, match=r"took 0\.60 s"):
        CheckedCamera(Pictures(noise(), act=take), LIMITS).grab()


def drive_on(watch: CameraWatch) -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        watch.guard()


def test_the_watch_tells_of_a_camera_that_fails_while_the_robot_drives() -> None:
    camera = Pictures()
    with CameraWatch(camera, limit=60.0) as watch:
        watch.guard()
        assert camera.grabbed.acquire(timeout=PATIENCE)
        with pytest.raises(CameraLostError, match="none left"):
            drive_on(watch)


def test_the_watch_tells_of_a_camera_that_hangs() -> None:
    hang = threading.Event()
    camera = Pictures(noise(), act=lambda: hang.wait(PATIENCE))
    with CameraWatch(camera, limit=0.05) as watch:
        with pytest.raises(CameraLostError, match="while the robot drives"):
            drive_on(watch)
        hang.set()


def test_a_watch_that_dies_is_heard_at_once_and_begins_anew_with_the_next_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    printed: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", printed.append)
    camera = Pictures(noise(), act=lambda: 1 / 0)
    with CameraWatch(camera, limit=60.0) as watch:
        for number in (1, 2):
            with pytest.raises(CameraLostError, match=r"watched no more: .* division by zero"):
                drive_on(watch)
            not_none(watch._thread).join(PATIENCE)
            assert len(printed) == number
        camera.act = lambda: None
        watch.guard()
        assert camera.grabbed.acquire(timeout=PATIENCE)


def test_the_end_of_the_watch_does_not_wait_for_a_picture() -> None:
    began, hang = threading.Event(), threading.Event()
    too_late: list[int] = []

    def act() -> None:
        began.set()
        if not hang.wait(3.0):
            too_late.append(1)

    camera = Pictures(noise(), act=act)
    with CameraWatch(camera, limit=60.0) as watch:
        watch.guard()
        assert began.wait(PATIENCE)
    assert not too_late
    hang.set()


def test_the_watch_ends_wherever_a_signal_comes() -> None:
    interrupted = True
    calls = 0
    while interrupted:
        calls += 1
        watch = CameraWatch(Pictures(*[noise()] * 1000), limit=60.0)
        watch.__enter__()
        watch.guard()
        try:
            interrupt_after(calls)
            watch.guard()
            interrupted = False
        except KeyboardInterrupt:
            pass
        finally:
            sys.setprofile(None)
        end = threading.Thread(target=watch.__exit__, daemon=True)
        end.start()
        end.join(PATIENCE)
        assert not end.is_alive(), f"it hangs when a signal comes after call {calls}"
    assert calls > 3


def test_a_live_video_works_on_wherever_a_signal_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    device = FakeCapture()
    monkeypatch.setattr(device, "read", lambda: (True, noise()))
    camera = LiveVideoCamera("0", lambda _: device)
    interrupted, calls = True, 0
    while interrupted:
        calls += 1
        try:
            interrupt_after(calls)
            camera.grab()
            interrupted = False
        except KeyboardInterrupt:
            pass
        finally:
            sys.setprofile(None)
        assert camera.grab().image is not None, f"after call {calls}"
    end = threading.Thread(target=camera.close, daemon=True)
    end.start()
    end.join(PATIENCE)
    assert device.released
    assert calls > 3


def test_nothing_is_grabbed_while_nobody_drives() -> None:
    camera = Pictures(noise())
    with CameraWatch(camera):
        assert not camera.grabbed.acquire(timeout=0.1)


@pytest.mark.parametrize(("live", "limit"), [(False, 0.2), (True, 0.0)])
def test_recordings_and_watches_without_a_limit_are_left_alone(live: bool, limit: float) -> None:
    camera = Pictures(noise(), live=live)
    with CameraWatch(camera, limit) as watch:
        watch.guard()
        assert not camera.grabbed.acquire(timeout=0.1)
