"""A live run that stays: it waits, backs off, learns on, and fails at once where nothing helps."""

import signal
import time
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from khepera_protocol.zenoh.controller_payloads import Decision
from made_once import made_once
from short_training import train_shortly

import macor_hil.hardware.devices
import macor_hil.runs.learning.learning_on
import macor_hil.runs.live_run
import macor_hil.runs.recovery
from khepera_emulator.ports.protocol_khepera import Serial
from macor_hil.errors import (
    CameraDarkError,
    CameraError,
    CameraLostError,
    LinkError,
    MacorError,
    MapError,
    WrongPictureError,
    WrongPortError,
    is_lost,
)
from macor_hil.hardware.cameras.camera import Camera, Frame
from macor_hil.hardware.cameras.catalogue import CameraAddress
from macor_hil.hardware.khepera import open_port
from macor_hil.hardware.robots.robot import Robot
from macor_hil.hardware.way_out import drive_away
from macor_hil.mind.brain import Brain
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.runs.learning.learning_on import LIVED
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import AfterCollision, RunOptions
from macor_hil.runs.run_reporter import Ending
from macor_hil.safety.claim import claim

PORT = "khepera://corridor?seed=1&drift=none"
SOON = 0.5
"""Seconds of the robot's time within which it must stand."""

SETTLED = 0.004
"""m/s: half a unit of the speed controller."""


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, random=80)

    return made_once(tmp_path_factory, "map-of-service", train) / "short.npz"


@pytest.fixture
def map_file(trained: Path, tmp_path: Path) -> Path:
    """A map of one's own, to be written."""
    copy = tmp_path / "own.npz"
    copy.write_bytes(trained.read_bytes())
    return copy


@pytest.fixture
def options(trained: Path) -> RunOptions:
    """Six commands on an embedded robot, unwatched; it never gives up."""
    return RunOptions(
        port=PORT,
        map_file=trained,
        commands=6,
        listen=(),
        connect=(),
        wait=inf,
        recovery=inf,
        after_collision=AfterCollision.BACK_OFF,
    )


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is slept."""
    monkeypatch.setattr(macor_hil.runs.recovery, "_PAUSE", 0.0)


def changed(options: RunOptions, **values: Any) -> RunOptions:
    return options.model_copy(update=values)


def transitions(path: Path) -> int:
    """Adaptations of all transitions of a map."""
    memory = load_map(path)[0].memories["transitions"]
    assert isinstance(memory, SensorimotorMap)
    return int(memory.transitions().z.sum())


# collisions


def test_after_a_collision_the_robot_backs_off_and_drives_on(options: RunOptions) -> None:
    heard: list[Decision] = []
    report = serve(changed(options, planner="reactive", commands=30), heard.append)
    assert (report.ending, report.commands) == (Ending.COMMANDS, 30)
    assert report.collisions == sum(decision.collided for decision in heard) > 0
    assert not report.collided
    assert not heard[-1].collided or report.collisions > 1


def test_a_collision_ends_the_run_where_nothing_else_is_said(options: RunOptions) -> None:
    stop = changed(options, planner="reactive", commands=60, after_collision=AfterCollision.STOP)
    report = serve(stop)
    assert report.collided
    assert report.collisions == 1
    assert report.commands < 60


def test_odometry_follows_the_robot_while_it_backs_off(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports = opened(monkeypatch)
    apart: list[float] = []

    def compare(decision: Decision) -> None:
        pose, truth = decision.odometry.pose, ports[0].emulator.truth().pose
        apart.append(float(np.hypot(pose.x - truth.x, pose.y - truth.y)))

    start = serve_start(options)
    report = serve(changed(options, planner="reactive", commands=10), compare, start)
    assert report.collisions == 1
    assert max(apart) < 0.003


def serve_start(options: RunOptions) -> Any:
    """The pose in which the robot of a run begins."""
    with open_port(options.port) as port:
        return port.emulator.truth().pose


def opened(monkeypatch: pytest.MonkeyPatch) -> list[Serial]:
    """The ports that are opened from now on."""
    ports: list[Serial] = []

    def opening(*arguments: Any) -> Any:
        ports.append(open_port(*arguments))
        return ports[-1]

    monkeypatch.setattr(macor_hil.hardware.devices, "open_port", opening)
    return ports


def test_a_signal_while_the_robot_backs_off_stops_it(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports, told = opened(monkeypatch), list[float]()

    def interrupted(driver: Any, *arguments: Any, **more: Any) -> None:
        port = ports[0]
        write = port.write

        def meddle(data: bytes) -> int:
            count: int = write(data)
            if not told and max(map(abs, port.emulator.truth().speed)) > 0.05:
                told.append(port.emulator.now)
                signal.raise_signal(signal.SIGTERM)
            return count

        monkeypatch.setattr(port, "write", meddle)
        drive_away(driver, *arguments, **more)

    monkeypatch.setattr(macor_hil.runs.live_run, "drive_away", interrupted)
    speeds: list[float] = []
    watch_closing(ports, speeds, monkeypatch)
    report = serve(changed(options, planner="reactive", commands=0))
    assert (report.ending, report.signal) == (Ending.INTERRUPTED, "SIGTERM")
    (stood,) = speeds
    assert stood - told[0] < SOON


def watch_closing(ports: list[Serial], times: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Note the robot's time when a standing robot is switched off."""
    close = Serial.close

    def closing(port: Serial) -> None:
        if port in ports and port.is_open:
            assert max(map(abs, port.emulator.truth().speed)) < 2 * SETTLED
            times.append(port.emulator.now)
        close(port)

    monkeypatch.setattr(Serial, "close", closing)


def test_a_run_without_end_ends_when_it_is_told_to(options: RunOptions) -> None:
    def end(decision: Decision) -> None:
        if decision.sequence == 41:
            signal.raise_signal(signal.SIGTERM)

    report = serve(changed(options, commands=0), end)
    assert (report.ending, report.signal, report.commands) == (Ending.INTERRUPTED, "SIGTERM", 42)


# waiting


class NotYet:
    """Opens a port or takes a picture after some failures."""

    def __init__(self, real: Callable[..., Any], *failures: Exception) -> None:
        self.real, self.failures = real, list(failures)

    def __call__(self, *arguments: Any, **more: Any) -> Any:
        if self.failures:
            raise self.failures.pop(0)
        return self.real(*arguments, **more)


def test_a_port_that_is_not_there_yet_is_waited_for(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    gone = [LinkError("no adapter"), LinkError("no adapter"), LinkError("no robot")]
    monkeypatch.setattr(macor_hil.hardware.devices, "open_port", NotYet(open_port, *gone))
    assert serve(options).ending is Ending.COMMANDS
    said = [record.getMessage() for record in caplog.records]
    assert said == ["waiting: no adapter", "waiting: no robot"]


def test_a_camera_that_is_not_there_yet_is_waited_for(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Late:
        live = False

        def __init__(self, camera: Camera) -> None:
            dark = [CameraLostError("no picture"), CameraDarkError("the lens is covered")]
            self.grab = NotYet(camera.grab, *dark)
            self.close = camera.close

    real = CameraAddress.open
    monkeypatch.setattr(CameraAddress, "open", lambda *a, **k: Late(real(*a, **k)))
    assert serve(options).ending is Ending.COMMANDS


def test_without_waiting_what_is_not_there_is_an_error_at_once(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        macor_hil.hardware.devices, "open_port", NotYet(open_port, LinkError("no adapter"))
    )
    with pytest.raises(LinkError, match="no adapter") as caught:
        serve(changed(options, wait=0.0))
    assert is_lost(caught.value)


def test_a_signal_ends_the_waiting(options: RunOptions, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        signal.raise_signal(signal.SIGTERM)
        raise AssertionError

    monkeypatch.setattr(macor_hil.hardware.devices, "open_port", never)
    report = serve(options)
    assert (report.ending, report.signal, report.commands) == (Ending.INTERRUPTED, "SIGTERM", 0)


@pytest.mark.parametrize(
    "port",
    ["khepera://nowhere", "khepera://corridor?sed=1", "none://robot"],
)
def test_a_port_that_never_will_be_is_not_waited_for(options: RunOptions, port: str) -> None:
    with pytest.raises(WrongPortError) as caught:
        serve(changed(options, port=port))
    assert not is_lost(caught.value)


def test_a_camera_of_another_size_is_not_waited_for(options: RunOptions, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.full((80, 80, 3), 99, np.uint8))
    with pytest.raises(WrongPictureError, match="80") as caught:
        serve(changed(options, camera=f"images:{tmp_path}"))
    assert not is_lost(caught.value)


@pytest.mark.parametrize("camera", ["video:none.mp4", "images:none", "eye"])
def test_a_camera_that_never_will_be_is_not_waited_for(
    options: RunOptions, camera: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sleep(_: float) -> None:
        pytest.fail("it waits")

    monkeypatch.setattr(time, "sleep", sleep)
    with pytest.raises(CameraError) as caught:
        serve(changed(options, camera=camera))
    assert not is_lost(caught.value)


def test_a_map_that_cannot_be_used_is_not_waited_for(options: RunOptions, tmp_path: Path) -> None:
    with pytest.raises(MapError, match="there is no map") as caught:
        serve(changed(options, map_file=tmp_path / "none.npz"))
    assert not is_lost(caught.value)


def failing(pictures: int, failures: int) -> Callable[[Camera], Any]:
    class Failing:
        live = False

        def __init__(self, camera: Camera) -> None:
            self.camera, self.taken = camera, 0
            self.close = camera.close

        def grab(self) -> Frame:
            self.taken += 1
            # every second one works: recovery succeeds, and the next look fails
            if pictures < self.taken <= pictures + 2 * failures and (self.taken - pictures) % 2:
                raise CameraLostError("a loose contact")
            return self.camera.grab()

    return Failing


@pytest.mark.parametrize(("recovery", "gives_up"), [(30.0, True), (inf, False)])
def test_failures_in_a_row_end_a_run_unless_it_never_gives_up(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch, recovery: float, gives_up: bool
) -> None:
    pauses: list[float] = []
    monkeypatch.setattr(macor_hil.runs.live_run, "pause", lambda s, _: pauses.append(s))
    real, make = CameraAddress.open, failing(3, 8)
    monkeypatch.setattr(CameraAddress, "open", lambda *a, **k: make(real(*a, **k)))
    limited = changed(options, recovery=recovery)
    if gives_up:
        with pytest.raises(CameraLostError):
            serve(limited)
    else:
        assert serve(limited).recoveries == 8
        assert pauses == [2.0, 4.0, 8.0]


def fail_after_recovery(monkeypatch: pytest.MonkeyPatch, failures: int) -> None:
    """Let the robot fail at its first request after each of so many recoveries."""
    left = [LinkError("a loose contact")] * failures
    recover = macor_hil.runs.recovery.wait_until_both_work

    def recovered(robot: Robot, *more: Any) -> None:
        recover(robot, *more)
        if left:
            monkeypatch.setattr(robot, "counters", NotYet(robot.counters, left.pop()))

    monkeypatch.setattr(macor_hil.runs.live_run, "wait_until_both_work", recovered)


@pytest.mark.parametrize(
    ("recovery", "failures", "stood"),
    [(30.0, 1, []), (30.0, 4, []), (inf, 4, []), (inf, 10, [2.0, 4.0, 8.0, 16.0, 30.0, 30.0])],
)
def test_a_failure_right_after_a_recovery_is_recovered_from(
    options: RunOptions,
    monkeypatch: pytest.MonkeyPatch,
    recovery: float,
    failures: int,
    stood: list[float],
) -> None:
    pauses: list[float] = []
    monkeypatch.setattr(macor_hil.runs.live_run, "pause", lambda s, _: pauses.append(s))
    real, make = CameraAddress.open, failing(3, 1)
    monkeypatch.setattr(CameraAddress, "open", lambda *a, **k: make(real(*a, **k)))
    fail_after_recovery(monkeypatch, failures)
    report = serve(changed(options, recovery=recovery))
    assert (report.ending, report.commands, report.recoveries) == (Ending.COMMANDS, 6, 1)
    assert pauses == stood


def test_failures_right_after_recoveries_end_a_run_that_may_give_up(
    options: RunOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    ports, times = opened(monkeypatch), list[float]()
    watch_closing(ports, times, monkeypatch)
    real, make = CameraAddress.open, failing(3, 1)
    monkeypatch.setattr(CameraAddress, "open", lambda *a, **k: make(real(*a, **k)))
    fail_after_recovery(monkeypatch, 5)
    with pytest.raises(LinkError, match="a loose contact"):
        serve(changed(options, recovery=30.0))
    assert times  # the robot stood when it was switched off


# learning


def test_what_is_learned_while_driving_is_kept_and_added_to(
    options: RunOptions, map_file: Path
) -> None:
    before = transitions(map_file)
    learning = changed(options, map_file=map_file, learn=True)
    assert serve(learning).learned == 6
    assert transitions(map_file) == before + 6
    assert serve(learning).learned == 12
    _, facts = load_map(map_file)
    assert facts[LIVED] == 12
    assert facts["place"] == PORT


def test_without_being_told_to_nothing_is_learned(options: RunOptions, map_file: Path) -> None:
    before = map_file.read_bytes()
    serve(changed(options, map_file=map_file))
    assert map_file.read_bytes() == before


def test_the_map_is_written_now_and_then_and_at_every_end(
    options: RunOptions, map_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept: list[int] = []

    def save(path: Path, brain: Brain, training: dict[str, Any]) -> None:
        kept.append(training[LIVED])
        save_map(path, brain, training)

    monkeypatch.setattr(macor_hil.runs.learning.learning_on, "save_map", save)

    def end(decision: Decision) -> None:
        if decision.sequence == 6:
            signal.raise_signal(signal.SIGTERM)

    learning = changed(options, map_file=map_file, learn=True, save_every=3, commands=0)
    serve(learning, end)
    # the last decision was told before it was learned
    assert kept == [3, 6]
    assert load_map(map_file)[1][LIVED] == 6


def test_a_full_disk_costs_nothing_that_was_learned(
    options: RunOptions, map_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = [MapError("no space left")] * 2
    monkeypatch.setattr(macor_hil.runs.learning.learning_on, "save_map", NotYet(save_map, *full))
    assert serve(changed(options, map_file=map_file, learn=True, save_every=2)).learned == 6
    assert load_map(map_file)[1][LIVED] == 6


def test_a_map_is_learned_by_one_program_at_a_time(options: RunOptions, map_file: Path) -> None:
    with claim(map_file), pytest.raises(MacorError, match="another program is writing"):
        serve(changed(options, map_file=map_file, learn=True))


def test_a_planner_that_could_not_keep_up_is_refused(options: RunOptions, map_file: Path) -> None:
    with pytest.raises(MacorError, match="learn with another planner"):
        serve(changed(options, map_file=map_file, learn=True, goal="red"))
