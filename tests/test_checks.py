"""Parts of this project pass the checks that authors run on theirs; broken ones do not."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from macor_hil.checks import (
    CheckError,
    check_camera,
    check_clusterer,
    check_eyes,
    check_memory,
    check_planner,
)
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras import Frame
from macor_hil.hardware.cameras.catalogue import CAMERAS
from macor_hil.hardware.devices import open_hardware
from macor_hil.mind.catalogue import CLUSTERERS, EYES, MEMORIES, PLANNERS
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.planners.reactive import Reactive


@pytest.mark.parametrize("name", PLANNERS.builtin)
def test_planners_pass(name: str) -> None:
    check_planner(PLANNERS.find(name))


@pytest.mark.parametrize("name", MEMORIES.builtin)
def test_memories_pass(name: str) -> None:
    check_memory(MEMORIES.find(name))


@pytest.mark.parametrize("name", CLUSTERERS.builtin)
def test_clusterers_pass(name: str) -> None:
    check_clusterer(CLUSTERERS.find(name))


@pytest.mark.parametrize("name", EYES.builtin)
def test_eyes_pass(name: str) -> None:
    check_eyes(EYES.find(name))


def test_cameras_pass(tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number}.png"), np.zeros((4, 4, 3), np.uint8))
    check_camera(CAMERAS.find("images"), str(tmp_path), missing=str(tmp_path / "none"))
    with open_hardware("khepera://corridor?seed=1") as hardware:
        check_camera(CAMERAS.find("port"), port=hardware.robot.port)


class Plain:
    """A camera that does what it should."""

    live = False
    times = 0.0, 1.0, 1.0
    numbers = 0, 1, 2
    dtype = np.uint8

    def __init__(self) -> None:
        self._left = list(zip(self.times, self.numbers, strict=True))
        self._image = np.zeros((4, 4, 3), self.dtype)

    def grab(self) -> Frame:
        return Frame(self._image.copy(), *self._left.pop(0))

    def close(self) -> None: ...


class Reusing(Plain):
    def grab(self) -> Frame:
        self._image += 1
        return Frame(self._image, *self._left.pop(0))


class Repeating(Plain):
    numbers = 0, 0, 1


class Backwards(Plain):
    times = 0.0, 2.0, 1.0


class Bright(Plain):
    dtype = np.float64  # type: ignore[assignment]


class Undecided(Plain):
    live = None  # type: ignore[assignment]


class Anything(Plain):
    def __init__(self, source: str = "") -> None:
        super().__init__()
        self.source = source


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        (Reusing, "a picture changes after it was given"),
        (Repeating, "numbers do not grow"),
        (Backwards, "times go back"),
        (Bright, "a picture is float64"),
        (Undecided, "does not say whether it is live"),
        (Anything, "it opens 'none' without a CameraError"),
    ],
)
def test_broken_cameras_do_not_pass(camera: Any, says: str) -> None:
    check_camera(Plain)
    with pytest.raises(CheckError, match=says):
        check_camera(camera, missing="none")


class NoMemory:
    def plan(self, _memory: Any, _now: Any) -> Plan:
        return Plan((None, None, None), None)


class Endless(Reactive):
    def plan(self, _memory: Any, _now: Any) -> Plan:
        return Plan((float("inf"), 0.0, 0.0), 0)


class Fickle(Reactive):
    turn = 0.0

    def plan(self, _memory: Any, _now: Any) -> Plan:
        self.turn += 1.0
        return Plan((self.turn, 0.0, 0.0), 0)


class Changing(Reactive):
    def plan(self, _memory: Any, _now: Any) -> Plan:
        _memory.adapt(0, 1, 0.5)
        return Plan((0.0, 0.0, 0.0), 0)


@pytest.mark.parametrize(
    ("planner", "says"),
    [
        (NoMemory, "no attribute `memory`"),
        (Endless, "not finite"),
        (Fickle, "two different plans"),
        (Changing, "planning changes the memory"),
    ],
)
def test_broken_planners_do_not_pass(planner: Any, says: str) -> None:
    with pytest.raises(CheckError, match=says):
        check_planner(planner)


class Forgetful(SensorimotorMap):
    def load(self, state: Any) -> None:
        super().load({**state, "w_r": np.zeros_like(state["w_r"])})


class Restless(FuzzyArt):
    def present(self, x: Any, learn: bool = True) -> Any:  # noqa: ARG002
        return super().present(x, learn=True)


class Staring(PanoramaEyes):
    def mirrored(self, x: Any) -> Any:
        return np.zeros_like(x)


def test_other_broken_parts_do_not_pass() -> None:
    with pytest.raises(CheckError, match="does not come back"):
        check_memory(Forgetful)
    with pytest.raises(CheckError, match="learns although it is told not to"):
        check_clusterer(Restless, vigilance=0.5)
    with pytest.raises(CheckError, match="mirror image"):
        check_eyes(Staring)


class Unexplained(Reactive):
    def __init__(self, haste) -> None:  # type: ignore[no-untyped-def]  # noqa: ARG002
        super().__init__()


def test_a_setting_needs_a_type_and_a_default() -> None:
    with pytest.raises(MacorError, match="haste of Unexplained needs an annotation"):
        check_planner(Unexplained)
