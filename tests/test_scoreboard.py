"""Scores of robots by their ground truth, and the command that shows them."""

import io
import json
import os
import time
from math import inf
from typing import Any

import pytest
from controller_helpers import wait_until_watched
from emulator_process import PATIENCE, free_endpoint
from khepera_protocol.zenoh.keys import TRUTH
from khepera_protocol.zenoh.payloads import Pose, Truth, WheelDrift
from khepera_protocol.zenoh.session import open_session
from rich.console import Console
from typer.testing import CliRunner

from macor_hil.cli import classroom, program
from macor_hil.cli.classroom import ScoreOptions
from macor_hil.monitor.scoreboard import MOST_ROBOTS, Finish, Score, Scoreboard, drawn


def truth(time: float, x: float = 0.0, **changes: Any) -> Truth:
    values: dict[str, Any] = {
        "speed": (0.08, 0.08),
        "contact": False,
        "touched": False,
        "drift": WheelDrift.model_construct(),
    }
    pose = Pose(x=x, y=0.0, heading=0.0)
    return Truth.model_construct(time=time, pose=pose, **{**values, **changes})


STANDING: dict[str, Any] = {"speed": (0.0, 0.0)}


def driven(*truths: Truth, finish: Finish | None = None) -> Score:
    score = Score()
    for each in truths:
        score.add(each, finish)
    return score


def test_time_begins_with_the_first_motion_and_way_adds_up() -> None:
    score = driven(
        truth(0.0, **STANDING), truth(5.0, **STANDING), truth(5.1, 0.008), truth(5.2, 0.0)
    )
    assert score.attempts == 1
    assert score.way == pytest.approx(0.016)
    assert score.time == pytest.approx(0.2)


def test_a_robot_that_never_moved_has_made_no_attempt() -> None:
    assert driven(truth(0.0, **STANDING), truth(9.0, **STANDING)).attempts == 0


TOUCH: dict[str, Any] = {"contact": True, "touched": True}
LEFT: dict[str, Any] = {"touched": True}


def test_touches_count_once_each() -> None:
    along_a_wall = [truth(0.1 * n, 0.001 * n, **(TOUCH if n % 2 else LEFT)) for n in range(1, 20)]
    assert driven(truth(0.0), *along_a_wall).collisions == 1
    apart = [truth(1.0, **TOUCH), truth(1.1, **LEFT), truth(2.0, **LEFT), truth(2.1, **TOUCH)]
    assert driven(truth(0.0), *apart).collisions == 2


def test_a_touch_between_two_looks_counts() -> None:
    assert driven(truth(0.0), truth(1.0, 0.05, **LEFT), truth(2.0, 0.1, **LEFT)).collisions == 1


def test_whoever_is_put_elsewhere_begins_another_attempt() -> None:
    score = driven(truth(0.0), truth(0.1, 0.008), truth(0.2, 0.9), truth(0.3, 0.908))
    assert (score.attempts, score.collisions) == (2, 0)
    assert score.way == pytest.approx(0.008)
    put_back = driven(truth(0.0), truth(0.1, 0.01, **TOUCH), truth(0.2), truth(0.3, 0.01))
    assert (put_back.attempts, put_back.collisions) == (2, 0)


def test_a_robot_that_was_switched_on_again_begins_another_attempt() -> None:
    score = driven(truth(8.0), truth(8.1, 0.008), truth(0.1), truth(0.2, 0.008))
    assert score.attempts == 2
    assert score.time == pytest.approx(0.1)


def test_the_goal_ends_an_attempt_and_the_fastest_counts() -> None:
    finish = Finish(0.1, 0.0, 0.02)
    slow = [truth(0.0), truth(1.0, 0.05), truth(2.0, 0.1), truth(3.0, 0.15)]
    fast = [truth(3.1, -0.9), truth(4.1, 0.09), truth(5.1, 0.2)]
    score = driven(*slow, finish=finish)
    assert (score.finished, score.time, score.best) == (True, 2.0, 2.0)
    score = driven(*slow, *fast, finish=finish)
    assert score.attempts == 2
    assert score.time == score.best == pytest.approx(1.0)
    assert driven(*slow).best == inf


def test_the_best_stands_first() -> None:
    board = Scoreboard(Finish(0.1, 0.0, 0.02))
    for robot, ways in {
        "slow": (0.05, 0.1),
        "fast": (0.1, 0.15),
        "far": (-0.05, -0.1),
        "near": (-0.01, -0.02),
    }.items():
        for n, x in enumerate((0.0, *ways)):
            board.add(robot, truth(float(n), x))
    board.add("hit", truth(0.0))
    board.add("hit", truth(1.0, -0.9, **TOUCH))
    assert [name for name, _ in board.ranking()] == ["fast", "slow", "far", "near", "hit"]
    console = Console(width=80, record=True, file=open(os.devnull, "w"))  # noqa: SIM115, PTH123
    console.print(drawn(board.ranking(), with_goal=True))
    assert "2.0 s" in console.export_text()


def test_robots_that_have_not_moved_stand_in_the_order_of_their_numbers() -> None:
    board = Scoreboard()
    assert "no robot has been seen yet" in shown(board)
    for number in (10, 2, 1, 12):
        board.add(f"khepera-{number}", truth(1.0, 0.1))
    assert [name for name, _ in board.ranking()] == [f"khepera-{k}" for k in (1, 2, 10, 12)]
    assert "no robot" not in shown(board)


def shown(board: Scoreboard) -> str:
    screen = io.StringIO()
    Console(file=screen, width=80).print(drawn(board.ranking(), with_goal=False))
    return screen.getvalue()


def test_no_more_robots_are_kept_than_a_table_can_have() -> None:
    board = Scoreboard()
    for n in range(MOST_ROBOTS + 5):
        board.add(f"robot-{n}", truth(0.0))
    assert len(board.scores) == MOST_ROBOTS


@pytest.mark.parametrize("goal", ["1,2", "a,b,c", "0,0,0", "nan,0,1", "0,0,inf", "1,2,3,4"])
def test_a_goal_that_is_no_circle_is_refused(goal: str) -> None:
    with pytest.raises(ValueError, match=r"circle|X,Y,RADIUS"):
        ScoreOptions(goal=goal)


def test_what_is_no_truth_of_one_robot_is_left_out() -> None:
    endpoint = free_endpoint()
    board = Scoreboard()
    with open_session([endpoint], []) as session, classroom.scored(session, board) as look:
        for key, payload in (
            ("khepera/a/truth", b"{}"),
            ("khepera/*/truth", b"x"),
            ("khepera/**", b"x"),
            ("**", b"\xff"),
        ):
            session.put(key, payload)
        look()
    assert board.scores == {}


def test_all_robots_of_a_session_are_scored() -> None:
    endpoint = free_endpoint()
    board = Scoreboard(Finish(0.1, 0.0, 0.02))
    drift = WheelDrift(left_scale=1.0, right_scale=1.0, wheel_base=0.05, slip=0.0)
    with (
        open_session([endpoint], []) as session,
        open_session([], [endpoint]) as other,
        classroom.scored(other, board) as look,
    ):
        wait_until_watched(session, TRUTH.of("one"))
        for n in range(4):
            for robot, way in (("one", 0.02), ("two", 0.05)):
                told = truth(float(n), way * n, drift=drift)
                session.put(TRUTH.of(robot), told.model_dump_json())
        end = time.monotonic() + PATIENCE
        while "one" not in board.scores or board.scores["one"].time < 2.9:
            look()
            assert time.monotonic() < end
    said = [json.loads(line) for line in classroom.json_lines(board)]
    assert [(each["robot"], each["best"]) for each in said] == [("two", 2.0), ("one", None)]
    assert said[1]["way"] == pytest.approx(0.06)


def test_the_command_ends_after_a_time() -> None:
    command = ["score", "--connect", free_endpoint(), "--for", "0.1"]
    done = CliRunner().invoke(program.app, command)
    assert done.exit_code == 0
    assert "collisions" in done.output
