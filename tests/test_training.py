"""Training over a real (emulated) line: phases, collisions, checkpoints, resuming."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from as_type import as_type
from planning import square

from macor_hil.errors import CameraError, MapError, RobotError
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.odometry import Wheels
from macor_hil.mind.brain import Brain
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.checkpoints import checkpoint_path, train_map
from macor_hil.runs.recovery import Ask, TrainingRecovery
from macor_hil.runs.training import Recovery, Schedule, SessionKind

PORT = "khepera://corridor?seed=3"
SHORT = Schedule(tuning=20, random=60, reactive=20, session=20, episode=15, seed=5)
SETTINGS = MindSettings(nodes=12)


class StopHereError(Exception):
    """Stands for whatever ends a training early."""


def train(path: Path, schedule: Schedule = SHORT, stop_at: int | None = None) -> Brain:
    def progress(done: int) -> None:
        if done == stop_at:
            raise StopHereError

    with open_hardware(PORT) as hardware:
        devices = Driver(hardware.robot), hardware.camera, hardware.bench
        return train_map(path, SETTINGS, schedule, PORT, devices, progress)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A short training without interruption."""
    path = tmp_path_factory.mktemp("maps") / "whole.npz"
    train(path)
    return path.read_bytes()


def test_sessions_cover_all_commands_in_the_paper_s_order() -> None:
    sessions = Schedule(tuning=400, random=1100, reactive=300, session=250).sessions()
    assert [s.length for s in sessions] == [400, 250, 250, 250, 250, 100, 250, 50]
    assert [s.start for s in sessions] == [0, 400, 650, 900, 1150, 1400, 1500, 1750]
    assert [s.kind for s in sessions] == [SessionKind.TUNING] + [SessionKind.RANDOM] * 5 + [
        SessionKind.REACTIVE
    ] * 2
    assert [s.number for s in sessions] == list(range(8))


def test_training_learns_one_transition_a_command(tmp_path: Path) -> None:
    brain = train(tmp_path / "a.npz")
    assert (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum()
        == SHORT.random + SHORT.reactive
    )
    assert 0 < brain.clusterer.size <= 12
    assert as_type(PanoramaEyes, brain.eyes).fields.high != (1.0, 1.0, 1.0)
    assert not checkpoint_path(tmp_path / "a.npz").exists()


@pytest.mark.parametrize("stop_at", [7, 20, 55, 99])
def test_an_interrupted_training_ends_with_the_same_map(
    tmp_path: Path, unbroken: bytes, stop_at: int
) -> None:
    path = tmp_path / "a.npz"
    with pytest.raises(StopHereError):
        train(path, stop_at=stop_at)
    assert not path.exists()
    train(path)
    assert path.read_bytes() == unbroken


def test_a_killed_training_loses_at_most_its_last_session(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    code = (
        "import os, signal, sys; sys.path.insert(0, sys.argv[2]); import test_training as t;"
        "from pathlib import Path; p = Path(sys.argv[1]);"
        "t.train_killing_itself(p, 70)"
    )
    here = str(Path(__file__).parent)
    done = subprocess.run([sys.executable, "-c", code, str(path), here], check=False)
    assert done.returncode == -signal.SIGKILL
    brain, training = load_map(checkpoint_path(path))
    assert training["sessions"] == 3  # 60 of the 70 commands
    assert square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum() == 40
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.npz.part"]


def train_killing_itself(path: Path, at: int) -> None:
    """For a process of its own: SIGKILL in mid-training."""

    def progress(done: int) -> None:
        if done == at:
            os.kill(os.getpid(), signal.SIGKILL)

    with open_hardware(PORT) as hardware:
        devices = Driver(hardware.robot), hardware.camera, hardware.bench
        train_map(path, SETTINGS, SHORT, PORT, devices, progress)


def test_a_checkpoint_of_another_training_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with pytest.raises(StopHereError):
        train(path, stop_at=50)
    with pytest.raises(MapError, match="schedule differ"):
        train(path, replace(SHORT, seed=6))


@pytest.mark.parametrize(
    "drive", [DriveSettings(wheels=Wheels(base=0.0535)), DriveSettings(speed=10)]
)
def test_a_checkpoint_of_other_wheels_or_speeds_is_refused(
    tmp_path: Path, drive: DriveSettings
) -> None:
    with pytest.raises(StopHereError):
        train(tmp_path / "a.npz", stop_at=50)
    with open_hardware(PORT) as hardware:
        devices = Driver(hardware.robot, drive), hardware.camera, hardware.bench
        with pytest.raises(MapError, match=r"wheels or speeds differ.*--profile.*--restart"):
            train_map(tmp_path / "a.npz", SETTINGS, SHORT, PORT, devices, lambda _: None)


def test_driving_back_recovers_without_any_reset(tmp_path: Path) -> None:
    backing = replace(SHORT, random=150, recovery=Recovery.BACK, session=170)
    with open_hardware(PORT) as hardware:
        devices = Driver(hardware.robot), hardware.camera, None
        brain = train_map(tmp_path / "a.npz", SETTINGS, backing, PORT, devices, lambda _: None)
        assert hardware.bench is not None
        assert not hardware.bench.truth().touched
    z, w_r = (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), what)
        for what in ("z", "w_r")
    )
    assert z.sum() == 170
    # it did collide, and went on
    assert np.count_nonzero((w_r < 0.4) & (z > 0)) > 0


BACKING = replace(SHORT, random=60, reactive=0, recovery=Recovery.BACK, session=40)


def train_on_a_robot(
    path: Path,
    fail_at: tuple[int, ...] = (),
    stop_at: int | None = None,
    ask: Ask | None = None,
    failure: type[Exception] = RobotError,
) -> Brain:
    """A training without any reset, on a robot that fails at times."""
    with open_hardware(PORT) as hardware:
        moves: list[tuple[int, int]] = []
        go_to = hardware.robot.go_to

        def failing(left: int, right: int) -> None:
            moves.append((left, right))
            go_to(left, right)
            if len(moves) in fail_at:
                raise failure("it failed")

        def progress(done: int) -> None:
            if done == stop_at:
                raise StopHereError

        hardware.robot.go_to = failing  # type: ignore[method-assign]
        eyes: Any = hardware.camera  # it would be checked in a training of its own
        devices = Driver(hardware.robot), hardware.camera, None
        rescue = TrainingRecovery(hardware.robot, eyes, ask, patience=1.0)
        return train_map(path, SETTINGS, BACKING, PORT, devices, progress, rescue, 1)


@pytest.mark.parametrize("failure", [RobotError, CameraError])
def test_a_training_without_reset_gets_over_failures_and_learns_nothing_from_them(
    tmp_path: Path, failure: type[Exception]
) -> None:
    # some of the moves that fail lead back from a collision
    fail_at = 7, *range(30, 150, 6)
    brain = train_on_a_robot(tmp_path / "a.npz", fail_at=fail_at, failure=failure)
    assert (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum() == BACKING.random
    )
    assert not checkpoint_path(tmp_path / "a.npz").exists()


@pytest.mark.parametrize("stop_at", [9, 20, 33, 61])
def test_sessions_on_a_robot_add_up_to_one_map(tmp_path: Path, stop_at: int) -> None:
    path = tmp_path / "a.npz"
    with pytest.raises(StopHereError):
        train_on_a_robot(path, stop_at=stop_at)
    brain, training = load_map(checkpoint_path(path))
    driven = {0: 0, 1: 20, 2: 60}[training["sessions"]] + training.get("done", 0)
    assert driven in (stop_at, stop_at - 1)  # what a session ends with is kept when it has ended
    assert square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum() == max(
        0, driven - 20
    )
    known = as_type(SensorimotorMap, train_on_a_robot(path).memories["transitions"])
    assert square(known, "z").sum() == BACKING.random


def test_a_full_disk_is_waited_out_with_a_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    save = save_map

    def full(path: Path, *rest: Any) -> None:
        if len(asked) < 2:
            raise MapError(f"cannot write {path}: No space left on device")
        save(path, *rest)

    monkeypatch.setattr("macor_hil.runs.learning.checkpoints.save_map", full)
    brain = train_on_a_robot(tmp_path / "a.npz", ask=asked.append)
    assert len(asked) == 2
    assert "No space left on device. The robot stands; make room" in asked[0]
    assert (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum() == BACKING.random
    )


def test_without_a_hand_a_full_disk_ends_the_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: Any) -> None:
        raise MapError(f"cannot write {path}: No space left on device")

    monkeypatch.setattr("macor_hil.runs.learning.checkpoints.save_map", full)
    with pytest.raises(MapError, match="No space left"):
        train_on_a_robot(tmp_path / "a.npz")


def test_a_robot_that_stays_away_is_seen_to_by_hand() -> None:
    class Away:
        clock = staticmethod(count().__next__)
        wait = staticmethod(lambda _: None)
        hands = 0

        def recover(self, patience: float) -> bool:
            if not self.hands:
                raise RobotError(f"silent for {patience} s")
            return False

    class Seeing:
        worked = True

        def grab(self) -> None:
            pass

    robot = Away()

    def help_it(_: str) -> None:
        robot.hands += 1

    TrainingRecovery(robot, Seeing(), help_it).recover(RobotError("it failed"))  # type: ignore[arg-type]
    assert robot.hands == 1
    robot.hands = 0
    with pytest.raises(RobotError, match="silent"):
        TrainingRecovery(robot, Seeing()).recover(RobotError("it failed"))  # type: ignore[arg-type]
