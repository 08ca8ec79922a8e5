"""The dashboard's parts: drawings, words, differences, and scrubbing through a recording."""

import asyncio
import json
import logging
import tracemalloc
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from math import radians
from pathlib import Path
from typing import Any

import pytest
from as_type import as_type, not_none
from controller_helpers import a_decision, a_state
from khepera_protocol.zenoh.controller_payloads import Phase
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR
from khepera_protocol.zenoh.payloads import Outline, Pose, Solid, Truth, Wire, WireEntry
from starlette.websockets import WebSocketDisconnect
from watching_helpers import (
    BEGIN,
    SECOND,
    a_life,
    a_picture,
    hypothesis,
    json_event,
    learned,
    truth,
)

from macor_hil.errors import TelemetryError
from macor_hil.hardware.robots.khepera.form import KHEPERA
from macor_hil.monitor.dashboard import playing
from macor_hil.monitor.dashboard.board import Board, Parts
from macor_hil.monitor.dashboard.connection import Connection, difference
from macor_hil.monitor.dashboard.drawings import arena, charts, eyes, texts
from macor_hil.monitor.dashboard.failures import Failures
from macor_hil.monitor.dashboard.playing import BEFORE, RecordingSource, Timeline
from macor_hil.monitor.dashboard.sources import RecordingView, Shown
from macor_hil.monitor.dashboard.wishes import Wish
from macor_hil.monitor.driving import driver_of
from macor_hil.monitor.robot_state import Controlled, Emulated, MarkKind, RobotState
from macor_hil.monitor.way import PIECE, Way
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.playing_times import LONGEST_SILENCE
from macor_hil.telemetry.recordings.recording import Recorder, has_index, play_recording


def a_watched(**changes: Any) -> RobotState:
    watched = RobotState("khepera", Controlled(alive=True, met=True, state=a_state()))
    watched.controlled.learned = learned()
    watched.emulated = Emulated(alive=True, outline=as_type(Outline, EXAMPLES[Outline]))
    watched.emulated.place(truth(0.5, 0.1))
    watched.controlled.decide(a_decision(**changes), 1.0)
    watched.see(a_picture(), 1.0)
    return watched


def parts_of(watched: RobotState, now: float = 1.0, **others: RobotState) -> Parts:
    return Board().parts(watched, {watched.robot: watched, **others}, now)


def parsed(markup: object) -> ElementTree.Element:
    return ElementTree.fromstring(f"<g>{as_type(str, markup)}</g>")


def of_kind(markup: object, kind: str) -> list[ElementTree.Element]:
    return [each for each in parsed(markup).iter() if each.get("data-kind") == kind]


def text_of(part: object) -> str:
    return "".join(parsed(part).itertext())


def test_every_part_is_well_formed_whatever_is_known() -> None:
    watched = RobotState("khepera")
    board = Board()
    for event in [None, *a_life()]:  # at any moment of a life
        if event:
            watched.take(event)
        for name, part in board.parts(watched, {"khepera": watched}, 1.0).items():
            if isinstance(part, str) and "@" not in name:
                parsed(part)
    assert board.picture


def test_a_part_is_made_anew_only_when_what_it_shows_has_changed() -> None:
    watched, board = a_watched(), Board()
    others = {watched.robot: watched}
    before = board.parts(watched, others, 1.0)
    assert difference({}, before) == before
    assert difference(before, board.parts(watched, others, 1.0)) == {}
    watched.emulated.place(truth(0.6, 0.105))
    moved = difference(before, board.parts(watched, others, 1.0))
    changes = {"way/0", "bodies/khepera", "robot-rows"}
    assert changes <= set(moved) <= changes | {"near@viewBox"}


def test_the_end_of_a_long_way_is_sent_alone() -> None:
    watched, board = a_watched(), Board()
    others = {watched.robot: watched}
    for k in range(3 * PIECE):
        watched.emulated.place(truth(1.0 + k, 0.1 + 0.01 * k))
    before = board.parts(watched, others, 1.0)
    assert sum(name.startswith("way/") for name in before) == 4
    watched.emulated.place(truth(999.0, 0.1 + 0.03 * PIECE))
    changed = difference(before, board.parts(watched, others, 1.0))
    assert [name for name in changed if name.startswith("way/")] == ["way/3"]


def test_children_that_are_no_more_are_taken_away() -> None:
    assert difference({"way/0": "a", "way/1": "b"}, {"way/1": "b"}) == {"way/0": None}


def test_the_arena_shows_all_sequences_and_marks_the_best() -> None:
    weighed = [hypothesis(4.0, "straight", "left"), hypothesis(2.0, "left"), hypothesis(1.0, "x")]
    parts = parts_of(a_watched(hypotheses=weighed, frame_time=0.5))
    assert len(of_kind(parts["plans"], "hypothesis")) == 2
    (best,) = of_kind(parts["plans"], "best")
    assert best.get("data-value") == "4"
    assert len(of_kind(parts["plans"], "best-step")) == 2
    assert "3 hypothetical sequences" in as_type(str, parts["arena-title"])


@pytest.mark.parametrize("end", [Phase.STOPPED, Phase.FAILED, None])
def test_the_plan_goes_with_the_run(end: Phase | None) -> None:
    watched = a_watched(hypotheses=[hypothesis(4.0, "straight")], frame_time=0.5)
    assert parts_of(watched)["plans"]
    if end:
        watched.controlled.state = a_state(end)
    else:
        watched.take(Presence(CONTROLLER, False, 0))
    parts = parts_of(watched)
    assert parts["plans"] == ""
    assert parts["decision-card@data-gone"] == ""


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
    watched = RobotState("khepera", Controlled(alive=True, learned=learned()))
    for k in range(3):
        watched.controlled.decide(a_decision(k), None)
    pieces = arena.way_pieces(watched)
    assert [len(piece) for piece in pieces.values()] == [4]
    assert pieces[0][0].x == 0.0
    (_, way), *_ = arena.hypothetical_ways(watched)
    assert way[0] == (pieces[0][-2].x, pieces[0][-2].y)
    assert of_kind(parts_of(watched)["plans"], "best")


def a_room(*, gap: bool = False) -> Outline:
    """A square of a metre with walls around it, one of them perhaps with a gap."""
    walls = [
        [(0.0, 0.0), (1.0, 0.0), (1.0, 0.02), (0.0, 0.02)],
        [(0.0, 0.98), (1.0, 0.98), (1.0, 1.0), (0.0, 1.0)],
        [(0.98, 0.0), (1.0, 0.0), (1.0, 1.0), (0.98, 1.0)],
        [(0.0, 0.0), (0.02, 0.0), (0.02, 0.5 if gap else 1.0), (0.0, 0.5 if gap else 1.0)],
    ]
    example = as_type(Outline, EXAMPLES[Outline])
    solids = [Solid(corners=corners, colour=(1.0, 1.0, 1.0)) for corners in walls]
    start = Pose(x=0.5, y=0.5, heading=0.0)
    return example.model_copy(update={"solids": solids, "start": start})


@pytest.mark.parametrize("gap", [False, True])
def test_the_floor_ends_at_the_walls(gap: bool) -> None:
    floor = next(iter(parsed(arena.ground(a_room(gap=gap)))))
    places = [tuple(map(int, each.split(","))) for each in (floor.get("points") or "").split()]
    # without walls all around, up to the outermost ones
    low, high = (0, 1000) if gap else (15, 985)
    assert abs(min(x for x, _ in places) - low) <= 8
    assert abs(max(x for x, _ in places) - high) <= 8


def test_the_view_ends_at_the_walls_and_has_a_scale_below_them() -> None:
    window = arena.whole(a_room(), ())
    assert window.left == pytest.approx(-0.02)
    assert window.bottom < -0.05
    assert window.width == pytest.approx(1.04)
    assert text_of(arena.scale(window)) == "20 cm"


def test_robots_of_the_same_world_are_drawn_together() -> None:
    def one(name: str, world: str, x: float, radius: float = 0.0275) -> RobotState:
        watched = RobotState(name)
        shape = {"world": world, "robot_radius": radius}
        watched.emulated = Emulated(alive=True, outline=a_room().model_copy(update=shape))
        watched.emulated.place(truth(0.5, x))
        return watched

    first, second, other = one("a", "w", 0.1), one("b", "w", 0.3, 0.035), one("c", "other", 0.5)
    parts = parts_of(first, b=second, c=other)
    assert {name for name in parts if name.startswith("bodies/")} == {"bodies/a", "bodies/b"}
    assert "chosen" in as_type(str, parts["bodies/a"])
    assert "chosen" not in as_type(str, parts["bodies/b"])
    assert [next(parsed(parts[f"bodies/{name}"]).iter("circle")).get("r") for name in "ab"] == [
        "28",
        "35",
    ]
    assert [each.text for each in parsed(parts["roster"]).iter("strong")] == ["a", "b", "c"]
    assert [parts[f"robot-{k}@aria-pressed"] for k in range(3)] == ["true", "false", "false"]
    second.take(Presence(EMULATOR, False, 0))
    assert "bodies/b" not in parts_of(first, b=second, c=other)


def test_receptive_fields_are_drawn_with_what_they_see() -> None:
    parts = parts_of(a_watched())
    assert len(of_kind(parts["profiles"], "field")) == 12
    assert len(of_kind(parts["features"], "feature")) == 36


def test_a_picture_that_is_none_is_not_given_to_a_browser() -> None:
    watched, board = a_watched(), Board()
    board.parts(watched, {}, 1.0)
    good = board.picture
    assert good.startswith(b"\xff\xd8")
    watched.see(b"no picture", 2.0)
    board.parts(watched, {}, 2.0)
    assert board.picture is good


def test_the_panorama_is_unwrapped_by_the_geometry_that_the_map_tells() -> None:
    assert eyes.geometry(learned())["outer"] == learned().eye.outer
    assert eyes.geometry(None)["rows"] == 80


def test_columns_have_a_cell_for_every_neuron_and_the_brightest_is_the_present_one() -> None:
    parts = parts_of(a_watched())
    assert sum(1 for _ in parsed(parts["columns"]).iter("i")) == 150
    cells = as_type(dict, parts["cells"])
    assert len(cells["levels"]) == 150
    assert (cells["now"], cells["levels"][53], cells["levels"][0]) == (53, "a", "0")
    assert cells["ahead"] == [(18 * 3 + 2, 1), (4 * 3, 2)]
    assert text_of(parts["row-names"]) == "left, right, straight"


def test_collisions_and_failures_are_marked() -> None:
    watched = a_watched()
    watched.take(json_event(CONTROLLER, "decision", a_decision(4, collided=True), 5.0))
    backing = a_state(Phase.BACKING_OFF, driven=5)
    watched.take(json_event(CONTROLLER, "state", backing, 5.05))
    state = a_state(Phase.RECOVERING, driven=3, reason="the cable")
    watched.take(json_event(CONTROLLER, "state", state, 5.1))
    touching = as_type(Truth, truth(6.0, 0.12)).model_copy(update={"contact": True})
    watched.take(json_event(EMULATOR, "truth", touching, 5.2))
    kinds = [MarkKind.COLLISION, MarkKind.FAILURE, MarkKind.CONTACT]
    assert [mark.kind for mark in watched.marks] == kinds
    parts = parts_of(watched)
    shown = [each.get("class") for each in of_kind(parts["marks"], "mark")]
    assert shown == ["mark collision", "mark failure", "mark contact"]
    bars = of_kind(parts["rewards"], "reward")
    assert [bar.get("class") for bar in bars] == ["reward", "reward collided"]
    assert "failure" in as_type(str, parts["rewards"])


def test_sensors_are_drawn_as_long_as_they_read() -> None:
    wedges = of_kind(charts.infrared(KHEPERA, [0, 12, 1023, 4, 5, 6, 7, 8]), "sensor")
    assert len(wedges) == 8
    assert wedges[2].get("class") == "sensor near"


def test_text_from_elsewhere_stays_text() -> None:
    evil = "<script>alert(1)</script>"
    watched = a_watched(command=evil, hypotheses=[hypothesis(1.0, evil)])
    watched.controlled.learned = learned().model_copy(
        update={"commands": [learned().commands[0].model_copy(update={"name": evil})]}
    )
    watched.controlled.state = a_state(Phase.FAILED, reason=evil, map=evil)
    for entry in ("request", "reply", "fault"):
        text = f"{evil}\r\n"
        told = Wire(first=0, entries=[WireEntry(time=0.0, what=entry, text=text)])
        watched.emulated.line.take(told, 1.0)
    watched.robot = evil
    for part in parts_of(watched).values():
        assert not isinstance(part, str) or "<script" not in part


def test_what_fails_in_the_page_is_counted_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    failures = Failures()
    assert failures.words() == ""
    with caplog.at_level(logging.ERROR):
        for _ in range(3):
            with failures:
                "".index("\x1b[31m")
    assert failures.words().startswith("the page failed 3 times, please report it: ValueError: ")
    assert len(caplog.records) == 1
    with pytest.raises(KeyboardInterrupt), failures:
        raise KeyboardInterrupt


def test_the_badge_tells_who_drives() -> None:
    watched = RobotState("khepera")
    assert driver_of(watched, 0.0).words == "waiting for a robot"
    watched.emulated.alive = True
    assert driver_of(watched, 0.0)[1:3] == ("calm", "nobody drives")
    watched = a_watched()
    assert driver_of(watched, 0.0)[1:3] == ("good", "controller driving, 3 of 40 commands")
    watched.controlled.state = a_state(Phase.FAILED, reason="the cable")
    failed = ("bad", "controller failed, 3 of 40 commands; the cable")
    assert driver_of(watched, 0.0)[1:3] == failed
    watched.emulated.place(at_rest())
    watched.take(Presence(CONTROLLER, False, 0))
    ended = "nobody drives; last run failed after 3 of 40 commands: the cable"
    assert driver_of(watched, 60.0).words == ended
    watched.take(Presence(CONTROLLER, True, 0))
    watched.controlled.state = a_state(Phase.TRAINING, driven=6700, limit=13400)
    training = "training, 50 %: 6700 of 13400 commands"
    assert driver_of(watched, 60.0)[1:3] == ("good", training)


def test_a_long_reason_stands_apart_from_the_badge_and_in_full() -> None:
    sentence = "the robot at rfc2217://127.0.0.1:4003 gives no answer; check cable and power" * 4
    watched = a_watched()
    watched.controlled.state = a_state(Phase.FAILED, reason=sentence)
    parts = parts_of(watched)
    assert text_of(parts["driver"]) == "controller failed, 3 of 40 commands"
    assert text_of(parts["reason"]) == sentence
    assert parts["reason@data-mood"] == "bad"
    watched.emulated.place(at_rest())
    watched.take(Presence(CONTROLLER, False, 0))
    parts = parts_of(watched, 60.0)
    assert text_of(parts["driver"]).endswith("; last run failed after 3 of 40 commands")
    assert text_of(parts["reason"]) == sentence
    watched.take(Presence(CONTROLLER, True, 0))
    assert parts_of(watched)["reason"] == ""


def at_rest() -> Truth:
    return as_type(Truth, truth(0.5, 0.1)).model_copy(update={"speed": (0.0, 0.0)})


def on_the_line(first: int, *requests: str) -> Wire:
    entries = [WireEntry(time=0.0, what="request", text=request) for request in requests]
    return Wire(first=first, entries=entries)


def test_a_program_on_the_line_is_not_nobody() -> None:
    watched = RobotState("khepera", emulated=Emulated(alive=True))
    line = watched.emulated.line
    line.take(on_the_line(0, "N\n", "H\n"), 10.0)
    assert driver_of(watched, 11.0).words == "another program talks to the robot"
    assert driver_of(watched, 20.0).words == "nobody drives"
    line.take(on_the_line(2, "N\nD,", "5,5\n"), 30.0)
    assert driver_of(watched, 31.0)[1:3] == ("good", "another program drives")
    assert driver_of(watched, 60.0).words == "nobody drives"
    # a speed is held without another request
    watched.emulated.place(as_type(Truth, EXAMPLES[Truth]))
    assert driver_of(watched, 60.0).words == "another program drives"
    watched.emulated.alive = False
    assert driver_of(watched, 60.0).words == "the robot has gone"


def test_the_last_requests_of_a_controller_are_no_other_programs() -> None:
    watched = a_watched()
    watched.emulated.place(at_rest())
    watched.take(Presence(CONTROLLER, False, 100 * SECOND))
    watched.emulated.line.take(on_the_line(0, "D,0,0\n"), 100.3)
    assert driver_of(watched, 101.5).words.startswith("nobody drives; last run")
    watched.emulated.line.take(on_the_line(1, "D,5,5\n"), 101.6)
    assert driver_of(watched, 102.0).words == "another program drives"


def test_a_robot_of_another_program_is_known_from_its_line() -> None:
    watched = RobotState("khepera", emulated=Emulated(alive=True))
    entries = [
        ("request", "N\n"),
        ("reply", "n,0,12,1023,4,5,6,7,8\r\n"),
        ("request", "L,0,1\n"),
        ("reply", "l\r\n"),
    ]
    told = [WireEntry(time=0.0, what=what, text=text) for what, text in entries]
    watched.emulated.line.take(Wire(first=0, entries=told), 10.0)
    parts = parts_of(watched, 10.5)
    assert len(of_kind(parts["infrared"], "sensor")) == 8
    assert "lateral on" in text_of(parts["robot-rows"])
    assert parts["decision-card@data-empty"] == "no controller"
    assert parts["robot-card@data-empty"] is None


def test_nothing_of_a_robot_that_has_gone_looks_alive() -> None:
    watched = a_watched()
    for k in range(20):
        watched.see(a_picture(), 1.0 + 0.1 * k)
    alive = {row.name: row for row in texts.health(watched, 3.0)}
    assert alive["pictures"].value == "10.0/s"
    assert not alive["pictures"].gone
    assert "160 and 158 mm/s" in text_of(parts_of(watched, 3.0)["robot-rows"])
    assert parts_of(watched, 3.0)["camera-card@data-stale"] is None
    assert parts_of(watched, 30.0)["camera-card@data-stale"] == ""  # no new picture
    watched.take(Presence(CONTROLLER, False, 0))
    watched.take(Presence(EMULATOR, False, 0))
    parts = parts_of(watched, 3.0)
    assert parts["camera-card@data-stale"] == ""
    assert parts["robot-card@data-gone"] == ""
    dead = {row.name: row for row in texts.health(watched, 60.0)}
    assert dead["pictures"] == ("pictures", "0.0/s, last one 57 s ago", True)
    assert "0 and 0 mm/s" in text_of(parts["robot-rows"])
    assert "was at" in text_of(parts["robot-rows"])


class Reading:
    """A recording whose events are counted when they are read."""

    def __init__(self, events: Sequence[Event]) -> None:
        self.events = events
        self.read = 0

    def __call__(self, begin: float, **_: bool) -> tuple[str, Iterator[Event]]:
        if begin <= 0.0:
            return "khepera", self._counted(self.events)
        time = self.events[0].received + round(begin * SECOND)
        latest: dict[tuple[str, str], Event] = {}
        for event in self.events:
            if event.received < time:
                latest[event.side, getattr(event, "leaf", "alive")] = event
        rest = [event for event in self.events if event.received >= time]
        return "khepera", self._counted([*latest.values(), *rest])

    def _counted(self, events: Sequence[Event]) -> Iterator[Event]:
        for event in events:
            self.read += 1
            yield event


@cache
def a_long_life() -> Sequence[Event]:
    return tuple(a_life(150))


def timeline_of(events: Sequence[Event], *, has_index: bool = True) -> Timeline:
    return Timeline(Reading(events), has_index=has_index)


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_recording_is_scrubbed_forth_and_back() -> None:
    player = RecordingSource(timeline_of(a_life(3)), Clock())
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
    player = RecordingSource(timeline_of(a_life(3)), clock)
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
    timeline = timeline_of(a_life(3))
    first, second = (RecordingSource(timeline, Clock()) for _ in range(2))
    first.seek(2.9)
    second.toggle()
    assert (first.position, first.playing) == (2.9, True)
    assert (second.position, second.playing) == (0.0, False)


def test_a_page_reads_of_a_recording_what_it_shows() -> None:
    reading = Reading(a_long_life())
    timeline = Timeline(reading, has_index=True)
    whole, reading.read = reading.read, 0
    pages = [RecordingSource(timeline, Clock()) for _ in range(2)]
    assert pages[0].moments is pages[1].moments
    for position in (148.0, 20.0, 30.0):
        pages[0].seek(position)
    a_minute = whole * BEFORE / pages[0].duration
    assert a_minute < reading.read < a_minute + whole / 4
    read = reading.read
    pages[0].seek(33.0)
    assert reading.read < read + 20


@pytest.mark.parametrize("has_index", [True, False])
def test_a_moment_is_the_same_however_it_was_come_to(has_index: bool) -> None:
    """A leap knows all that is known after playing on to there, but for ways and curves."""
    events = a_long_life()
    player = RecordingSource(timeline_of(events, has_index=has_index), Clock())
    player.playing = False
    for position in (130.3, 80.7, 100.9, 149.0, 3.2, 1e9, 0.0):
        player.seek(position)
        player.poll()
        direct = RobotState("khepera")
        for event in events:
            if event.received <= BEGIN + round(player.position * SECOND):
                direct.take(event)
        for side in ("controlled", "emulated"):
            known, wanted = getattr(player.watched, side), getattr(direct, side)
            assert known.alive == wanted.alive
        assert player.watched.controlled.decision == direct.controlled.decision
        assert player.watched.controlled.state == direct.controlled.state
        assert player.watched.emulated.outline == direct.emulated.outline
        assert player.watched.emulated.truth == direct.emulated.truth
        assert player.watched.frame == direct.frame
        last = [past.sequence for past in direct.controlled.history][-50:]
        assert [past.sequence for past in player.watched.controlled.history][-50:] == last
        assert player.watched.controlled.missed == direct.controlled.missed


@pytest.mark.parametrize("has_index", [True, False])
def test_times_that_were_set_are_played_on(has_index: bool) -> None:
    """A silence of hours lasts a minute, and a clock that went back does not matter."""
    life = a_long_life()
    hours = 5 * 3600 * SECOND
    cut = len(life) // 2
    for shift in (hours, -hours):
        moved = [*life[:cut], *(replace(e, received=e.received + shift) for e in life[cut:])]
        player = RecordingSource(timeline_of(moved, has_index=has_index), Clock())
        pause = LONGEST_SILENCE if shift > 0 else 0.0
        assert player.duration == pytest.approx(151.0 + pause, abs=1.0)
        for position in (player.duration - 5.0, 20.0, player.duration - 60.0):
            player.seek(position)
            player.poll()
            decision = not_none(player.watched.controlled.decision)
            late = pause if position > 76.0 + pause else 0.0
            assert decision.sequence == pytest.approx(position - late - 1.0, abs=1.5)


def test_a_leap_without_an_index_is_taken_in_bounded_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(playing, "AT_ONCE", 200)
    events = a_long_life()
    player = RecordingSource(timeline_of(events, has_index=False), Clock())
    player.seek(1e9)
    steps = 0
    while player.watched.controlled.alive or player.watched.controlled.decision is None:
        taken = player.watched.version
        player.poll()
        assert 0 < player.watched.version - taken <= 200
        steps += 1
    assert steps == len(events) // 200


class Counted(bytes):
    """Data of an event that tells how many there are at once."""

    there = most = 0

    def __new__(cls, data: bytes) -> "Counted":
        cls.there += 1
        cls.most = max(cls.most, cls.there)
        return super().__new__(cls, data)

    def __del__(self) -> None:
        type(self).there -= 1


def test_a_recording_is_not_held_in_memory() -> None:
    events = a_long_life()

    def read(begin: float, **_: bool) -> tuple[str, Iterator[Event]]:
        assert begin <= 0.0
        return "khepera", (
            replace(event, data=Counted(event.data)) if isinstance(event, Arrival) else event
            for event in events
        )

    player = RecordingSource(Timeline(read, has_index=False), Clock())
    for position in (100.0, 10.0, 1e9):
        player.seek(position)
        player.poll()
    assert player.watched.version > len(events)
    assert 0 < Counted.most < 10


@pytest.mark.long
def test_a_recording_ten_times_as_long_takes_no_more_memory(tmp_path: Path) -> None:
    def used(decisions: int) -> int:
        path = tmp_path / f"{decisions}.mcap"
        with Recorder(path, "khepera") as recorder:
            for event in a_life(decisions):
                recorder.write(event)
        tracemalloc.start()
        try:
            reading = partial(play_recording, path)
            player = RecordingSource(Timeline(reading, has_index=has_index(path)), Clock())
            player.seek(player.duration / 2)
            player.poll()
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    short, long = used(130), used(1300)
    assert long < short + 2_000_000


@pytest.mark.parametrize("nowhere", [float("nan"), float("inf"), -float("inf")])
def test_seeking_to_no_moment_stays_in_the_recording(nowhere: float) -> None:
    player = RecordingSource(timeline_of(a_life(3)), Clock())
    player.seek(1.0)
    player.seek(nowhere)
    assert 0.0 <= player.position <= player.duration
    player.poll()


def test_a_recording_is_marked_where_something_went_wrong() -> None:
    life = a_life(3)
    at = next(k for k, event in enumerate(life) if getattr(event, "leaf", "") == "decision")
    life[at] = json_event(CONTROLLER, "decision", a_decision(0, collided=True), 1.8)
    failed = a_state(Phase.FAILED, reason="the cable")
    backing = a_state(Phase.BACKING_OFF)  # after every collision: no failure
    life.insert(at + 1, json_event(CONTROLLER, "state", backing, 1.85))
    life.insert(at + 2, json_event(CONTROLLER, "state", failed, 1.9))
    player = RecordingSource(timeline_of(life), Clock())
    assert player.moments == {
        "moments": [[1.8, "collision", "collision"], [1.9, "failure", "failure"]]
    }


class Browser:
    """A WebSocket that keeps what it is sent, and goes after so many messages."""

    def __init__(self, *wishes: str) -> None:
        self.got: list[Any] = []
        self._wishes = list(wishes)

    async def send_text(self, text: str) -> None:
        self.got.append(json.loads(text))

    async def send_bytes(self, data: bytes) -> None:
        self.got.append(data)

    async def receive_text(self) -> str:
        await asyncio.sleep(0)
        if self._wishes:
            return self._wishes.pop(0)
        raise WebSocketDisconnect(1000)


def talk(browser: Browser, view: Any, steer: Any = None) -> list[Any]:
    asyncio.run(Connection(as_type_any(browser), view, Failures(), steer).serve())
    return browser.got


def as_type_any(browser: Browser) -> Any:
    return browser


def wish(**what: Any) -> str:
    return json.dumps(what)


def test_a_browser_plays_its_recording() -> None:
    view = RecordingView(RecordingSource(timeline_of(a_life(3)), Clock()))
    said = talk(
        Browser(wish(do="seek", value=2.9), wish(do="toggle"), wish(do="speed", value=4.0)), view
    )
    assert (view.player.position, view.player.playing, view.player.speed) == (2.9, False, 4.0)
    assert not any("said" in each for each in said if isinstance(each, dict))


class Still:
    """A view of nothing in particular."""

    robot = "khepera"

    def show(self) -> Shown:
        return Shown({}, b"")


@pytest.mark.parametrize(
    "text", ["", "no JSON", "[]", wish(do="format"), wish(do="seek", value=None)]
)
def test_what_is_no_wish_is_refused(text: str) -> None:
    (answer,) = (each for each in talk(Browser(text), Still()) if "said" in each)
    assert answer["bad"]


def test_a_page_that_only_watches_steers_nothing() -> None:
    (answer,) = (each for each in talk(Browser(wish(do="stop")), Still()) if "said" in each)
    assert answer["said"].startswith("this dashboard only watches")


def test_a_page_that_may_steer_tells_what_came_of_it() -> None:
    asked: list[tuple[str, Wish]] = []

    def steer(robot: str, what: Wish) -> str:
        asked.append((robot, what))
        if what.do == "stop":
            raise TelemetryError("nobody answers")
        return "done"

    browser = Browser(wish(do="place", x=0.1, y=0.2, heading=1.5), wish(do="stop"))
    said = [each for each in talk(browser, Still(), steer) if "said" in each]
    assert said == [{"said": "done"}, {"said": "nobody answers", "bad": True}]
    assert asked[0][0] == "khepera"
    assert (asked[0][1].x, asked[0][1].heading) == (0.1, 1.5)


def test_a_robot_that_is_put_elsewhere_begins_a_new_way() -> None:
    emulated = Emulated()
    for x in (0.1, 0.11, 0.1105, 0.12, 0.5):
        emulated.place(truth(0.0, x))
    assert [pose.x for pose in emulated.way] == [0.5]
    emulated = Emulated()
    for x in (0.1, 0.11, 0.1105, 0.12):
        emulated.place(truth(0.0, x))
    assert [pose.x for pose in emulated.way] == [0.1, 0.11, 0.12]


def test_the_way_that_is_kept_has_an_end() -> None:
    way = Way()
    for k in range(10_000):
        way.add(Pose(x=0.01 * (k % 4), y=0.0, heading=0.0))
    assert len(way.pieces) == 80
    assert len(list(way)) == 79 * (PIECE - 1) + len(way.pieces[-1])
    assert way.first > 70
