"""Trials against what is possible."""

import json
from dataclasses import asdict
from math import radians

import pytest
from as_type import not_none
from emulator_process import emulator, free_endpoint
from khepera_protocol.zenoh.payloads import Pose, Reset

from khepera_emulator.routes.oracle import PAPER_COMMANDS, Oracle
from macor_hil.commands import COMMANDS
from macor_hil.errors import BenchError
from macor_hil.hardware.bench import PortBench, ZenohBench
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.robots.epuck.readings import scaled
from macor_hil.hardware.robots.forms import form_of
from macor_hil.hardware.robots.robot import RobotKind
from macor_hil.runs.possible import Possible, Shares, compare, judge, share_of
from macor_hil.runs.trials import Trial
from macor_hil.telemetry.session import open_session

START = Pose(x=0.0, y=0.0, heading=0.0)


def trial(length: int, *, collided: bool) -> Trial:
    return Trial((0.6,) * length, collided, collided, (START,) * (length + 1))


def possible(length: int, asked: int = 40) -> Possible:
    return Possible(length, asked, exact=True)


@pytest.mark.parametrize(
    ("driven", "most", "share"),
    [
        (trial(40, collided=False), possible(40), 1.0),
        (trial(40, collided=True), possible(40), 39 / 40),
        (trial(9, collided=True), possible(16), 0.5),
        (trial(17, collided=True), possible(16), 1.0),
        (trial(19, collided=True), possible(16), 1.0),
        (trial(1, collided=True), possible(5), 0.0),
        (trial(1, collided=True), possible(0), None),
        (trial(4, collided=True), possible(0), 1.0),
    ],
    ids=[
        "all",
        "all but the last",
        "half",
        "as far as it goes",
        "farther than was thought",
        "none",
        "nothing was possible",
        "nothing was thought possible",
    ],
)
def test_the_share_of_a_trial(driven: Trial, most: Possible, share: float | None) -> None:
    assert share_of(driven, most) == share


def test_starts_are_told_apart() -> None:
    trials = [
        trial(40, collided=False),
        trial(21, collided=True),
        trial(11, collided=True),
        trial(1, collided=True),
    ]
    most = [possible(40), possible(40), possible(10), possible(0)]
    assert compare(trials, most) == Shares(
        share=(1.0 + 0.5 + 1.0) / 3, hopeless=1, free=2, needless=1
    )


def test_where_nothing_was_ever_possible_there_is_no_share() -> None:
    assert compare([trial(1, collided=True)], [possible(0)]) == Shares(None, 1, 0, 0)
    assert compare([], []) == Shares(None, 0, 0, 0)


def test_results_can_hold_it() -> None:
    value = possible(12)
    assert Possible(**json.loads(json.dumps(asdict(value)))) == value


def test_a_judge_of_an_emulated_robot() -> None:
    with open_hardware("khepera://corridor?seed=1") as hardware:
        assert hardware.bench is not None
        tell = judge(hardware.bench, 40)
        start = hardware.bench.reset(Reset(seed=1)).pose
        assert tell(start) == Possible(40, 40, exact=True)
        assert tell(start).everything
        facing = start.model_copy(update={"x": 1.07, "heading": radians(10)})
        assert tell(facing) == Possible(0, 40, exact=True)
        assert not tell(facing).everything


def test_an_unknown_robot_is_told() -> None:
    with open_hardware("khepera://corridor?seed=1") as hardware:
        bench = hardware.bench
        assert isinstance(bench, PortBench)
        changed = {"robot_radius": 0.1, "robot_model": "unheard-of"}
        strange = bench.outline().model_copy(update=changed)
        bench.outline = lambda: strange  # type: ignore[method-assign]
        with pytest.raises(BenchError, match=r"cannot tell what is possible: no known robot"):
            judge(bench)


@pytest.mark.parametrize("model", ["epuck", "epuck2"])
def test_an_epuck_is_judged_by_its_own_sensors_and_drives_what_is_possible(model: str) -> None:
    with open_hardware(f"khepera://maze?model={model}&seed=4&drift=none") as hardware:
        bench = not_none(hardware.bench)
        own = Oracle(bench.outline(), PAPER_COMMANDS, bench.truth().drift, collision=600)
        driver, tell = Driver(hardware.robot), judge(bench)
        for seed in range(3):
            start = bench.reset(Reset(random=True, seed=seed)).pose
            found = own.longest_drive(start, 40)
            assert tell(start) == Possible(found.length, 40, found.exact)
            driver.start()
            outcomes = [driver.execute(COMMANDS[command]) for command in found.commands]
            assert not any(outcome.collided for outcome in outcomes)
            assert not bench.truth().touched


@pytest.mark.parametrize("kind", [RobotKind.KHEPERA, RobotKind.EPUCK])
def test_a_collision_on_the_line_is_the_drivers(kind: RobotKind) -> None:
    form = form_of(kind)
    for collision in (1, 300, 999, 1000, 1023):
        least = form.on_the_line(collision)
        scales = [scaled(raw) if kind is RobotKind.EPUCK else raw for raw in (least - 1, least)]
        assert [value >= collision for value in scales] == [False, True]


def test_a_robot_in_another_process_is_judged_alike() -> None:
    options, endpoint = ("--arena", "maze", "--seed", "4"), free_endpoint()
    with (
        emulator(*options, "--listen", endpoint),
        open_session([], [endpoint]) as session,
        open_hardware("khepera://maze?seed=4") as hardware,
    ):
        assert hardware.bench is not None
        far, near = ZenohBench(session, "khepera"), hardware.bench
        start = near.truth().pose
        starts = [start, start.model_copy(update={"heading": 0.0})]
        assert list(map(judge(far), starts)) == list(map(judge(near), starts))


def test_a_judge_knows_the_robots_wheels() -> None:
    with open_hardware("khepera://maze?seed=4&drift=scale=0.1,base=0.2") as hardware:
        bench = hardware.bench
        assert bench is not None
        starts = [bench.reset(Reset(random=True, seed=seed)).pose for seed in range(12)]
        told = [judge(bench, 12)(start).length for start in starts]
        ways, drift = PAPER_COMMANDS, bench.truth().drift
        known, unknown = (Oracle(bench.outline(), ways, each) for each in (drift, None))
        assert told == [known.longest_drive(start, 12).length for start in starts]
        assert told != [unknown.longest_drive(start, 12).length for start in starts]
