"""The foresight planner: what it sees, foresees, learns and drives."""

from dataclasses import replace
from itertools import pairwise
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from as_type import as_type, not_none
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Pose
from made_once import made_once
from planning import moment
from short_training import train_shortly

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.senses.camera import HEIGHT, OmniCamera
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.world import World
from macor_hil.arrays import Array, Image
from macor_hil.commands import COMMANDS, LEFT, RIGHT, STRAIGHT
from macor_hil.hardware.cameras.light import LIGHTS
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.odometry import Wheels, integrate
from macor_hil.mind import memories
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.eyes.floor import FloorEyes
from macor_hil.mind.eyes.floor_profile import azimuths, floor_profile
from macor_hil.mind.eyes.sights import sights
from macor_hil.mind.foresight.drives import hypothetical_drives
from macor_hil.mind.foresight.floor import clearance, solids
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.foresight.view import CLEARANCES, UNSEEN, cells_of, raster
from macor_hil.mind.map_file import load_map
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.runs.agent import Agent
from macor_hil.runs.trials import drive

MAZE = "khepera://maze?seed=1"
WAY, TURN = STRAIGHT.way, LEFT.turn
CHORD = WAY * 2 / TURN * sin(TURN / 2)
ARCS = np.array(
    [
        (CHORD * cos(TURN / 2), CHORD * sin(TURN / 2), TURN),
        (CHORD * cos(TURN / 2), -CHORD * sin(TURN / 2), -TURN),
        (WAY, 0.0, 0.0),
    ]
)
"""Motions of the three commands on ideal wheels, in metres and radians."""

IN_HEIGHTS = ARCS / (HEIGHT, HEIGHT, 1.0)

SMALL_MIRROR = Mirror(120, 100, 61.0, 48.0, 12.0, 46.0, radians(-55), radians(15))


Colour = tuple[int, int, int]


@pytest.fixture(scope="module")
def maze_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "maze.npz", MAZE, random=500)

    return made_once(tmp_path_factory, "map-of-the-maze", train) / "maze.npz"


def foresight_of(map_file: Path) -> ForesightMemory:
    return as_type(ForesightMemory, load_map(map_file)[0].memories["foresight"])


def true_distances(plan: FloorPlan, pose: Pose, columns: int) -> Array:
    angles = pose.heading + azimuths(columns)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return plan.cast(np.tile([pose.x, pose.y], (columns, 1)), rays)[0]


@pytest.mark.parametrize("mirror", [Mirror(), SMALL_MIRROR])
def test_the_floor_ends_where_the_floor_plan_says(mirror: Mirror) -> None:
    world = World(load_arena("maze"))
    try:
        camera = OmniCamera(world, np.random.default_rng(1), mirror)
        eyes = FloorEyes(mirror)
        pose = Pose(x=world.arena.start.x, y=world.arena.start.y, heading=radians(20))
        picture = camera.mirror_image(pose)
        true = true_distances(FloorPlan(world.arena), pose, eyes.directions)
    finally:
        world.close()
    near = (true > 0.05) & (true < 0.2)
    assert near.sum() > 60
    stored = not_none(cv2.imdecode(cv2.imencode(".jpeg", picture)[1], cv2.IMREAD_COLOR))
    lit = [
        np.clip(light.on(picture.astype(float)), 0, 255).astype(np.uint8)
        for light in LIGHTS.values()
    ]
    for each in (picture, stored.astype(np.uint8), *lit):
        off = np.abs(HEIGHT / eyes.floor(eyes.look(each)) - true)[near]
        assert np.median(off) < 0.001
        assert np.quantile(off, 0.9) < 0.004  # where a corner cuts through a column


def drawn(distance: float, wall: Colour, floor: Colour, mirror: Mirror, rows: int = 32) -> Image:
    """Draw a wall all round, with the share of it in the row where the floor ends."""
    depression = np.arctan(1 / distance)
    edge = (mirror.high + depression) / (mirror.high - mirror.low) * rows
    share = np.clip(edge - np.arange(rows), 0.0, 1.0)[:, None, None]
    picture: Array = share * np.array(wall, float) + (1 - share) * np.array(floor, float)
    return np.rint(np.tile(picture, (1, 24, 1))).astype(np.uint8)


@pytest.mark.parametrize("wall", [(40, 200, 220), (90, 90, 125), (250, 250, 250)])
@pytest.mark.parametrize("distance", [0.8, 1.7, 4.0])
def test_an_edge_is_found_within_its_row(wall: tuple[int, int, int], distance: float) -> None:
    profile = floor_profile(drawn(distance, wall, (90, 90, 90), Mirror()), Mirror(), 9.0)
    # a tenth of a row
    row = (Mirror().high - Mirror().low) / 32
    depression = np.arctan(profile)
    assert np.abs(depression - np.arctan(1 / distance)).max() < 0.1 * row


def test_where_nothing_stands_the_floor_goes_on() -> None:
    picture = np.full((32, 24, 3), 90, np.uint8)
    assert floor_profile(picture, Mirror(), 9.0) == pytest.approx(np.full(24, 1 / 25))


def test_features_are_those_of_receptive_fields_alone() -> None:
    eyes = FloorEyes(Mirror())
    picture = np.random.default_rng(0).integers(0, 256, (160, 160, 3), dtype=np.uint8)
    raw = eyes.look(picture)
    assert raw.shape == (eyes.raw_size,) == (36 + 120 + 24 * 5,)
    assert (raw[:36] == eyes.fields.raw(eyes.unwrap(picture))).all()
    eyes.tune(np.stack([raw, 0.5 * raw]))
    assert (eyes.tuned(raw) == eyes.fields.tune(raw[:36])).all()


def seen_from(arena: str, pose: Pose) -> Array:
    world = World(load_arena(arena))
    try:
        picture = OmniCamera(world, np.random.default_rng(1), Mirror()).mirror_image(pose)
    finally:
        world.close()
    eyes = FloorEyes(Mirror())
    return eyes.sights(eyes.look(picture))


def test_the_colour_of_what_stands_ahead_is_seen() -> None:
    # the wall ahead is red, all others are white
    blue, green, red = seen_from("open-box", Pose(x=0.3, y=0.0, heading=0.0)).T[:3]
    is_red = red - np.maximum(blue, green) > 0.3
    assert is_red[11:13].all()
    assert not is_red[:6].any()
    assert not is_red[-6:].any()


@pytest.mark.parametrize(("turned", "sector"), [(0, 12), (60, 16), (-60, 8)])
def test_a_lamp_is_the_brightest_spot_and_the_higher_the_nearer(turned: int, sector: int) -> None:
    near, far = (
        seen_from("lamp-room", Pose(x=0.57 - d, y=-0.01, heading=radians(turned)))
        for d in (0.1, 0.2)
    )
    sectors = near[:, 3].argmax(), far[:, 3].argmax()
    assert all(seen in (sector - 1, sector) for seen in sectors)
    assert near[:, 4][near[:, 3].argmax()] > far[:, 4][far[:, 3].argmax()]


@pytest.mark.parametrize("columns", [6, 50, 120])
def test_sights_are_seen_in_panoramas_of_any_width(columns: int) -> None:
    picture = np.full((32, columns, 3), (10, 20, 30), np.uint8)
    seen = sights(picture, Mirror(), np.full(columns, 1.0))
    assert seen[:, :3] == pytest.approx(np.tile([10 / 255, 20 / 255, 30 / 255], (24, 1)))


def test_hypothetical_drives_are_those_of_a_differential_drive() -> None:
    wheels = Wheels()
    drives = hypothetical_drives(IN_HEIGHTS)
    rng = np.random.default_rng(2)
    for _ in range(20):
        pose, at = Pose(x=0.0, y=0.0, heading=0.0), 0
        for stride in drives[:6]:
            command = int(rng.integers(3))
            counts = wheels.counts(COMMANDS[command].way, COMMANDS[command].turn)
            pose = integrate(pose, (0, 0), counts, wheels)
            poses = stride.ends.shape[1]
            place = HEIGHT * stride.ways[0, command * poses + at]
            assert place == pytest.approx((pose.x, pose.y), abs=2e-5)
            at = stride.ends[command, at]


def test_drives_that_have_come_to_the_same_square_go_on_as_one() -> None:
    drives = hypothetical_drives(IN_HEIGHTS)
    assert sum(stride.commands for stride in drives) == 42
    assert all(stride.ends.max() + 1 == stride.poses for stride in drives)
    # a tree would have 3^10
    assert drives[9].poses < 2_000


@pytest.mark.parametrize(("commands", "whole"), [(1, 1), (10, 10), (13, 12), (21, 20), (42, 42)])
def test_shorter_drives_are_the_beginnings_of_the_longest(commands: int, whole: int) -> None:
    drives = hypothetical_drives(IN_HEIGHTS, commands)
    assert sum(stride.commands for stride in drives) == whole
    for short, stride in zip(drives, hypothetical_drives(IN_HEIGHTS), strict=False):
        assert short.poses == stride.poses
        assert np.array_equal(short.ways, stride.ways)


def square_room(half: float, columns: int = 120) -> Array:
    angles = azimuths(columns)
    return np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))) / half


def test_clearance_is_the_distance_to_the_nearest_wall() -> None:
    solid = solids(square_room(3.0))
    places = np.random.default_rng(3).uniform(-2.5, 2.5, (200, 2))
    assert clearance(solid, places) == pytest.approx(3.0 - np.abs(places).max(axis=1), abs=0.02)


def test_the_raster_tells_the_same_and_what_is_hidden() -> None:
    room = square_room(3.0)
    bins = raster(room)
    places = np.random.default_rng(4).uniform(-2.5, 2.5, (200, 2))
    told = bins[cells_of(places)]
    assert (told < UNSEEN).all()
    assert CLEARANCES[told] == pytest.approx(clearance(solids(room), places), abs=0.15)
    assert (bins[cells_of(np.array([[5.0, 0.0], [0.0, -4.0]]))] >= UNSEEN).all()


def test_commands_are_worth_what_the_floor_allows(maze_map: Path) -> None:
    memory = foresight_of(maze_map)
    # a wall 3 heights ahead, and one all along the left side
    ahead, aside = np.cos(azimuths(120)) / 3.0, np.sin(azimuths(120))
    to_the_left = np.maximum(np.maximum(ahead, aside), 1 / 25)
    left, right, straight = (COMMANDS.index(each) for each in (LEFT, RIGHT, STRAIGHT))

    def worth(floor: Array, planner: Foresight) -> list[float]:
        now = moment()
        plan = planner.plan(memory, type(now)(now.raw, now.features, now.resonance, 0, floor))
        return [value if value is not None else np.nan for value in plan.evaluations]

    whole = Foresight()
    far = worth(np.full(120, 1 / 25), whole)
    assert far[straight] == max(far)
    assert far[straight] == pytest.approx(42 * 0.62, abs=0.5)
    near = worth(np.full(120, 1 / 25), Foresight(ahead=6))
    assert near[straight] == pytest.approx(6 * 0.62, abs=0.1)
    blocked = worth(to_the_left, whole)
    assert blocked[right] == max(blocked)
    assert blocked[left] < blocked[right] - 1.0
    mirrored = worth(to_the_left[::-1], whole)
    assert mirrored[left] == max(mirrored)


def test_motions_and_collisions_are_learned_from_what_is_seen(maze_map: Path) -> None:
    skill = not_none(foresight_of(maze_map).skill)
    metres = skill.motions * (HEIGHT, HEIGHT, 1.0)
    # wheels differ by a per cent or two, and the robot drifts
    assert np.abs(metres - ARCS)[:, :2].max() < 0.002
    assert np.abs(metres - ARCS)[:, 2].max() < radians(1.5)
    assert HEIGHT * skill.curve.reach == pytest.approx(0.041, abs=0.004)
    assert HEIGHT * skill.curve.vague < 0.005
    assert skill.earns == pytest.approx((0.54, 0.54, 0.62))
    assert skill.collision == 0.0


def test_it_drives_through_the_maze_after_a_short_training(maze_map: Path) -> None:
    brain, _ = load_map(maze_map)
    with open_hardware(MAZE) as hardware:
        agent = Agent(brain, Driver(hardware.robot), hardware.camera)
        steps = list(drive(agent, Foresight(), np.random.default_rng(1)))
        assert not not_none(hardware.bench).truth().touched
    assert len(steps) == 40
    assert not steps[-1].outcome.collided


def test_the_same_seed_learns_the_same_bytes(maze_map: Path, tmp_path: Path) -> None:
    again = train_shortly(tmp_path / "maze.npz", MAZE, random=500)
    assert again.read_bytes() == maze_map.read_bytes()


def aimless(memory: ForesightMemory, commands: int) -> list[Moment]:
    """Let a memory learn what shows nothing; returns all that was seen."""
    rng = np.random.default_rng(5)
    seen = [replace(moment(), floor=rng.uniform(0.1, 1.5, 24)) for _ in range(commands + 1)]
    for number, (before, after) in enumerate(pairwise(seen)):
        memory.learn(Experience(before, number % 3, after, 0.5, False))
    return seen


@pytest.mark.parametrize(
    ("shows_nothing", "learned_from"),
    [((), [1001]), ((1001, 501), [1001, 501, 251]), ((1001, 501, 251, 126), [1001, 501, 251, 126])],
)
def test_a_skill_is_learned_when_it_is_asked_for_from_the_last_drive_that_shows_one(
    shows_nothing: tuple[int, ...],
    learned_from: list[int],
    maze_map: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    skill, tried = not_none(foresight_of(maze_map).skill), list[int]()

    def learned(profiles: Array, *_: Array) -> Skill | None:
        tried.append(len(profiles))
        return None if len(profiles) in shows_nothing else skill

    monkeypatch.setattr(memories.foresight, "learned_skill", learned)
    memory = ForesightMemory(24)
    aimless(memory, 1400)
    assert tried == []
    found = [memory.skill, memory.skill]
    assert found == ([None, None] if len(shows_nothing) == 4 else [skill, skill])
    assert tried == learned_from


def test_few_drives_wait_to_be_learned_from(
    maze_map: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    skill, tried = not_none(foresight_of(maze_map).skill), list[int]()

    def learned(profiles: Array, *_: Array) -> Skill:
        tried.append(len(profiles))
        return skill

    monkeypatch.setattr(memories.foresight, "learned_skill", learned)
    memory = ForesightMemory(24, frames=300)
    aimless(memory, 12_000)
    assert tried == [300]
    assert memory.skill is skill


def test_a_memory_forgets_what_is_long_ago() -> None:
    memory = ForesightMemory(24, frames=250)
    seen = aimless(memory, 301)
    state = memory.state()
    assert state["profiles"].shape == (250, 24)
    assert (state["profiles"][-1] == not_none(seen[-1].floor).astype(np.float16)).all()
    assert state["learned"] == [301]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("profiles", np.zeros((1, 24), np.float16)),
        ("profiles", np.ones((1, 23), np.float16)),
        ("commands", np.array([3], np.int8)),
        ("collided", np.array([2], np.int8)),
        ("earned", np.array([np.nan])),
        ("learned", np.array([-1])),
        ("motions", np.full((3, 3), 9.0)),
        ("curve", np.zeros(3)),
    ],
)
def test_a_state_that_cannot_have_been_learned_is_refused(
    name: str, value: np.ndarray, maze_map: Path
) -> None:
    skill = not_none(foresight_of(maze_map).skill)
    state: dict[str, Any] = {
        "profiles": np.ones((1, 24), np.float16),
        "commands": np.array([-1], np.int8),
        "collided": np.array([0], np.int8),
        "earned": np.array([0.0]),
        "learned": np.array([0]),
    } | skill.state()
    ForesightMemory(24).load(state)
    with pytest.raises(ValueError, match="no"):
        ForesightMemory(24).load(state | {name: value})


def test_without_a_floor_it_knows_no_command(maze_map: Path) -> None:
    memory = foresight_of(maze_map)
    assert Foresight().plan(memory, moment()).command is None
    assert Foresight().plan(ForesightMemory(0), moment()).command is None
