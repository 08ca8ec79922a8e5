"""The terminal monitor: its picture as text, and what it makes of a controller's life."""

import io
import re
from collections.abc import Callable
from typing import Any

import pytest
import zenoh
from as_type import as_type, not_none
from controller_helpers import (
    a_decision,
    a_frame,
    a_state,
    free_endpoint,
    publishing,
    wait_until_watched,
)
from khepera_protocol.zenoh.controller_payloads import (
    Ahead,
    Alternative,
    Link,
    Phase,
)
from khepera_protocol.zenoh.keys import CONTROLLER
from khepera_protocol.zenoh.payloads import Outline, Pose, Truth, Wire
from rich.console import Console

from macor_hil.errors import TelemetryError
from macor_hil.monitor.dashboard.drawings.texts import of_the_robot
from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import Controlled, Emulated, RobotState
from macor_hil.monitor.terminal import watch
from macor_hil.monitor.terminal_view import bar, render, spark
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import NotTaken
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session

PATIENCE = 10.0
KEYS = [f"macor/khepera/{leaf}" for leaf in ("frame", "decision", "state")]


def text_of(watched: RobotState, now: float = 100.0, width: int = 80) -> str:
    screen = io.StringIO()
    Console(file=screen, width=width, height=24).print(render(watched, now))
    return screen.getvalue()


def a_watched(**changes: Any) -> RobotState:
    watched = RobotState("khepera", Controlled(alive=True, met=True, state=a_state()))
    watched.controlled.decide(a_decision(3, **changes), 99.5)
    return watched


def line_with(text: str, word: str) -> str:
    (line,) = [line for line in text.splitlines() if word in line]
    return line


def test_without_a_controller_it_waits() -> None:
    assert "waiting for a robot" in text_of(RobotState("khepera"))


def test_a_controller_that_has_gone_leaves_its_last_words() -> None:
    watched = a_watched()
    watched.controlled.alive = False
    text = text_of(watched)
    assert "the robot has gone; last run vanished after 3 of 40 com" in text
    assert "situation" in text
    watched.controlled.state = a_state(Phase.STOPPED, reason="collision")
    assert "the robot has gone; last run stopped after 3 of 40 comm" in text_of(watched)


def test_a_decision_is_shown_with_all_that_belongs_to_it() -> None:
    text = text_of(a_watched())
    assert "controller driving, 3 of 40 commands" in text
    assert "khepera://corridor" in text
    assert "anticipative" in text
    assert "17, match 0.961, resonates (neuron 53)" in text
    assert "2: straight→18  left→4" in text
    assert "last 0.70  total 2.80" in text
    assert "x +0.021 m  y -0.004 m  heading +6°" in text
    assert "counters 262 263" in line_with(text, "wheels")
    assert re.search(r"█ 1023", text)
    assert "COLLISION" not in text


def test_alternatives_have_bars_in_proportion_and_the_driven_one_is_marked() -> None:
    text = text_of(a_watched())
    lengths = {name: line_with(text, f"│ {name} ").count("█") for name in ("left", "straight")}
    assert lengths == {"left": 12, "straight": 24}
    assert "4.250 ◀ driven" in line_with(text, "│ straight ")
    assert "never tried here" in line_with(text, "│ right ")
    assert text.count("◀") == 1


def test_a_situation_without_resonance_is_called_unknown() -> None:
    seen = a_decision().situation.model_copy(update={"resonant": False})
    assert "no match, nearest used" in text_of(a_watched(situation=seen))


def test_a_program_that_is_no_controller_of_ours_is_told_of() -> None:
    watched = RobotState(
        "khepera", emulated=Emulated(alive=True, truth=as_type(Truth, EXAMPLES[Truth]))
    )
    assert "another program drives" in line_with(text_of(watched), "driver")
    watched.emulated.line.take(as_type(Wire, EXAMPLES[Wire]), 100.0)
    assert "counters 262 263" in line_with(text_of(watched), "wheels")


def test_kind_and_model_are_shown_where_they_are_told() -> None:
    start = Pose(x=0.0, y=0.0, heading=0.0)
    arena = Outline(title="", floor=(0, 0, 0), solids=[], start=start, robot_radius=0.035)
    told = {"robot_kind": "epuck", "robot_model": "epuck2"}
    for changes, kind in (({}, "Khepera"), (told, "e-puck (epuck2)")):
        outline = arena.model_copy(update=changes)
        watched = RobotState("khepera", emulated=Emulated(alive=True, outline=outline))
        assert f"monitor · khepera · {kind} ─" in text_of(watched)
        assert of_the_robot(watched)[0] == ("kind", kind, False)
    assert of_the_robot(RobotState("khepera")) == []


def test_counters_are_the_lines_in_the_terminal_and_in_the_browser() -> None:
    watched = a_watched()
    assert ("counters", "262 and 263", False) in of_the_robot(watched)
    watched.emulated.line.counters = (162, 163)  # an e-puck's are steps of 0.13 mm
    assert "counters 162 163" in line_with(text_of(watched), "wheels")
    assert ("counters", "162 and 163", False) in of_the_robot(watched)


def test_a_collision_is_shown() -> None:
    assert "COLLISION" in text_of(a_watched(collided=True))


def test_the_reason_of_a_failure_is_shown() -> None:
    watched = a_watched()
    watched.controlled.state = a_state(Phase.FAILED, reason="the serial port failed")
    assert "controller failed, 3 of 40 commands; the serial" in text_of(watched)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_reason_of_a_failure_is_shown_in_full(width: int) -> None:
    words = "the robot at rfc2217://127.0.0.1:4003 gives no answer; check its cable and its power"
    watched = a_watched()
    for alive in (True, False):
        watched.controlled.alive = alive
        watched.controlled.state = a_state(Phase.FAILED, reason=words)
        text = text_of(watched, width=width)
        assert words in " ".join(text.replace("│", " ").split())
        assert "best sequence" not in text  # the plan goes with the run


def test_link_and_speeds_are_shown_while_they_are_known() -> None:
    watched = a_watched()
    assert "speeds" not in text_of(watched)
    watched.controlled.link = as_type(Link, EXAMPLES[Link])
    watched.emulated = Emulated(alive=True, truth=as_type(Truth, EXAMPLES[Truth]))
    text = text_of(watched)
    assert "0 of 240 failed, mean 26.0, worst 53.0 ms" in line_with(text, "link")
    assert "speeds 160 and 158 mm/s" in line_with(text, "wheels")


@pytest.mark.parametrize("width", [60, 80, 120])
def test_the_fullest_picture_fits_the_terminal(width: int) -> None:
    watched = a_watched(
        collided=True,
        sequence_ahead=[Ahead(node=50, command="straight")] * 150,
        alternatives=[Alternative(command="c" * 40, evaluation=-123456.789)] * 12,
    )
    watched.controlled.state = a_state(port="/dev/" + "x" * 200, map="y" * 300, reason="z" * 400)
    watched.not_taken = NotTaken(123_456, 123_456, "t" * 300)
    watched.controlled.link = as_type(Link, EXAMPLES[Link])
    watched.emulated = Emulated(alive=True, truth=as_type(Truth, EXAMPLES[Truth]))
    for _ in range(100):
        watched.see(bytes(123_456), 99.9)
        watched.controlled.history.append(a_decision())
    lines = text_of(watched, width=width).splitlines()
    assert len(lines) <= 24
    assert {len(line) for line in lines} == {width}
    # what matters of a row is not cut
    assert "17, match 0.961, resonates" in "\n".join(lines)
    assert "0 of 240 failed, mean 26.0, worst 53.0 ms" in "\n".join(lines)
    assert "│ reinforcement " in "\n".join(lines)


def test_what_comes_from_elsewhere_cannot_steer_the_terminal() -> None:
    watched = a_watched()
    watched.controlled.state = a_state(
        port="\x1b[2J\x1b]0;title\x07[bold]x[/bold]\r\n", reason="a\nb"
    )
    text = text_of(watched)
    assert "\x1b" not in text
    assert "[bold]x[/bold]" in text
    assert len({len(line) for line in text.splitlines()}) == 1


def test_rates_and_ages_count_arrivals() -> None:
    watched = RobotState("khepera", Controlled(alive=True))
    for n in range(5):
        watched.see(bytes(6200), 90.0 + n / 4)
    assert "4.0/s  6.2 kB  last one 1.5 s ago" in line_with(text_of(watched, 92.5), "frames")
    # a stream that has stopped has no rate any more
    assert "0.0/s  6.2 kB  last one 9.0 s ago" in line_with(text_of(watched), "frames")
    assert "none yet" in line_with(text_of(watched), "decisions")


def test_decisions_that_did_not_arrive_are_counted() -> None:
    watched = RobotState("khepera")
    for sequence in (4, 5, 9):
        watched.controlled.decide(a_decision(sequence), float(sequence))
    assert watched.controlled.missed == 3
    assert "3 missed" in text_of(watched)


def test_a_new_run_begins_a_new_curve() -> None:
    watched = RobotState("khepera")
    for sequence in (0, 1, 2, 0):
        watched.controlled.decide(a_decision(sequence), 0.0)
    assert [past.sequence for past in watched.controlled.history] == [0]
    assert watched.controlled.missed == 0


def test_sparks_and_bars() -> None:
    assert spark([0.0, 0.35, 0.7]) == "▁▅█"
    assert spark([]) == ""
    assert spark([0.0]) == "▁"
    assert len(spark([1.0] * 99, width=40)) == 40
    assert bar(0.5, 4) == "██  "
    assert bar(7.0, 4) == "████"
    assert bar(-1.0, 4) == "    "


def test_once_shows_a_controller_that_is_there() -> None:
    endpoint, file = free_endpoint(), io.StringIO()
    with publishing(endpoint) as (_, publisher):
        publisher.state(a_state(), 1.0)
        publisher.decision(a_decision(3))
        console = Console(file=file, width=80)
        with open_session([], [endpoint]) as session:
            assert watch(session, "khepera", once=True, console=console)
    assert "driving, 3 of 40" in file.getvalue()
    assert "17, match 0.961, resonates" in file.getvalue()


def test_a_watcher_without_a_controller_ends_after_its_duration() -> None:
    file = io.StringIO()
    console = Console(file=file, width=80)
    with open_session([], [free_endpoint()]) as session:
        assert not watch(session, "khepera", duration=0.1, console=console)
    assert "waiting for a robot" in file.getvalue()


def test_a_bad_name_is_refused() -> None:
    with open_session([], []) as session, pytest.raises(TelemetryError):
        watch(session, "a/**")


def wait_for(watcher: Follower, what: Callable[[], Any]) -> None:
    watcher.follow(PATIENCE, until=what)
    assert what()


def live_and_go(endpoint: str, watcher: Follower, commands: int) -> None:
    """A controller appears, drives some commands, and goes; the watcher must see all of it."""
    with open_session([], [endpoint]) as session, Publisher(session, "khepera") as publisher:
        wait_for(watcher, lambda: watcher.watched.controlled.alive)
        # an answer to what a watcher asks at first may be newer than what is on its way to it
        wait_for(watcher, lambda: watcher.feed.introduced(CONTROLLER))
        wait_until_watched(session, *KEYS)
        publisher.frame(a_frame())
        publisher.state(a_state(driven=commands), 0.0)
        for sequence in range(commands):
            publisher.decision(a_decision(sequence))
        wait_for(watcher, lambda: len(watcher.watched.controlled.history) == commands)
        wait_for(watcher, lambda: watcher.watched.controlled.state is not None)
        wait_for(watcher, lambda: watcher.watched.frame)
        assert not_none(watcher.watched.controlled.state).driven == commands
    wait_for(watcher, lambda: not watcher.watched.controlled.alive)
    assert watcher.watched.controlled.met
    assert watcher.watched.controlled.decision == a_decision(commands - 1)


def test_a_watcher_survives_the_controller_going_and_coming_back() -> None:
    endpoint = free_endpoint()
    with open_session([endpoint], []) as session, Follower(session, "khepera") as watcher:
        live_and_go(endpoint, watcher, commands=1)
        live_and_go(endpoint, watcher, commands=2)


def test_a_state_that_came_before_the_sign_of_life_is_not_forgotten() -> None:
    endpoint, key = free_endpoint(), KEYS[2]
    text = a_state(driven=5).model_dump_json()
    with (
        open_session([endpoint], []) as session,
        Follower(session, "khepera") as watcher,
        open_session([], [endpoint]) as other,
    ):
        wait_until_watched(other, key)
        when = other.new_timestamp()

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(key, text, timestamp=when)

        with other.declare_queryable(key, answer):
            other.put(key, text, timestamp=when)
            wait_for(watcher, lambda: watcher.watched.controlled.state is not None)
            with other.liveliness().declare_token("macor/khepera/alive"):
                wait_for(watcher, lambda: watcher.watched.controlled.alive)
                wait_for(watcher, lambda: watcher.watched.controlled.state is not None)


def test_a_payload_of_another_version_is_trouble_but_no_end() -> None:
    endpoint = free_endpoint()
    with (
        open_session([endpoint], []) as session,
        Follower(session, "khepera") as watcher,
        open_session([], [endpoint]) as other,
    ):
        wait_until_watched(other, KEYS[1])
        other.put(KEYS[1], '{"future": 1}')
        wait_for(watcher, lambda: bool(watcher.watched.not_taken.refused))
    assert "1 refused; the last one of decision: is it of another" in text_of(watcher.watched)
