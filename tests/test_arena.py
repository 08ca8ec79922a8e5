"""Arena files: the ones that come with the package load; a wrong one says what is wrong."""

import sys
from math import hypot
from pathlib import Path

import numpy as np
import pybullet
import pytest
from as_type import not_none
from khepera_protocol.zenoh.payloads import Pose
from worlds import gap_in, reachable

from khepera_emulator.app.cli.commands import app
from khepera_emulator.arenas.arena import arena_names, load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA, KHEPERA2
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import check_room, pose_of, random_pose
from khepera_emulator.world.world import World

COMMAND_WAY = 0.021
"""Metres of one straight command of the paper's controller."""

GOOD = """
version = 1
title = "A wall"
start = { x = 0.0, y = 0.0 }
free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.05 }
[[wall]]
points = [[0.5, -1.0], [0.5, 1.0]]
"""


def test_the_arenas_that_come_with_the_package() -> None:
    assert {
        "corridor",
        "corridor-18",
        "corridor-mirror",
        "lamp-room",
        "maze",
        "narrow-passage",
        "open-box",
        "s-curve",
    } <= set(arena_names())


@pytest.mark.parametrize("name", arena_names())
def test_packaged_arena_has_room_at_its_start_and_at_random_places(name: str) -> None:
    arena, gap = load_arena(name), gap_in(name)
    check_room(pose_of(arena.start), gap)
    rng = np.random.default_rng(0)
    places = [random_pose(arena.free, gap, rng) for _ in range(50)]
    assert min(map(gap, places)) >= arena.free.gap
    assert max(hypot(p.x - places[0].x, p.y - places[0].y) for p in places) > 0.2


@pytest.mark.parametrize("name", arena_names())
def test_the_middle_of_the_free_strip_is_free(name: str) -> None:
    arena, gap = load_arena(name), gap_in(name)
    if arena.cylinder:
        pytest.skip("posts stand in the strip")
    for begin, end in zip(arena.free.points, arena.free.points[1:], strict=False):
        for x, y in np.linspace(begin, end, 50):
            assert gap(Pose(x=x, y=y, heading=0.0)) > 0.0


@pytest.mark.parametrize("name", ["corridor", "corridor-mirror", "s-curve", "corridor-18"])
def test_a_straight_drive_collides_in_the_eighth_command(name: str) -> None:
    start, gap = pose_of(load_arena(name).start), gap_in(name, KHEPERA)
    gaps = [gap(start.model_copy(update={"x": start.x + n * COMMAND_WAY})) for n in (7, 8)]
    assert gaps[0] > 0.0 > gaps[1]


@pytest.mark.parametrize("name", arena_names())
def test_every_solid_stands_in_the_world(name: str) -> None:
    world = World(load_arena(name), rigid=True)
    dynamics = not_none(world.dynamics)
    parts = [
        shape
        for solid in dynamics.solids
        for shape in pybullet.getCollisionShapeData(solid, -1, physicsClientId=dynamics.client)
    ]
    world.close()
    assert len(parts) == len(world.plan.boxes) + len(world.plan.posts)


def test_a_world_too_many_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pybullet, "connect", lambda _: -1)
    with pytest.raises(EmulatorError, match="no room for another world in this process"):
        World(load_arena("toys"))


def test_the_mirror_image_of_the_corridor_is_one() -> None:
    arena, other = load_arena("corridor"), load_arena("corridor-mirror")
    assert other.start == arena.start
    assert other.free.points == [(x, -y) for x, y in arena.free.points]
    plan, mirrored = FloorPlan(arena), FloorPlan(other)
    for x, y in np.random.default_rng(0).uniform([-0.2, -0.2], [1.2, 1.2], (300, 2)):
        assert plan.clearance(x, y) == pytest.approx(mirrored.clearance(x, -y))


@pytest.mark.parametrize(("name", "width"), [("corridor", 0.25), ("corridor-18", 0.18)])
def test_widths(name: str, width: float) -> None:
    plan = FloorPlan(load_arena(name))
    for x, y in ((0.4, 0.0), (1.0, 0.6)):
        assert plan.clearance(x, y) == pytest.approx(width / 2)


@pytest.mark.parametrize(("name", "goal"), [("maze", (0.88, 0.72)), ("narrow-passage", (0.4, 0.0))])
def test_both_robots_can_get_to_the_end(name: str, goal: tuple[float, float]) -> None:
    places = reachable(name, KHEPERA2)
    assert min(hypot(x - goal[0], y - goal[1]) for x, y in places) < 0.01
    (x0, y0), (x1, y1) = FloorPlan(load_arena(name)).bounds()
    assert all(x0 < x < x1 and y0 < y < y1 for x, y in places)


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[str]:
    app(["arenas", *arguments], prog_name="khepera-emulator", standalone_mode=False)
    return capsys.readouterr().out.splitlines()


def test_arenas_are_listed_with_title_and_size(capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys)
    assert [line.split()[0] for line in lines] == arena_names()
    (line,) = [line for line in lines if line.startswith("open-box ")]
    assert line.split(maxsplit=1)[1] == "1.02 x 1.02 m  Open box of 1 m, one wall red"
    assert run(capsys, "open-box") == ["open-box  1.02 x 1.02 m  Open box of 1 m, one wall red"]


def test_starts_are_checked_as_run_checks_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "own.toml"
    box = "[[wall]]\npoints = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]\n"
    text = GOOD.partition("[[wall]]")[0] + box
    post = '[[object]]\nshape = "post"\nradius = 0.02\ncentre = [0.3, 0.3]\n'
    for x, y in ((0.2, 0.2), (0.21, 0.2), (0.49, 0.0), (0.31, 0.3), (2.0, 0.0)):
        post += f"[[starts]]\nx = {x}\ny = {y}\n"
    path.write_text(text + post)
    with pytest.raises(EmulatorError) as caught:
        run(capsys, str(path))
    there, outside = "something is there", "is outside the walls of the arena"
    assert str(caught.value) == (
        f"the arena '{path}': 4 mistakes:"
        f" starts 2: no room for the robot at x=0.210 m, y=0.200 m: {there};"
        f" starts 3: no room for the robot at x=0.490 m, y=0.000 m: {there};"
        f" starts 4: no room for the robot at x=0.310 m, y=0.300 m: {there};"
        f" starts 5: x=2.000 m, y=0.000 m {outside}"
    )
    path.write_text(text.replace("{ x = 0.0", "{ x = 0.49"))
    with pytest.raises(EmulatorError, match="start: no room for the robot"):
        run(capsys, str(path), "--draw", str(tmp_path / "arena.png"))
    path.write_text(text.replace("half_width = 0.05", "half_width = 0.05, gap = 0.6"))
    with pytest.raises(EmulatorError, match="free: no free place"):
        run(capsys, str(path))


def test_a_robot_that_is_too_wide_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "own.toml"
    path.write_text(GOOD.replace("0.5, -1.0], [0.5, 1.0", "0.034, -1.0], [0.034, 1.0"))
    with pytest.raises(EmulatorError, match=r"start: no room .*; free: no free place"):
        run(capsys, str(path), "--model", "khepera2")


PICTURES = {
    "png": b"\x89PNG",
    "JPG": b"\xff\xd8\xff",
    "jpeg": b"\xff\xd8\xff",
    "svg": b"<?xml",
    "pdf": b"%PDF",
}


@pytest.mark.parametrize("suffix", PICTURES)
def test_a_picture_is_what_its_name_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], suffix: str
) -> None:
    path = tmp_path / f"arena.{suffix}"
    run(capsys, "open-box", "--draw", str(path))
    assert path.read_bytes().startswith(PICTURES[suffix])


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("", "is a folder"),
        (".", "is a folder"),
        ("/", "is a folder"),
        ("arena", "give a name that ends with .png, .jpg, .jpeg, .svg or .pdf"),
        ("arena.gif", "give a name that ends with .png, .jpg, .jpeg, .svg or .pdf"),
        ("/dev/full", "give a name that ends with"),
        ("nowhere/arena.png", "there is no folder nowhere"),
        ("/dev/null/arena.png", "there is no folder /dev/null"),
        ("a" * 300 + ".png", "File name too long"),
        ("a" * 300 + "/arena.png", "File name too long"),
    ],
)
def test_a_picture_that_cannot_be_written_is_refused_before_it_is_drawn(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, path: str, why: str
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(EmulatorError, match="cannot write") as caught:
        run(capsys, "maze", "--draw", path)
    assert why in str(caught.value)


def test_all_starts_are_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.toml"
    path.write_text(GOOD.replace("A wall", "A $wall") + "[[starts]]\nx = -1.0\ny = 2.0\n")
    run(capsys, str(path), "--draw", str(tmp_path / "arena.svg"))
    drawn = (tmp_path / "arena.svg").read_text()
    # each robot is a round body in white; glyphs stand with their text as a comment
    assert drawn.count("fill: #ffffff; stroke: #000000") == 2
    assert "<!-- 2 -->" in drawn
    assert "<!-- A $wall -->" in drawn


@pytest.mark.parametrize("name", ["lamp-room", "maze"])
def test_an_arena_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    path = tmp_path / "arena.png"
    assert run(capsys, name, "--draw", str(path)) == []
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size > 5000


def test_drawing_without_matplotlib_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(EmulatorError, match=r"needs Matplotlib.*'pictures'"):
        run(capsys, "maze", "--draw", str(tmp_path / "arena.png"))


def test_a_drawing_that_cannot_be_made_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(EmulatorError, match="name it"):
        run(capsys, "--draw", str(tmp_path / "arena.png"))
    with pytest.raises(EmulatorError, match=r"cannot write .*nowhere"):
        run(capsys, "maze", "--draw", str(tmp_path / "nowhere" / "arena.png"))


def test_an_arena_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(GOOD)
    arena = load_arena(str(path))
    assert arena.title == "A wall"
    assert len(FloorPlan(arena).boxes) == 1


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (("version = 1", "version = 2"), "version"),
        (("version = 1\n", ""), "version"),
        (("title", "titel"), "title"),
        (("title", "titel"), "there is no key 'titel'; did you mean 'title'?"),
        (("x = 0.0,", ""), "start: the key 'x' is missing"),
        (("0.5, 1.0", "0.5, 11.0"), "wall 1, points 2, number 2: 11.0 is more than 10"),
        (("0.5, 1.0", "0.5, nan"), "wall 1, points 2, number 2: nan is not a finite number"),
        (("0.5, 1.0", "0.5, true"), "wall 1, points 2, number 2: True is not a number"),
        (("0.5, 1.0", "0.5"), "wall 1, points 2, number 2: it is missing"),
        (("0.5, 1.0", "0.5, 1.0, 0.1"), "wall 1, points 2: there are more than 2"),
        (("[0.5, -1.0], ", ""), "wall 1, points: there are 1, and 2 at least are needed"),
        (("0.5, -1.0", "0.5, 1.0"), "two points in a row are the same"),
        (("0.5, -1.0", "0.5, 0.9999"), "two points in a row are less than 1 mm apart"),
        (("half_width = 0.05", "half_width = 0.0"), "free, half_width: 0.0 is less than 0.001"),
        (('"A wall"', '"' + "x" * 201 + '"'), "title: it has more than 200 characters"),
        (("[0.1, 0.0]]", "[0.0, 0.0]]"), "two points in a row are the same"),
        (("[[wall]]", "colour = 3\n[[wall]]"), "colour"),
        (("[[wall]]", "[[walls]]"), "there is no key 'walls'; did you mean 'wall'?"),
        (("[[wall]]", "[wall]"), "wall: it is a single table; write its name in double brackets"),
        (("version = 1", "version = 1.0"), "version: 1.0 is not a whole number"),
        (("version = 1", "version ="), "not TOML: Invalid value (at line 2, column 10)"),
        (("version = 1", "version = " + "9" * 5000), "not TOML: a number is too long"),
        (("version = 1", "version = " + "[" * 5000), "not TOML: it is nested too deeply"),
        (("version = 1", "#" * 1_000_000), "has more than 1,000,000 bytes"),
    ],
)
def test_a_wrong_arena_is_told_in_one_sentence(
    tmp_path: Path, change: tuple[str, str], part: str
) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(GOOD.replace(*change))
    with pytest.raises(EmulatorError) as caught:
        load_arena(str(path))
    assert part in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    wall = "[[wall]]\npoints = [[0, 0], [1, 12]]\ncolor = [1, 0, 0]\nheight = -1\n"
    path.write_text(GOOD.replace("title", "titel") + wall)
    with pytest.raises(EmulatorError) as caught:
        load_arena(str(path))
    assert str(caught.value) == (
        f"the arena '{path}': 4 mistakes: wall 2, points 2, number 2: 12 is more than 10;"
        " wall 2, height: -1 is less than 0.001;"
        " wall 2: there is no key 'color'; did you mean 'colour'?;"
        " there is no key 'titel'; did you mean 'title'?"
    )


def test_very_many_mistakes_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(GOOD + "".join(f"x{k} = 1\n" for k in range(100)))
    with pytest.raises(EmulatorError, match=r"100 mistakes: .*; and 90 more$") as caught:
        load_arena(str(path))
    assert len(str(caught.value)) < 1500


def test_what_a_terminal_would_obey_is_made_readable(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(GOOD.replace("A wall", "A \\u001b]0;wall\\u0007 \\u202e"))
    assert load_arena(str(path)).title == r"A \x1b]0;wall\x07 \u202e"
    path.write_text(GOOD + '"\\u001b[2J" = 1\n')
    with pytest.raises(EmulatorError) as caught:
        load_arena(str(path))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", ["nowhere", "", "a\0b"])
def test_an_unknown_arena_lists_the_known_ones(name: str) -> None:
    with pytest.raises(EmulatorError, match="unknown arena") as caught:
        load_arena(name)
    assert "corridor" in str(caught.value)


def test_a_misspelt_arena_is_recognized() -> None:
    with pytest.raises(EmulatorError, match="unknown arena 'maz': did you mean maze"):
        load_arena("maz")


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("nowhere.toml", "No such file or directory"),
        ("no/where", "No such file or directory"),
        ("a" * 300, "File name too long"),
        ("/", "is not a file"),
        (".", "is not a file"),
        ("/dev/zero", "is not a file"),
        ("/proc/self/mem", "Input/output error"),
    ],
)
def test_a_file_that_cannot_be_read_is_not_an_unknown_arena(name: str, why: str) -> None:
    with pytest.raises(EmulatorError, match=why) as caught:
        load_arena(name)
    assert "unknown" not in str(caught.value)


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(EmulatorError, match="is not TOML: byte 0 is not UTF-8 text"):
        load_arena(str(path))


OBJECT = GOOD + '[[object]]\nshape = "box"\ncentre = [0.2, 0.2]\nsize = [0.04, 0.02]\n'


def test_an_arena_with_a_thing(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    path.write_text(OBJECT)
    (thing,) = load_arena(str(path)).object
    assert (thing.shape, thing.size) == ("box", (0.04, 0.02))


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (('"box"', '"cone"'), "object 1, shape: 'cone' is not one of 'post', 'ball' or 'box'"),
        (('"box"', '"ball"'), "a ball has a radius and no size"),
        (("size = [0.04, 0.02]", "radius = 0.02"), "a box has a size"),
        (("0.04, 0.02", "0.04"), "object 1, size 2: it is missing"),
        (("0.04, 0.02", "0.04, 0.0"), "object 1, size 2: 0.0 is less than 0.005"),
        (("centre = [0.2, 0.2]", ""), "object 1: the key 'centre' is missing"),
        (("size", "mass = 0.0\nsize"), "object 1, mass: 0.0 is less than 0.001"),
    ],
)
def test_a_wrong_thing_is_told_in_one_sentence(
    tmp_path: Path, change: tuple[str, str], part: str
) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(OBJECT.replace(*change))
    with pytest.raises(EmulatorError) as caught:
        load_arena(str(path))
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)
