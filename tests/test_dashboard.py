"""The dashboard's drawings and words, and scrubbing through a recording; no browser here."""

import contextlib
import logging
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from math import radians
from typing import Any

import pytest
from as_type import as_type, not_none
from controller_helpers import a_decision, a_state
from khepera_protocol.zenoh.controller_payloads import Phase
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR
from khepera_protocol.zenoh.payloads import Outline, Pose, Truth, Wire, WireEntry
from macor_hil.monitor.dashboard.svg import BAD, GOOD, heat
from nicegui import app
from watching_helpers import BEGIN, SECOND, a_life, a_picture, hypothesis, learned, truth

from macor_hil.monitor.dashboard import arena, charts, eyes, texts, ticks
from macor_hil.monitor.dashboard.failures import Failures, OnceEach
from macor_hil.monitor.dashboard.sources import RecordingSource
from macor_hil.monitor.robot_state import Controlled, Emulated, RobotState
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Event, Presence


def parsed(svg: str) -> ElementTree.Element:
    return ElementTree.fromstring(svg)


def of_kind(svg: str, kind: str) -> list[ElementTree.Element]:
    return [each for each in parsed(svg).iter() if each.get("data-kind") == kind]


def a_watched(**changes: Any) -> RobotState:
    watched = RobotState("khepera", Controlled(alive=True, met=True, state=a_state()))
    watched.controlled.learned = learned()
    watched.emulated = Emulated(alive=True, outline=as_type(Outline, EXAMPLES[Outline]))
    watched.emulated.place(truth(0.5, 0.1))
    watched.controlled.decide(a_decision(**changes), 1.0)
    watched.see(a_picture(), 1.0)
    return watched


DRAWINGS: dict[str, Callable[[RobotState], str]] = {
    "arena": arena.arena,
    "mirror": eyes.mirror,
    "panorama": eyes.panorama,
    "columns": lambda w: charts.columns(w.controlled.decision, w.controlled.learned),
    "alternatives": lambda w: charts.alternatives(w.controlled.decision),
    "reinforcement": lambda w: charts.reinforcement(list(w.controlled.history)),
    "infrared": lambda w: charts.infrared(
        w.controlled.decision.infrared if w.controlled.decision else None
    ),
}


@pytest.mark.parametrize("name", DRAWINGS)
def test_every_drawing_is_well_formed_and_titled_whatever_is_known(name: str) -> None:
    for watched in (RobotState("khepera"), a_watched()):
        root = parsed(DRAWINGS[name](watched))
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert not_none(root.find("{http://www.w3.org/2000/svg}title")).text
    # at any moment of a life
    watched = RobotState("khepera")
    for event in a_life():
        watched.take(event)
        parsed(DRAWINGS[name](watched))


def test_the_arena_shows_all_sequences_and_marks_the_best() -> None:
    weighed = [hypothesis(4.0, "straight", "left"), hypothesis(2.0, "left"), hypothesis(1.0, "x")]
    svg = arena.arena(a_watched(hypotheses=weighed, frame_time=0.5))
    assert len(of_kind(svg, "hypothesis")) == 2
    (best,) = of_kind(svg, "best")
    assert best.get("data-value") == "4"
    assert len(of_kind(best_text(best), "best-step")) == 2
    assert "3 hypothetical sequences" in svg
    assert len(of_kind(svg, "robot")) == 2  # in the close-up and in the whole arena


def best_text(element: ElementTree.Element) -> str:
    return ElementTree.tostring(element, encoding="unicode")


def test_a_sequence_leads_along_the_arcs_of_its_commands() -> None:
    ahead = hypothesis(1.0, "straight", "left", "right").ahead
    commands = {command.name: command for command in learned().commands}
    way = arena.way_of(Pose(x=1.0, y=2.0, heading=0.0), ahead, commands)
    assert way[1] == pytest.approx((1.021, 2.0))
    # 21 mm on an arc of 12 degrees: 6 degrees to the left, chord 0.2 % shorter
    assert way[2] == pytest.approx((1.021 + 0.020847, 2.0 + 0.002191), abs=1e-5)
    assert way[3] == pytest.approx((way[2][0] + 0.020847, way[2][1] + 0.002191), abs=1e-5)
    turned = arena.way_of(Pose(x=0.0, y=0.0, heading=radians(90)), ahead[:1], commands)
    assert turned[1] == pytest.approx((0.0, 0.021))


def test_sequences_begin_where_the_robot_was_when_it_decided() -> None:
    watched = a_watched(frame_time=0.5)
    watched.emulated.place(truth(1.5, 0.121))
    (_, way), *_ = arena.hypothetical_ways(watched)
    assert way[0] == (0.1, 0.0)


def test_without_an_emulator_the_odometry_is_drawn() -> None:
    watched = RobotState("khepera", Controlled(learned=learned()))
    for k in range(3):
        watched.controlled.decide(a_decision(k), None)
    path = arena.driven_path(watched)
    assert (path[0].x, len(path)) == (0.0, 4)
    (_, way), *_ = arena.hypothetical_ways(watched)
    assert way[0] == (path[-2].x, path[-2].y)
    assert of_kind(arena.arena(watched), "best")


def test_receptive_fields_are_drawn_with_what_they_see() -> None:
    svg = eyes.panorama(a_watched())
    assert len(of_kind(svg, "field")) == 12
    assert len(of_kind(svg, "feature")) == 36
    assert "data:image/jpeg;base64," in svg


def test_a_picture_that_is_none_is_left_out() -> None:
    watched = a_watched()
    watched.see(b"no picture", 2.0)
    parsed(eyes.panorama(watched))
    assert "data:image" not in eyes.panorama(watched)


def test_columns_have_a_cell_for_every_neuron_and_the_brightest_is_the_present_one() -> None:
    watched = a_watched()
    cells = of_kind(DRAWINGS["columns"](watched), "neuron")
    assert len(cells) == 150
    assert cells[53].get("fill") == heat(1.0)
    assert cells[0].get("fill") == heat(0.0)


def test_a_collision_is_a_red_bar() -> None:
    history = [a_decision(0), a_decision(1, collided=True, reinforcement=0.0)]
    bars = of_kind(charts.reinforcement(history), "reward")
    assert [bar.get("fill") for bar in bars] == [GOOD, BAD]


def test_sensors_are_drawn_as_long_as_they_read() -> None:
    wedges = of_kind(charts.infrared([0, 12, 1023, 4, 5, 6, 7, 8]), "sensor")
    assert len(wedges) == 8
    assert wedges[2].get("fill") == BAD


def test_text_from_elsewhere_stays_text() -> None:
    evil = "<script>alert(1)</script>"
    watched = a_watched(command=evil, hypotheses=[hypothesis(1.0, evil)])
    watched.controlled.learned = learned().model_copy(
        update={"commands": [learned().commands[0].model_copy(update={"name": evil})]}
    )
    for draw in DRAWINGS.values():
        assert "<script" not in draw(watched)


def test_what_fails_in_the_page_is_counted_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    failures, log = Failures(), logging.getLogger("page under test")
    log.addFilter(OnceEach())
    assert failures.words() == ""
    for _ in range(3):
        try:
            charts.columns(a_decision(), None).index("\x1b[31m")
        except ValueError as error:
            failures.add(error)
            log.exception("again")
    assert failures.words().startswith("the page failed 3 times, please report it: ValueError: ")
    assert len(caplog.records) == 1
    log.warning("something else")
    log.warning("something else")
    assert len(caplog.records) == 3


def test_what_is_done_again_and_again_outlives_failures_and_counts_on_no_wall_clock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting, done = [], []
    monkeypatch.setattr(
        app, "timer", lambda seconds, turn, once: waiting.append((seconds, turn, once))
    )

    def fail() -> None:
        done.append(1)
        raise ZeroDivisionError

    ticks.again_and_again(0.1, fail, lambda: len(done) < 3)
    while waiting:
        seconds, turn, once = waiting.pop()
        assert (seconds, once, waiting) == (0.1, True, [])  # a repeated one reads the wall clock
        with contextlib.suppress(ZeroDivisionError):
            turn()
    assert len(done) == 3


def test_the_status_tells_who_is_there() -> None:
    watched = RobotState("khepera")
    assert texts.status(watched, 0.0)[0] == "waiting for a robot"
    watched.emulated.alive = True
    assert texts.status(watched, 0.0)[0] == "robot there, nobody drives it"
    watched = a_watched()
    assert texts.status(watched, 0.0) == ("driving, 3 of 40 commands", "green")
    watched.controlled.state = a_state(Phase.FAILED, reason="the cable")
    assert texts.status(watched, 0.0) == ("failed, 3 of 40 commands: the cable", "red")


def on_the_line(*requests: str) -> Wire:
    return Wire(first=0, entries=[WireEntry(time=0.0, what="request", text=r) for r in requests])


def test_a_program_on_the_line_is_not_nobody() -> None:
    watched = RobotState("khepera", emulated=Emulated(alive=True))
    watched.emulated.pass_by(on_the_line("N\n", "H\n"), 10.0)
    assert texts.status(watched, 11.0)[0] == "robot there, a program talks to it"
    assert texts.status(watched, 20.0)[0] == "robot there, nobody drives it"
    watched.emulated.pass_by(on_the_line("N\nD,", "5,5\n"), 30.0)
    driven = "robot there, a program that tells nothing of itself drives it"
    assert texts.status(watched, 31.0) == (driven, "green")
    assert texts.status(watched, 60.0)[0] == "robot there, nobody drives it"
    # a speed is held without another request
    watched.emulated.place(as_type(Truth, EXAMPLES[Truth]))
    assert texts.status(watched, 60.0)[0] == driven
    watched.emulated.alive = False
    assert texts.status(watched, 60.0)[0] == "it has gone; waiting for a robot"


def test_nothing_of_a_robot_that_has_gone_looks_alive() -> None:
    watched = a_watched()
    for k in range(20):
        watched.see(a_picture(), 1.0 + 0.1 * k)
    assert not texts.gone(watched)
    alive = dict(texts.health(watched, 3.0))
    assert alive["pictures"].startswith("10.0/s")
    assert alive["wheels"] == "left 160 mm/s, right 158 mm/s"
    watched.take(Presence(CONTROLLER, False, 0))
    assert texts.gone(watched) == {"decision", "ring", "columns", "rewards"}
    watched.take(Presence(EMULATOR, False, 0))
    assert {"arena", "eyes", "line"} < texts.gone(watched)
    dead = dict(texts.health(watched, 60.0))
    assert dead["pictures"] == "0.0/s, last one 57.1 s ago"
    assert "wheels" not in dead
    assert "robot was at" in dead


def test_replies_that_came_in_pieces_are_one_line() -> None:
    watched = RobotState("khepera")
    for what, text in (("request", "B\n"), ("reply", "b,5."), ("reply", "01\r\n"), ("close", "")):
        watched.emulated.wire.append(WireEntry(time=0.0, what=what, text=text))
    assert texts.wire(watched) == "> B\n< b,5.01\nclose "


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_recording_is_scrubbed_forth_and_back() -> None:
    player = RecordingSource("khepera", a_life(3), Clock())
    player.seek(2.9)
    assert not_none(player.watched.controlled.decision).sequence == 1
    version = player.watched.version
    player.seek(1.9)
    assert not_none(player.watched.controlled.decision).sequence == 0
    assert [past.sequence for past in player.watched.controlled.history] == [0]
    assert player.watched.version != version
    player.seek(-5.0)
    assert player.position == 0.0
    assert player.watched.controlled.decision is None
    player.seek(1e9)
    assert player.position == player.duration == pytest.approx(4.0)
    assert not player.watched.controlled.alive


def test_playing_takes_its_time_and_ends() -> None:
    clock = Clock()
    player = RecordingSource("khepera", a_life(3), clock)
    player.speed = 2.0
    clock.now = 0.75
    player.poll()
    assert player.position == pytest.approx(1.5)
    assert player.now == pytest.approx(BEGIN / SECOND + 1.5)
    player.toggle()
    clock.now = 60.0
    player.poll()
    assert player.position == pytest.approx(1.5)
    player.toggle()
    clock.now = 120.0
    player.poll()
    assert (player.position, player.playing) == (player.duration, False)
    player.toggle()
    assert (player.position, player.playing) == (0.0, True)


def test_each_page_plays_a_recording_for_itself() -> None:
    events = a_life(3)
    first, second = (RecordingSource("khepera", events, Clock()) for _ in range(2))
    first.seek(2.9)
    second.toggle()
    assert (first.position, first.playing) == (2.9, True)
    assert (second.position, second.playing) == (0.0, False)


def test_a_leap_is_taken_in_bounded_steps_and_going_back_begins_near(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    events = a_life(1000)
    player = RecordingSource("khepera", events, Clock())
    player.seek(1e9)
    steps = 0
    while player.watched.controlled.alive or player.watched.controlled.decision is None:
        taken = player.watched.version
        player.poll()
        assert 0 < player.watched.version - taken <= 2000
        steps += 1
    assert steps == len(events) // 2000
    again: list[Event] = []
    monkeypatch.setattr(player.watched, "take", again.append)  # what was known near is enough
    player.seek(player.duration - 1.0)
    assert not again
    direct = RobotState("khepera")
    for event in events:
        if event.received <= BEGIN + round((player.duration - 1.0) * SECOND):
            direct.take(event)
    assert player.watched.controlled.decision == direct.controlled.decision
    assert list(player.watched.controlled.history) == list(direct.controlled.history)
    assert player.watched.emulated.path == direct.emulated.path


@pytest.mark.parametrize("nowhere", [float("nan"), float("inf"), -float("inf")])
def test_seeking_to_no_moment_stays_in_the_recording(nowhere: float) -> None:
    player = RecordingSource("khepera", a_life(3), Clock())
    player.seek(1.0)
    player.seek(nowhere)
    assert 0.0 <= player.position <= player.duration
    player.poll()


def test_a_robot_that_is_put_elsewhere_begins_a_new_path() -> None:
    emulated = Emulated()
    for x in (0.1, 0.11, 0.1105, 0.12, 0.5):
        emulated.place(truth(0.0, x))
    assert [pose.x for pose in emulated.path] == [0.5]
    emulated = Emulated()
    for x in (0.1, 0.11, 0.1105, 0.12):
        emulated.place(truth(0.0, x))
    assert [pose.x for pose in emulated.path] == [0.1, 0.11, 0.12]


def test_the_way_that_is_kept_has_an_end() -> None:
    emulated = Emulated()
    for k in range(6000):
        emulated.place(truth(0.0, 0.01 * (k % 4)))
    assert len(emulated.path) == 5000
