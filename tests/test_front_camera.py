"""A robot's own camera, which looks ahead: its pictures over the line, and eyes for them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from as_type import not_none
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Pose, Reset
from typer.testing import CliRunner

from macor_hil.checks import check_eyes
from macor_hil.cli.program import app
from macor_hil.errors import CameraError, CameraLostError
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, limits_of
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.robots.epuck.readings import image_of
from macor_hil.mind.eyes.front import FrontEyes
from macor_hil.mind.eyes.opponent import CHANNELS
from macor_hil.mind.eyes.panorama import PanoramaEyes


def port(model: str, arena: str = "corridor") -> str:
    return f"khepera://{arena}?model={model}&seed=1"


@pytest.mark.parametrize(
    ("model", "size"), [("epuck", (30, 40)), ("epuck2&profile=wifi", (120, 160))]
)
def test_pictures_come_over_the_line(model: str, size: tuple[int, int]) -> None:
    with open_hardware(port(model), "own", baud=115_200) as hardware:
        first, second = hardware.camera.grab(), hardware.camera.grab()
        assert first.image.shape == (*size, 3)
        assert (first.sequence, second.sequence) == (0, 1)
        # a wall of the corridor is yellow: much red and green, little blue
        blue, green, red = first.image[size[0] // 4].mean(axis=0)
        assert blue < green < red or blue < red < green
        driver = Driver(hardware.robot)
        driver.start()
        assert not driver.leg(0.01, 0.0).collided


def test_a_picture_is_asked_for_anew_after_a_reset() -> None:
    with open_hardware(port("epuck"), "own", baud=115_200) as hardware:
        assert hardware.camera.grab().image.shape == (30, 40, 3)
        not_none(hardware.bench).reset(Reset(pose=Pose(x=0.1, y=0.0, heading=0.0)))
        assert hardware.camera.grab().image.shape == (30, 40, 3)


def test_a_khepera_has_no_camera_of_its_own() -> None:
    with (
        pytest.raises(CameraError, match="'own' is a robot's own"),
        open_hardware("khepera://corridor", "own"),
    ):
        raise AssertionError("a camera was found")


def test_look_draws_its_picture(tmp_path: Path) -> None:
    picture = tmp_path / "ahead.png"
    options = ["--port", port("epuck2"), "--camera", "own", "--baud", "115200"]
    done = CliRunner().invoke(app, ["look", *options, "--picture", str(picture)])
    assert (done.exit_code, done.stdout) == (0, f"{picture}\n")
    shown = not_none(cv2.imread(str(picture)))
    yellow = (shown[..., 2] > shown[..., 0] + 30.0) & (shown[..., 1] > shown[..., 0] + 30.0)
    assert yellow.mean() > 0.2  # a wall of the corridor


def test_eyes_for_it_are_named_where_others_do_not_fit() -> None:
    with (
        open_hardware(port("epuck"), "own", baud=115_200) as hardware,
        pytest.raises(CameraError, match="looks ahead is for --eyes front"),
    ):
        CheckedCamera(hardware.camera, limits_of(PanoramaEyes(Mirror()))).grab()


def test_a_failing_line_is_a_lost_camera() -> None:
    with open_hardware(port("epuck2"), "own", baud=115_200) as hardware:
        hardware.robot.port.emulator.robot.picture = lambda _: b""
        with pytest.raises(CameraLostError, match="the robot sent no picture"):
            hardware.camera.grab()


def test_rgb565_is_blue_green_red() -> None:
    # red, green, blue, white
    pixels = bytes([0xF8, 0x00, 0x07, 0xE0, 0x00, 0x1F, 0xFF, 0xFF])
    assert image_of(pixels, 4, 1).tolist() == [
        [[0, 0, 248], [0, 252, 0], [248, 0, 0], [248, 252, 248]]
    ]


def test_front_eyes_are_eyes() -> None:
    check_eyes(FrontEyes)
    check_eyes(FrontEyes, across=3, rows=1)


def test_fields_lie_in_the_picture_as_they_are_named() -> None:
    image = np.zeros((30, 40, 3), np.uint8)
    image[15:, :10] = 255  # below on the left
    eyes = FrontEyes()
    grey = eyes.look(image).reshape(2, 6, len(CHANNELS))[..., 0]
    assert grey.argmax() == 6  # the first field of the lower row
    assert grey[0].max() == 0.0
    other = eyes.look(image[:, ::-1])
    assert eyes.mirrored(other) == pytest.approx(eyes.look(image))


def test_a_wall_may_fill_all_that_is_seen() -> None:
    with open_hardware(port("epuck2"), "own", baud=115_200) as hardware:
        bench = not_none(hardware.bench)
        start = bench.truth().pose
        bench.reset(Reset(pose=start.model_copy(update={"heading": np.pi / 2})))
        eyes = CheckedCamera(hardware.camera, limits_of(FrontEyes()))
        assert eyes.grab().image.shape == (30, 40, 3)


def test_a_picture_smaller_than_its_fields_is_refused() -> None:
    with pytest.raises(CameraError, match="too small for 6 x 2 fields"):
        FrontEyes().look(np.zeros((1, 40, 3), np.uint8))
