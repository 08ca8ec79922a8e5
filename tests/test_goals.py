"""Driving to goals: charts, their worth, whereabouts, the planner, and the shortest ways."""

from io import StringIO
from math import pi, radians
from pathlib import Path

import numpy as np
import pytest
from as_type import as_type, not_none
from controller_helpers import a_decision
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.controller_payloads import Goal as SeenGoal
from khepera_protocol.zenoh.payloads import Pose, Reset
from rich.console import Console
from short_training import train_shortly
from standin import StandIn
from typer.testing import CliRunner
from worlds import arena

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.models import KHEPERA
from khepera_emulator.routes.feelers import Poses
from khepera_emulator.routes.oracle import Oracle
from khepera_emulator.routes.regions import Region, edge_points
from khepera_emulator.senses.camera import HEIGHT
from khepera_emulator.world.outline import outline
from macor_hil.arrays import Array
from macor_hil.cli.common import decision_line
from macor_hil.cli.program import app
from macor_hil.errors import MacorError
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.experience import Moment
from macor_hil.mind.foresight.chart.links import relative
from macor_hil.mind.foresight.chart.matching import agreement, fitted
from macor_hil.mind.foresight.chart.views import Views
from macor_hil.mind.map_file import load_map
from macor_hil.mind.memories.places import PlacesMemory
from macor_hil.mind.planners.destinations import NAMES, destination
from macor_hil.mind.planners.goal import Goal
from macor_hil.mind.planners.planner import Aim, Plan, aim_of, is_over
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.monitor.dashboard.drawings import eyes, texts
from macor_hil.monitor.robot_state import RobotState
from macor_hil.monitor.terminal_view import render
from macor_hil.runs.agent import Agent
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.runs.trials import run_trial

RED, BLUE, WHITE, YELLOW = (0.85, 0.2, 0.2), (0.3, 0.5, 0.85), (0.9, 0.9, 0.85), (0.85, 0.75, 0.25)

ROOMS = arena(
    start={"x": 0.12, "y": 0.15},
    free={
        "points": [[0.1, 0.15], [0.6, 0.15]],
        "half_width": 0.1,
        "heading_spread": 180,
        "gap": 0.02,
    },
    wall=[
        {"points": [[0.35, 0.0], [0.0, 0.0], [0.0, 0.3]], "colour": WHITE},
        {"points": [[0.0, 0.3], [0.7, 0.3]], "colour": YELLOW},
        {"points": [[0.7, 0.3], [0.7, 0.0]], "colour": RED},
        {"points": [[0.7, 0.0], [0.35, 0.0]], "colour": BLUE},
        {"points": [[0.35, 0.0], [0.35, 0.08]], "colour": YELLOW},
    ],
)
"""Two rooms; the farthest wall of the second one is red."""


@pytest.fixture(scope="module")
def trained() -> tuple[PlacesMemory, Array]:
    memory = PlacesMemory(120)
    poses = StandIn(ROOMS).train(memory, 1_500)
    return memory, poses


def test_a_match_tells_the_motion_between_two_views_and_refuses_others() -> None:
    robot = StandIn(ROOMS)
    poses = np.array([[0.15, 0.15, 0.3], [0.165, 0.14, 0.5], [0.5, 0.2, 0.3]])
    views = []
    for pose in poses:
        robot.pose = pose
        views.append(not_none(robot.look().floor).astype(np.float32)[np.newaxis])
    true = relative(poses[:1], poses[1:2]) / (HEIGHT, HEIGHT, 1.0)
    motion, _ = fitted(views[0], views[1], np.zeros((1, 3)), rounds=8)
    np.testing.assert_allclose(motion, true, atol=0.01)
    assert agreement(views[0], views[1], motion)[0] > 0.95
    wrong, _ = fitted(views[0], views[2], np.zeros((1, 3)), rounds=8)
    assert agreement(views[0], views[2], wrong)[0] < 0.9


def test_a_chart_has_all_places_where_they_are(trained: tuple[PlacesMemory, Array]) -> None:
    memory, true = trained
    chart = not_none(memory.atlas).chart
    known = chart.known
    assert len(known) > 0.95 * np.count_nonzero(memory.state()["collided"] == 0)
    begin, end = np.random.default_rng(1).choice(known, (2, 2000))
    ours = relative(chart.poses[begin], chart.poses[end])
    theirs = relative(true[begin], true[end]) / (HEIGHT, HEIGHT, 1.0)
    off = np.hypot(*(ours - theirs)[:, :2].T)
    assert np.median(off) < 0.1
    assert np.percentile(off, 95) < 0.3


def test_its_ground_has_the_room_that_there_is(trained: tuple[PlacesMemory, Array]) -> None:
    memory, true = trained
    atlas, robot = not_none(memory.atlas), StandIn(ROOMS)
    some = np.random.default_rng(2).choice(atlas.chart.known, 200)
    column, row = np.rint(atlas.ground.places(atlas.chart.poses[some])).astype(int).T
    room = atlas.ground.clearance[row, column]
    there = np.array([robot.plan.clearance(x, y) for x, y, _ in true[some]]) / HEIGHT
    assert np.median(np.abs(room - there)) < 0.12


def test_it_finds_where_a_view_was_taken(trained: tuple[PlacesMemory, Array]) -> None:
    memory, true = trained
    atlas, robot = not_none(memory.atlas), StandIn(ROOMS, seed=7)
    anchor = atlas.chart.known[0]
    off = []
    for _ in range(40):
        robot.put_down()
        seen = robot.look()
        view = Views.of(not_none(seen.floor)[np.newaxis], not_none(seen.sights)[np.newaxis])
        pose = atlas.whereabouts.find(view)
        if pose is not None:
            ours = relative(atlas.chart.poses[anchor][np.newaxis], pose[np.newaxis])
            theirs = relative(true[anchor][np.newaxis], robot.pose[np.newaxis])
            off.append(np.hypot(*(ours - theirs / (HEIGHT, HEIGHT, 1.0))[0, :2]))
    assert len(off) >= 36
    assert np.median(off) < 0.15
    unknown = Views.of(np.full((1, 120), 0.7), np.full((1, 24, 5), 0.5))
    assert atlas.whereabouts.find(unknown) is None


@pytest.mark.parametrize("name", ["red", "along:blue"])
def test_it_drives_to_the_goal_by_nearly_the_shortest_way(
    name: str, trained: tuple[PlacesMemory, Array]
) -> None:
    memory, _ = trained
    planner, robot = Goal(name), StandIn(ROOMS, seed=3)
    seen = outline(ROOMS, KHEPERA)
    search = Oracle(seen)
    colour = RED if name == "red" else BLUE
    region = Region(edge_points(seen, colour), seen, 0.12)
    driven = shortest = 0
    for x, y, heading in ((0.1, 0.2, 0.0), (0.2, 0.12, radians(60)), (0.12, 0.12, radians(20))):
        start = Pose(x=x, y=y, heading=heading)
        robot.put_down(start)
        best = len(not_none(search.shortest_way(start, region.holds, 100)))
        now, count = robot.look(), 0
        while not not_none(aim_of(planner, now)).reached:
            command = not_none(planner.plan(memory, now).command)
            assert not robot.drive(command)
            now, count = robot.look(command), count + 1
            assert count < 2 * best + 10
        driven, shortest = driven + count, shortest + best
        assert is_over(aim_of(planner, now)) == (name == "red")
    assert driven <= 1.3 * shortest


def test_what_is_learned_serves_all_goals(trained: tuple[PlacesMemory, Array]) -> None:
    memory, _ = trained
    atlas = memory.atlas
    for name in ("red", "blue", "along:yellow"):
        planner = Goal(name)
        planner.prepare(memory)
    assert memory.atlas is atlas


def test_places_come_back_as_they_were_kept(trained: tuple[PlacesMemory, Array]) -> None:
    memory, _ = trained
    other = PlacesMemory(120)
    other.load(memory.state())
    for name, array in memory.state().items():
        np.testing.assert_array_equal(other.state()[name], array)
    for name, wrong in {
        "sights": memory.state()["sights"][:5],
        "profiles": memory.state()["profiles"] * 0,
        "commands": memory.state()["commands"][:5],
    }.items():
        with pytest.raises(ValueError, match=r"\w"):
            PlacesMemory(120).load({**memory.state(), name: wrong})
    with pytest.raises(ValueError, match="sights"):
        other.load({**memory.state(), "sights": memory.state()["sights"].astype(float)})


def test_too_little_gives_no_plan() -> None:
    memory, robot = PlacesMemory(120), StandIn(ROOMS)
    assert Goal().plan(memory, robot.look()).command is None
    robot.train(memory, 20)
    assert memory.atlas is None
    assert Goal().plan(memory, robot.look()).command is None


def test_what_shows_too_little_is_looked_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[int] = []

    def too_little(*arrays: Array) -> None:
        looks.append(len(arrays[0]))

    monkeypatch.setattr("macor_hil.mind.memories.places.atlas_of", too_little)
    memory, robot = PlacesMemory(120), StandIn(ROOMS)
    robot.train(memory, 20)
    planner = Goal()
    for _ in range(3):
        planner.plan(memory, robot.look())
    assert len(looks) == 1
    robot.train(memory, 5)
    planner.plan(memory, robot.look())
    assert len(looks) == 2


def test_a_goal_is_seen_by_its_colour_and_reached_when_it_is_near() -> None:
    robot, goal = StandIn(ROOMS), destination("red")
    robot.put_down(Pose(x=0.5, y=0.15, heading=pi / 2))
    far = robot.look()
    assert goal.bearing(not_none(far.floor), not_none(far.sights)) == pytest.approx(
        -pi / 2, abs=0.3
    )
    assert not goal.reached(not_none(far.floor), not_none(far.sights))
    robot.put_down(Pose(x=0.63, y=0.15, heading=pi / 2))
    near = robot.look()
    assert goal.reached(not_none(near.floor), not_none(near.sights))
    robot.put_down(Pose(x=0.1, y=0.05, heading=0.0))
    hidden = robot.look()
    assert not destination("green").shown(not_none(hidden.sights)).any()
    assert destination("green").bearing(not_none(hidden.floor), not_none(hidden.sights)) is None


def test_a_lamp_is_reached_when_it_is_seen_high() -> None:
    lamp = destination("lamp")
    sights = np.zeros((24, 5))
    floor = np.full(120, 0.5)
    assert lamp.bearing(floor, sights) is None
    sights[12, 3:] = 0.7, 0.8
    assert not lamp.reached(floor, sights)
    assert lamp.bearing(floor, sights) == pytest.approx(-radians(7.5))
    sights[12, 4] = 0.95
    assert lamp.reached(floor, sights)


def test_goals_that_there_are_not_are_refused_with_a_hint(tmp_path: Path) -> None:
    with pytest.raises(MacorError, match="did you mean yellow"):
        destination("yelow")
    assert all(destination(name).name == name for name in NAMES)
    said = CliRunner().invoke(
        app, ["run", "--goal", "alog:blue", "--map", str(tmp_path / "no.npz")]
    )
    assert said.exit_code
    assert "did you mean along:blue" in str(said.exception)


def test_the_option_makes_the_planner(tmp_path: Path) -> None:
    options = RunOptions(goal="lamp", map_file=tmp_path / "no.npz")
    assert options.planner_name == "goal"
    assert as_type(Goal, options.make_planner()).destination.name == "lamp"
    assert RunOptions(planner="reactive").planner_name == "reactive"
    with pytest.raises(MacorError, match="goal"):
        RunOptions(goal="red", planner="reactive").make_planner()
    assert aim_of(Reactive(), StandIn(ROOMS).look()) is None


def test_a_map_without_places_is_refused_before_anything_moves() -> None:
    old = Path(__file__).parent / "maps" / "version-3.npz"
    with pytest.raises(MacorError, match="places"):
        serve(RunOptions(goal="red", map_file=old, port="khepera://maze", listen=()))


def test_a_run_ends_at_its_goal_and_tells_of_it(tmp_path: Path) -> None:
    map_file = train_shortly(tmp_path / "box.npz", tuning=30, random=600)
    assert as_type(PlacesMemory, load_map(map_file)[0].memories["places"]).atlas is not None
    told: list[Decision] = []
    report = serve(
        RunOptions(
            goal="red",
            map_file=map_file,
            port="khepera://open-box?seed=1&drift=none",
            commands=60,
            listen=(),
        ),
        told.append,
    )
    assert report.ending == "goal reached"
    assert not report.collided
    last = told[-1].goal
    assert last is not None
    assert (last.name, last.reached) == ("red", True)
    assert not any(not_none(decision.goal).reached for decision in told[:-1])


class AtHome:
    """Has reached its goal wherever it is."""

    memory = "transitions"

    def plan(self, _memory: object, _now: Moment) -> Plan:
        raise AssertionError("there is nothing to plan")

    def aim(self, _now: Moment) -> Aim:
        return Aim("home", reached=True)


def test_a_trial_that_begins_at_its_goal_drives_no_command() -> None:
    with open_hardware("khepera://open-box?seed=1") as hardware:
        agent = Agent(build_brain(), Driver(hardware.robot), hardware.camera)
        agent.begin(learn=True)  # situations cannot be recognised without any
        rng = np.random.default_rng(1)
        driven = run_trial(agent, AtHome(), not_none(hardware.bench), Reset(), rng, 5)
    assert (driven.length, driven.reached, driven.collided) == (0, True, False)


def test_the_shortest_way_is_that_of_exhaustive_search() -> None:
    seen = outline(ROOMS, KHEPERA)
    search, region = Oracle(seen), Region(edge_points(seen, RED), seen, 0.12)
    start = Pose(x=0.46, y=0.15, heading=0.4)
    way = not_none(search.shortest_way(start, region.holds, 30))
    layer, commands = Poses(*(np.array([v]) for v in (start.x, start.y, start.heading))), 0
    while not region.holds(layer).any():
        layer, commands = search._drive(layer).poses, commands + 1
    assert len(way) == commands > 3
    assert search.shortest_way(start, region.holds, commands - 1) is None
    beside = start.model_copy(update={"x": 0.62})
    assert search.shortest_way(beside, region.holds, 30) == ()


def test_what_is_hidden_is_in_no_region() -> None:
    maze = load_arena("maze")
    seen = outline(maze, KHEPERA)
    region = Region(edge_points(seen, (0.85, 0.2, 0.2)), seen, 0.12)
    places = Poses(np.array([0.88, 0.74, 0.88]), np.array([0.72, 0.74, 0.5]), np.zeros(3))
    assert region.holds(places).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (SeenGoal(name="red", bearing=0.4, reached=False), "red, seen 23° to the left"),
        (SeenGoal(name="red", bearing=-0.4, reached=False), "red, seen 23° to the right"),
        (SeenGoal(name="red", bearing=0.0, reached=False), "red, seen ahead"),
        (SeenGoal(name="lamp", reached=False), "lamp, not in view"),
        (SeenGoal(name="lamp", bearing=0.4, reached=True), "lamp, reached"),
    ],
)
def test_monitors_tell_where_it_wants_to_go(goal: SeenGoal, words: str) -> None:
    watched = RobotState("khepera")
    watched.controlled.decision = a_decision(goal=goal)
    assert words in texts.situation(a_decision(goal=goal))
    assert words in decision_line(a_decision(goal=goal))
    console = Console(width=120, record=True, file=StringIO())
    console.print(render(watched, 0.0))
    assert words in console.export_text()
    assert ("goal" in eyes.aim(goal)) == (goal.bearing is not None)
    assert eyes.aim(None) == ""
