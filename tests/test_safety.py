"""A robot that must stop stands within half a second, on its own clock; then it goes on or ends."""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh
from as_type import as_type, not_none
from controller_helpers import Samples
from drives import STATUSES, WAYS_OUT, Drive, programs
from emulator_process import PATIENCE
from made_once import made_once
from rig import RELAYED, Controller, Rig, rig
from short_training import train_shortly

from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop

pytestmark = pytest.mark.wall_clock

REQUEST = '{"stop": true}'
LIMIT = 0.5
"""Seconds; what the controller promises."""


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz")

    return made_once(tmp_path_factory, "map-of-a-box", train) / "short.npz"


@pytest.fixture(scope="module")
def shared_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("bench")) as running:
        yield running


@pytest.fixture
def bench(shared_bench: Rig) -> Iterator[Rig]:
    shared_bench.make_ready()
    yield shared_bench
    shared_bench.end_controllers()


def drive(bench: Rig, map_file: Path, **fields: Any) -> Controller:
    """A controller whose commands take more than a second, at the beginning of one."""
    controller = bench.controller(map_file, speed=2, **fields)
    controller.wait_for_steps(1)
    bench.wait_until_moving()
    return controller


def interrupted(controller: Controller) -> int:
    """End a controller; how many failures it had got over."""
    os.kill(controller.process.pid, signal.SIGTERM)
    ending, recoveries = controller.end().rsplit(maxsplit=1)
    assert ending == "interrupted SIGTERM"
    return int(recoveries)


@pytest.mark.parametrize("mode", ["lost", "frozen", "late", "dark", "small", "garbage"])
def test_a_failing_camera_stops_the_robot_until_it_works_again(
    bench: Rig, map_file: Path, mode: str
) -> None:
    controller = drive(bench, map_file)

    def fail() -> None:
        if not_none(bench.relay).mode != "pass":
            not_none(bench.relay).mode = "pass"
            controller.wait_for_steps(1)
            bench.wait_until_moving()
        not_none(bench.relay).mode = mode

    assert bench.stops_within(LIMIT, fail)
    not_none(bench.relay).mode = "pass"
    controller.wait_for_steps(2)
    assert interrupted(controller) > 0


@contextmanager
def a_stranger(bench: Rig, make_picture: Callable[[], bytes]) -> Iterator[zenoh.Session]:
    """A session that answers on the camera's key as well, and claims to be complete."""

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(RELAYED, make_picture())

    ends = [bench.endpoint, bench.controller_endpoint]
    with (
        open_session([], ends) as session,
        session.declare_queryable(RELAYED, answer, complete=True),
    ):
        yield session


def noise() -> bytes:
    image = np.random.default_rng().integers(0, 256, (160, 160, 3), dtype=np.uint8)
    return cv2.imencode(".png", image)[1].tobytes()


@pytest.mark.parametrize("make_picture", [lambda: b"flour", noise])
def test_a_stranger_on_the_camera_s_key_neither_holds_nor_steers_the_robot(
    bench: Rig, map_file: Path, make_picture: Callable[[], bytes]
) -> None:
    controller = drive(bench, map_file)
    frames: Samples = SimpleQueue()
    states: Samples = SimpleQueue()
    asked: SimpleQueue[int] = SimpleQueue()

    def ask_and_make() -> bytes:
        asked.put(1)
        return make_picture()

    with open_session([], [bench.controller_endpoint]) as session:
        session.declare_subscriber("macor/khepera/frame", frames.put)
        session.declare_subscriber("macor/khepera/state", states.put)
        with a_stranger(bench, ask_and_make):
            asked.get(timeout=PATIENCE)
            controller.wait_for_steps(3)
    assert controller.process.poll() is None
    seen = [sample.payload.to_bytes() for sample in drained(frames)]
    assert seen
    for data in seen:
        picture = not_none(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
        assert not picture[:8, :8].any()  # outside the mirror; noise everywhere is the stranger's
    # a late picture of a busy machine may stop the robot, but no stranger
    reasons = [json.loads(sample.payload.to_string())["reason"] for sample in drained(states)]
    assert not [reason for reason in reasons if "no picture (" in reason or "source" in reason]


def drained(queue: Samples) -> Iterator[zenoh.Sample]:
    while not queue.empty():
        yield queue.get()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_the_robot(bench: Rig, map_file: Path, number: int) -> None:
    controllers = []

    def interrupt() -> None:
        controllers.append(drive(bench, map_file))
        os.kill(controllers[-1].process.pid, number)

    assert bench.stops_within(LIMIT, interrupt)
    assert controllers[-1].end().startswith(f"interrupted {signal.Signals(number).name}")


def test_a_stop_request_stops_the_robot(bench: Rig, map_file: Path) -> None:
    controllers = []

    def ask() -> None:
        controllers.append(drive(bench, map_file, stop_key=True))
        with open_session([], [bench.controller_endpoint]) as session:
            ask_to_stop(session, "khepera")

    assert bench.stops_within(LIMIT, ask)
    assert controllers[-1].end().startswith("interrupted the stop key")


def test_the_stop_key_is_off_unless_asked_for(bench: Rig, map_file: Path) -> None:
    controller = drive(bench, map_file)
    with open_session([], [bench.controller_endpoint]) as session:
        session.put("macor/khepera/stop", REQUEST)
        replies = session.get("macor/khepera/stop", payload=REQUEST, timeout=2.0)
        assert not [reply for reply in replies if reply.ok]
    controller.wait_for_steps(2)


def test_the_robot_stands_while_a_planner_is_late(bench: Rig, map_file: Path) -> None:
    phases = []
    with open_session([], [bench.controller_endpoint]) as session:
        session.declare_subscriber(
            "macor/khepera/state", lambda sample: phases.append(phase(sample))
        )

        def wait_for_the_planner() -> None:
            bench.end_controllers()
            controller = bench.controller(map_file, speed=2, trouble="slow planner")
            controller.wait_for(lambda lines: "slow" in lines)

        assert bench.stops_within(LIMIT, wait_for_the_planner)
        as_type(Controller, bench.controllers[-1]).wait_for_steps(2)
    assert "late" in phases


def phase(sample: zenoh.Sample) -> str:
    told: str = json.loads(sample.payload.to_string())["phase"]
    return told


def test_a_defect_in_mid_drive_stops_the_robot(bench: Rig, map_file: Path) -> None:
    def break_down() -> None:
        controller = bench.controller(map_file, trouble="exception")
        controller.wait_for(lambda lines: "broken" in lines)

    assert bench.stops_within(LIMIT, break_down)
    assert as_type(Controller, bench.controllers[-1]).process.wait(30) == 1


ROLLING = """
import os, signal, sys
from macor_hil.hardware.khepera import Khepera, open_port
robot = Khepera(open_port(sys.argv[1], 57600))
robot.set_speed(-15, 15)
os.kill(os.getpid(), signal.SIGKILL)
"""


def kill_a_rolling_controller(bench: Rig) -> None:
    controller = bench.start([sys.executable, "-c", ROLLING, str(bench.link)])
    assert controller.process.wait(30) == -signal.SIGKILL


def test_a_robot_rolls_on_when_its_controller_was_killed(bench: Rig) -> None:
    kill_a_rolling_controller(bench)
    assert bench.time_to_stand(longest=1.5) > 1.4


def test_a_robot_with_a_dead_man_stop_does_not(tmp_path: Path) -> None:
    with rig(tmp_path, "--dead-man", "0.3") as bench:
        kill_a_rolling_controller(bench)
        assert bench.time_to_stand() < 0.3 + 0.15


# the others: `make stop-times`
@pytest.mark.parametrize("way", ["SIGTERM", "terminal closed"])
@pytest.mark.parametrize("program", ["run", "train", "trials", "calibrate", "Commands", "Wheels"])
def test_no_way_out_of_any_program_leaves_the_robot_driving(
    bench: Rig, map_file: Path, program: str, way: str
) -> None:
    drives = []

    def end() -> None:
        bench.make_ready()
        drives.append(Drive(bench.controllers, programs(bench, map_file)[program]))
        bench.wait_until_moving()
        WAYS_OUT[way](drives[-1])

    assert bench.stops_within(LIMIT, end)
    status = drives[-1].wait()
    if program not in ("Commands", "Wheels"):
        assert status == STATUSES[way], drives[-1].said


def test_an_output_that_nobody_reads_stops_the_robot(bench: Rig, map_file: Path) -> None:
    drives = []

    def end() -> None:
        bench.make_ready()
        drives.append(Drive(bench.controllers, programs(bench, map_file)["run"], output=True))
        bench.wait_until_moving()
        drives[-1].close_output()

    assert bench.stops_within(LIMIT, end)
    assert drives[-1].wait() == 2
    assert b"nobody reads the standard output" in drives[-1].said
    assert b"the robot stands" in drives[-1].said


A_LEARNER = """
import os, signal, sys, time
from macor_hil.hardware.devices import robot_of
opened = robot_of(sys.argv[1], 57600)
robot = opened.__enter__()
robot.set_speed(-15, 15)
print("rolls", flush=True)
{}
"""
"""A program of somebody's own that holds a speed, without any care for its end."""

ENDINGS = {
    "its last line": "",
    "an exception": "1 / 0",
    "an exit": "sys.exit(3)",
    "forgetting": "del opened, robot; time.sleep(60)",
    "Ctrl-C": "os.kill(os.getpid(), signal.SIGINT); time.sleep(60)",
    "SIGTERM": "os.kill(os.getpid(), signal.SIGTERM); time.sleep(60)",
    "a closed terminal": "os.kill(os.getpid(), signal.SIGHUP); time.sleep(60)",
}


@pytest.mark.parametrize("ending", ENDINGS.values(), ids=ENDINGS.keys())
def test_a_program_without_any_care_leaves_a_standing_robot(bench: Rig, ending: str) -> None:
    def end() -> None:
        bench.end_controllers()
        script = A_LEARNER.format(ending)
        program = bench.start([sys.executable, "-c", script, str(bench.link)])
        program.wait_for(lambda lines: "rolls" in lines)

    assert bench.stops_within(LIMIT, end)


def test_a_killed_controller_of_commands_leaves_a_robot_that_comes_to_rest(
    bench: Rig, map_file: Path
) -> None:
    controller = drive(bench, map_file)
    controller.process.kill()
    assert 0.6 < bench.time_to_stand() < 2.0  # the rest of its command


def test_a_robot_comes_back_after_its_emulator_was_killed_and_restarted(
    bench: Rig, map_file: Path
) -> None:
    controller = drive(bench, map_file)
    bench.restart_emulator()
    controller.wait_for_steps(3)
    assert interrupted(controller) > 0


def test_a_restarted_emulator_is_taken_for_the_camera_again(map_file: Path, tmp_path: Path) -> None:
    """Its camera has another Zenoh id: a change that is told, and then followed."""
    with rig(tmp_path, relay=False) as bench:
        controller = drive(bench, map_file)
        bench.restart_emulator()
        controller.wait_for_steps(3)
        assert interrupted(controller) > 0


def test_a_robot_stops_while_its_router_is_gone_and_goes_on_when_it_is_back(
    map_file: Path, tmp_path: Path
) -> None:
    with rig(tmp_path, routed=True) as bench:
        controller = drive(bench, map_file)

        def lose_the_router() -> None:
            if not_none(bench.router).process.poll() is not None:
                not_none(bench.router).start()
                controller.wait_for_steps(1)
                bench.wait_until_moving()
            not_none(bench.router).kill()

        assert bench.stops_within(LIMIT, lose_the_router)
        not_none(bench.router).start()
        controller.wait_for_steps(2)
        assert interrupted(controller) > 0
