"""Profiles from outside: what no robot is like is neither read nor written."""

import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from damage import damaged
from hostile_inputs import Hostile
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.mirror import Mirror
from khepera_protocol.serial.units import PULSE, WHEEL_BASE

from macor_hil.errors import ProfileError
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.profile import RobotProfile, change_profile, load_profile, save_profile

NAN, INF = float("nan"), float("inf")
PROFILE = RobotProfile(Mirror(), Wheels(8.1e-5, 7.9e-5, 0.0541), {"wheels": "a square"})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    save_profile(tmp_path / "robot.json", PROFILE)
    return tmp_path / "robot.json"


def refused_or_good(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    try:
        profile = load_profile(path)
    except ProfileError as error:
        one_sentence(error, path)
    else:
        wheels = profile.wheels
        assert (
            PULSE / 2
            <= min(wheels.left, wheels.right)
            <= max(wheels.left, wheels.right)
            <= 2 * PULSE
        )
        assert WHEEL_BASE / 2 <= wheels.base <= 2 * WHEEL_BASE
        assert profile.mirror is None or profile.mirror.inner < profile.mirror.outer


def one_sentence(error: ProfileError, path: Path) -> None:
    assert str(path) in str(error)
    assert str(error).isprintable()
    assert len(str(error)) < 1000


def test_damaged_copies_of_a_profile(hostile: Hostile, path: Path) -> None:
    whole = path.read_bytes()

    @settings(max_examples=hostile.examples(200))
    @given(damaged(whole))
    def check(data: bytes) -> None:
        hostile.count("profiles")
        refused_or_good(path, data)

    check()


def test_profiles_with_odd_numbers(hostile: Hostile, path: Path) -> None:
    whole = json.loads(path.read_bytes())
    places = [(part, name) for part in ("wheels", "mirror") for name in whole[part]]
    odd = st.one_of(st.floats(), st.integers(), st.text(max_size=4), st.none(), st.booleans())

    @settings(max_examples=hostile.examples(200))
    @given(st.sampled_from(places), odd)
    def check(place: tuple[str, str], value: bool | float | str | None) -> None:
        hostile.count("profiles")
        part, name = place
        changed = {**whole, part: {**whole[part], name: value}}
        refused_or_good(path, json.dumps(changed).encode())

    check()


@pytest.mark.parametrize(
    "value", [NAN, INF, -INF, 0.0, -8e-5, 1e-300, 1e300, PULSE / 400, PULSE * 3]
)
@pytest.mark.parametrize("name", ["left", "right", "base"])
def test_wheels_that_no_robot_has_are_neither_read_nor_written(
    path: Path, name: str, value: float
) -> None:
    data = json.loads(path.read_bytes())
    data["wheels"][name] = value
    path.write_text(json.dumps(data))
    with pytest.raises(ProfileError, match=rf"is damaged: wheels.{name} should be"):
        load_profile(path)
    save_profile(path, PROFILE)
    with pytest.raises(ProfileError, match=rf"is not written.*wheels.{name} should be"):
        change_profile(path, ("wheels", "odd"), wheels=replace(Wheels(), **{name: value}))
    assert load_profile(path) == PROFILE


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"inner": 90.0}, "the inner rim must lie within the outer one"),
        ({"low": 1.0}, "low below high"),
        ({"width": 0}, "mirror.width"),
        ({"height": 10**9}, "mirror.height"),
        ({"centre_x": NAN}, "mirror.centre_x"),
        ({"outer": INF}, "mirror.outer"),
        ({"high": 90.0}, "mirror.high"),
        ({"size": 3}, "mirror.size: Unexpected"),
    ],
)
def test_mirrors_that_no_camera_has_are_not_read(
    path: Path, change: dict[str, float], says: str
) -> None:
    data = json.loads(path.read_bytes())
    data["mirror"].update(change)
    path.write_text(json.dumps(data))
    with pytest.raises(ProfileError, match=says):
        load_profile(path)


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"format": ' + "9" * 5000 + "}",
        '{"format": "khepera profile", "version": "\\u001b[2J"}',
        '{"format": "khepera profile", "version": 1, "wheelz": {}}',
        '{"format": "khepera profile", "version": 1, "notes": {"a": 1}}',
        '{"format": "khepera profile", "version": 1} ' + " " * 2_000_000,
        '"khepera profile"',
        "null",
        "",
    ],
)
def test_other_texts_are_refused_in_one_sentence(path: Path, text: str) -> None:
    path.write_text(text)
    with pytest.raises(ProfileError) as refused:
        load_profile(path)
    one_sentence(refused.value, path)


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for odd in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(ProfileError, match=r"not a regular file|Is a directory"):
            load_profile(odd)


def test_a_profile_that_can_be_written_can_be_read(hostile: Hostile, path: Path) -> None:
    factors = st.floats(0.5, 2.0)

    @settings(max_examples=hostile.examples(50))
    @given(factors, factors, factors)
    def check(left: float, right: float, base: float) -> None:
        hostile.count("profiles")
        wheels = Wheels(PULSE * left, PULSE * right, WHEEL_BASE * base)
        save_profile(path, replace(PROFILE, wheels=wheels))
        assert asdict(load_profile(path)) == asdict(replace(PROFILE, wheels=wheels))

    check()
