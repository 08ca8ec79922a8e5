"""Arena files: the ones that come with the package load; a wrong one says what is wrong."""

import pytest

from khepera_emulator.arena import arena_names, load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.geometry import FloorPlan
from khepera_emulator.models import KHEPERA2

GOOD = """
version = 1
title = "A wall"
start = { x = 0.0, y = 0.0 }
free = { points = [[0.0, 0.0], [0.1, 0.0]], half_width = 0.05 }
[[wall]]
points = [[0.5, -1.0], [0.5, 1.0]]
"""


@pytest.mark.parametrize("name", arena_names())
def test_packaged_arena_has_room_at_its_start(name):
    arena = load_arena(name)
    plan = FloorPlan(arena)
    assert plan.clearance(arena.start.x, arena.start.y) > KHEPERA2.radius
    assert len(arena.free.points) >= 2


def test_an_arena_of_ones_own(tmp_path):
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
        (("x = 0.0,", ""), "start.x"),
        (("0.5, 1.0", "0.5, 11.0"), "wall.0.points"),
        (("0.5, 1.0", "0.5, nan"), "wall.0.points"),
        (("[0.5, -1.0], ", ""), "wall.0.points"),
        (("0.5, -1.0", "0.5, 1.0"), "two points in a row are the same"),
        (("half_width = 0.05", "half_width = 0.0"), "free.half_width"),
        (("[[wall]]", "colour = 3\n[[wall]]"), "colour"),
        (("[[wall]]", "[[walls]]"), "walls"),
        (("version = 1", "version ="), "not TOML"),
    ],
)
def test_a_wrong_arena_is_told_in_one_sentence(tmp_path, change, part):
    path = tmp_path / "wrong.toml"
    path.write_text(GOOD.replace(*change))
    with pytest.raises(EmulatorError) as caught:
        load_arena(str(path))
    assert part in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["nowhere", "", "a\0b", "/"])
def test_an_unknown_arena_lists_the_known_ones(name):
    with pytest.raises(EmulatorError, match="unknown arena") as caught:
        load_arena(name)
    assert "corridor" in str(caught.value)


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(EmulatorError, match="nor a readable TOML file"):
        load_arena(str(path))
