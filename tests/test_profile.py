"""Profiles of robots, and the mirror that is found in a picture."""

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from khepera_protocol.mirror import Mirror

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.robot.emulator import Emulator, Setup
from macor_hil.errors import CameraError, ProfileError
from macor_hil.hardware.cameras.mirror_fit import draw_mirror, find_mirror
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.profile import RobotProfile, change_profile, load_profile, save_profile

SHIFTED = Mirror(width=200, height=180, centre_x=105.3, centre_y=86.7, inner=20.5, outer=71.2)


@pytest.fixture(scope="module", params=["corridor", "open-box"])
def seen(request: pytest.FixtureRequest) -> Iterator[np.ndarray]:
    emulator = Emulator(Setup(arena=load_arena(request.param), mirror=SHIFTED, seed=3))
    yield emulator.mirror_image()
    emulator.close()


def assert_found(mirror: Mirror, tolerance: float = 0.7) -> None:
    for name in ("centre_x", "centre_y", "inner", "outer"):
        assert getattr(mirror, name) == pytest.approx(getattr(SHIFTED, name), abs=tolerance), name
    assert (mirror.width, mirror.height) == (200, 180)


def test_the_mirror_is_found_to_a_pixel(seen: np.ndarray) -> None:
    assert_found(find_mirror(seen))


@pytest.mark.parametrize("share", [0.4, 1.6])
def test_the_mirror_is_found_in_dim_and_in_bright_pictures(seen: np.ndarray, share: float) -> None:
    assert_found(find_mirror(np.clip(seen * share, 0, 255).astype(np.uint8)))


def test_a_cable_before_the_mirror_and_a_lamp_beside_it_do_no_harm(seen: np.ndarray) -> None:
    image = seen.copy()
    cv2.line(image, (105, 0), (105, 60), (0, 0, 0), 5)
    cv2.circle(image, (6, 6), 4, (255, 255, 255), -1)
    assert_found(find_mirror(image), 1.0)


@pytest.mark.parametrize("level", [0, 120])
def test_a_picture_without_a_mirror_is_refused(level: int) -> None:
    noise = np.random.default_rng(0).integers(0, 9, (160, 160, 3))
    with pytest.raises(CameraError, match="no mirror is found"):
        find_mirror((noise + level).astype(np.uint8))


def test_the_drawing_shows_rims_in_yellow(seen: np.ndarray) -> None:
    drawn = draw_mirror(seen, SHIFTED)
    assert drawn.shape == (540, 600, 3)
    rim = drawn[round(87.2 * 3), round((105.8 + 71.2) * 3) - 3 :][:6]
    assert any(blue < 80 and red > 150 and green > 150 for blue, green, red in rim)


def test_a_profile_comes_back_as_it_was_saved(tmp_path: Path) -> None:
    profile = RobotProfile(SHIFTED, Wheels(8.1e-5, 7.9e-5, 0.0541), {"wheels": "a square"})
    path = tmp_path / "robot.json"
    save_profile(path, profile)
    assert load_profile(path) == profile
    assert [entry.name for entry in tmp_path.iterdir()] == ["robot.json"]


def test_what_is_measured_later_leaves_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "robot.json"
    change_profile(path, ("mirror", "from a picture"), mirror=SHIFTED)
    changed = change_profile(path, ("wheels", "a square"), wheels=Wheels(base=0.05))
    assert load_profile(path) == changed
    assert changed.mirror == SHIFTED
    assert changed.notes == {"mirror": "from a picture", "wheels": "a square"}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda data: data.update(format="cake"), "does not say that it is one"),
        (lambda data: data.update(version=2), "of version 2, this program reads version 1"),
        (lambda data: data["wheels"].update(left="wide"), "damaged: wheels.left"),
        (lambda data: data["wheels"].update(base=0.0), "wheels.base should be .*, not 0.0"),
    ],
)
def test_a_profile_that_cannot_be_used_says_why(
    tmp_path: Path, change: Callable[..., Any], says: str
) -> None:
    path = tmp_path / "robot.json"
    save_profile(path, RobotProfile())
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises(ProfileError, match=says):
        load_profile(path)


def test_no_profile_and_no_json_are_named(tmp_path: Path) -> None:
    with pytest.raises(ProfileError, match="there is no profile"):
        load_profile(tmp_path / "none.json")
    (tmp_path / "cake.json").write_bytes(b"flour")
    with pytest.raises(ProfileError, match="is not a robot's profile"):
        load_profile(tmp_path / "cake.json")


def test_wheels_of_their_own_change_counts_and_nothing_else() -> None:
    plain = Wheels()
    assert plain.counts(0.08, 0.0) == pytest.approx((1000.0, 1000.0))
    unequal = replace(plain, left=plain.left * 1.25)
    assert unequal.counts(0.08, 0.0) == pytest.approx((800.0, 1000.0))
