"""Cameras by one string, and pictures that must not be acted upon."""

import sys
import threading
import time
from queue import SimpleQueue

import cv2
import numpy as np
import pytest
from controller_helpers import PATIENCE, free_endpoint, watching

from macor_hil.cameras import Frame, open_camera
from macor_hil.cameras.checks import CheckedCamera, PictureLimits
from macor_hil.cameras.live_video import LiveVideoCamera, is_device
from macor_hil.cameras.watch import CameraWatch
from macor_hil.errors import (
    CameraDarkError,
    CameraError,
    CameraFrozenError,
    CameraLateError,
    CameraLostError,
    WrongPictureError,
)
from macor_hil.telemetry.session import open_session
from protocol.side_channel import Stamp


def noise(seed=0, shape=(16, 16, 3)):
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def opened(name, session=None):
    return open_camera(name, port=None, session=session, robot="khepera")


def test_a_folder_of_images_is_shown_in_the_order_of_names(tmp_path):
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


def test_a_folder_with_a_broken_picture_says_which(tmp_path):
    (tmp_path / "a.png").write_bytes(b"flour")
    with pytest.raises(CameraError, match=r"cannot read the picture .*a\.png"):
        opened(f"images:{tmp_path}").grab()


@pytest.mark.parametrize(("name", "says"), [("empty", "no pictures"), ("none", "cannot read")])
def test_a_folder_without_pictures_is_refused(tmp_path, name, says):
    (tmp_path / "empty").mkdir()
    with pytest.raises(CameraError, match=says):
        opened(f"images:{tmp_path / name}")


def test_a_video_file_is_shown_to_its_end(tmp_path):
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
def test_what_shows_the_present(name, device):
    assert is_device(name) == device


class FakeCapture:
    """A video device that gives what is put into it, and waits meanwhile."""

    def __init__(self, opened=True):
        self.pictures = SimpleQueue()
        self.opened = opened
        self.released = False
        self.reads = threading.Semaphore(0)

    def isOpened(self):
        return self.opened

    def read(self):
        self.reads.release()
        picture = self.pictures.get(timeout=PATIENCE)
        return picture is not None, picture

    def release(self):
        self.released = True


def test_a_live_video_gives_no_picture_that_was_begun_before_it_was_asked_for():
    device = FakeCapture()
    camera = LiveVideoCamera("0", lambda _: device)
    device.reads.acquire()  # it is being read
    got = SimpleQueue()
    thread = threading.Thread(target=lambda: got.put(camera.grab()))
    thread.start()
    while not camera._came._waiters:  # until it waits
        pass
    device.pictures.put(noise(1))
    device.pictures.put(noise(2))
    np.testing.assert_array_equal(got.get(timeout=PATIENCE).image, noise(2))
    thread.join()
    device.pictures.put(noise(3))
    camera.close()
    assert device.released


def test_a_live_video_that_was_unplugged_is_opened_again():
    devices = [FakeCapture(), FakeCapture()]
    for device in devices:
        device.pictures.put(None)
    for number in range(3):
        devices[1].pictures.put(noise(number))
    devices[1].pictures.get()
    left = iter(devices)
    camera = LiveVideoCamera("0", lambda _: next(left))
    np.testing.assert_array_equal(camera.grab().image[0, 0], camera._newest.image[0, 0])
    assert devices[0].released
    devices[1].pictures.put(noise(9))
    camera.close()


def test_a_video_device_that_is_not_there_is_named():
    with pytest.raises(CameraError, match="cannot open the video source '7'"):
        LiveVideoCamera("7", lambda _: FakeCapture(opened=False))


PNG = cv2.imencode(".png", noise())[1].tobytes()


def test_a_source_that_only_publishes_is_heard():
    endpoint = free_endpoint()
    with watching(endpoint) as (watcher,), open_session([endpoint], []) as source:
        camera = opened("zenoh:any/key", watcher)
        got = SimpleQueue()
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
def test_an_answer_that_is_no_picture_is_named(payload, attachment, says):
    endpoint = free_endpoint()
    with open_session([endpoint], []) as source, watching(endpoint) as (watcher,):

        def answer(query):
            with query:
                query.reply("any/key", payload, attachment=attachment)

        camera = opened("zenoh:any/key", watcher)
        with (
            source.declare_queryable("any/key", answer),
            pytest.raises(WrongPictureError, match=says),
        ):
            camera.grab()


def test_an_answer_is_placed_by_its_stamp():
    endpoint = free_endpoint()
    stamp = Stamp(sequence=5, time=1.25).model_dump_json()
    with open_session([endpoint], []) as source, watching(endpoint) as (watcher,):

        def answer(query):
            with query:
                query.reply("any/key", PNG, attachment=stamp)

        with source.declare_queryable("any/key", answer):
            frame = opened("zenoh:any/key", watcher).grab()
    assert (frame.sequence, frame.time) == (5, 1.25)


class Pictures:
    """A camera that shows what it is given, then fails."""

    def __init__(self, *images, live=True, act=lambda: None):
        self.live = live
        self.images = list(images)
        self.act = act
        self.grabbed = threading.Semaphore(0)

    def grab(self):
        self.act()
        self.grabbed.release()
        if not self.images:
            raise CameraLostError("none left")
        image = self.images.pop(0) if len(self.images) > 1 else self.images[0]
        return Frame(image, 0.0, 0)

    def close(self):
        pass


LIMITS = PictureLimits(size=(16, 16))


@pytest.mark.parametrize(
    ("image", "error"),
    [
        (noise(shape=(16, 12, 3)), WrongPictureError),
        (noise(shape=(16, 16)), WrongPictureError),
        (noise() // 12, CameraDarkError),
    ],
)
def test_a_picture_that_cannot_be_used_is_named(image, error):
    with pytest.raises(error):
        CheckedCamera(Pictures(image), LIMITS).grab()


def test_a_night_with_a_lamp_in_it_is_not_dark():
    image = noise() // 12
    image[:8, :8] = 200
    assert CheckedCamera(Pictures(image), LIMITS).grab().image is image


def test_a_live_camera_that_shows_the_same_picture_again_is_frozen():
    camera = CheckedCamera(Pictures(noise(1), noise(2), noise(2), noise(3)), LIMITS)
    camera.grab()
    camera.grab()
    with pytest.raises(CameraFrozenError, match="bit for bit"):
        camera.grab()
    camera.grab()  # it thaws


def test_a_recording_may_show_the_same_picture_again():
    camera = CheckedCamera(Pictures(noise(), live=False), LIMITS)
    assert camera.grab() == camera.grab()


def test_a_picture_that_takes_too_long_is_late(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("macor_hil.cameras.checks.time.monotonic", lambda: now[0])

    def take():
        now[0] += 0.6

    with pytest.raises(CameraLateError, match=r"took 0\.60 s"):
        CheckedCamera(Pictures(noise(), act=take), LIMITS).grab()


def drive_on(watch):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        watch.guard()


def test_the_watch_tells_of_a_camera_that_fails_while_the_robot_drives():
    camera = Pictures()
    with CameraWatch(camera, limit=60.0) as watch:
        watch.guard()
        assert camera.grabbed.acquire(timeout=PATIENCE)
        with pytest.raises(CameraLostError, match="none left"):
            drive_on(watch)


def test_the_watch_tells_of_a_camera_that_hangs():
    hang = threading.Event()
    camera = Pictures(noise(), act=lambda: hang.wait(PATIENCE))
    with CameraWatch(camera, limit=0.05) as watch:
        with pytest.raises(CameraLostError, match="while the robot drives"):
            drive_on(watch)
        hang.set()


def interrupt_after(calls):
    """Have a KeyboardInterrupt come after so many calls of C functions, as a signal may."""
    left = calls

    def profile(_frame, event, _argument):
        nonlocal left
        left -= event == "c_return"
        if left == 0:
            sys.setprofile(None)
            raise KeyboardInterrupt

    sys.setprofile(profile)


def test_the_watch_ends_wherever_a_signal_comes():
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


def test_nothing_is_grabbed_while_nobody_drives():
    camera = Pictures(noise())
    with CameraWatch(camera):
        assert not camera.grabbed.acquire(timeout=0.1)


@pytest.mark.parametrize(("live", "limit"), [(False, 0.2), (True, 0.0)])
def test_recordings_and_watches_without_a_limit_are_left_alone(live, limit):
    camera = Pictures(noise(), live=live)
    with CameraWatch(camera, limit) as watch:
        watch.guard()
        assert not camera.grabbed.acquire(timeout=0.1)
