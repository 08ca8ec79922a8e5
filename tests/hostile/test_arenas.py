"""Arenas: damaged files are refused in a sentence, and whatever passes can be simulated."""

import subprocess
import sys
from collections.abc import Callable
from importlib import resources
from math import isfinite, radians
from pathlib import Path
from typing import Any

import pytest
from hostile_inputs import Hostile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from khepera_protocol.zenoh.payloads import Pose, Reset
from worlds import arena

from khepera_emulator.arenas.arena import MOST_LAMPS, MOST_SOLIDS, MOST_THINGS, Arena, load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA
from khepera_emulator.robot.emulator import Emulator, Setup, make_fleet
from khepera_emulator.world.starts import check_starts

FILES = [
    (resources.files("khepera_emulator") / "arenas" / f"{name}.toml").read_bytes()
    for name in ("corridor", "maze", "lamp-room", "toys")
]

NASTY = [
    b"1e308",
    b"-1e308",
    b"5e-324",
    b"nan",
    b"-inf",
    b"9" * 400,
    b"9" * 5000,
    b"0x" + b"f" * 300,
    b"true",
    b'"\\u001b[2J"',
    b"'''",
    b"[" * 2000,
    b"{}",
    b"2020-01-01",
    b"[[wall]]\npoints = [[0, 0], [1, 1]]\n" * 30,
    b"\xff\xfe",
    b"\0",
    b"\r",
]
"""Text that is put into a file, or in the place of something in it."""

SUITS_ALL = [HealthCheck.too_slow, HealthCheck.function_scoped_fixture]


@st.composite
def damaged(draw: st.DrawFn, files: list[bytes] = FILES, nasty: list[bytes] = NASTY) -> bytes:
    """A file with a few bytes cut, doubled, bent or replaced."""
    data = draw(st.sampled_from(files))
    for _ in range(draw(st.integers(1, 4))):
        first = draw(st.integers(0, len(data)))
        last = draw(st.integers(first, min(first + 40, len(data))))
        new = draw(st.sampled_from(nasty) | st.binary(max_size=8) | st.just(2 * data[first:last]))
        data = data[:first] + new + data[last:]
    return data[: draw(st.integers(0, len(data)))] if draw(st.booleans()) else data


def refusal(attempt: Callable[..., Any], *arguments: object) -> str:
    """The sentence in which something is refused; empty if it is not."""
    try:
        attempt(*arguments)
    except EmulatorError as error:
        return str(error)
    return ""


def test_damaged_files_are_arenas_or_refused_in_a_sentence(
    hostile: Hostile, tmp_path: Path
) -> None:
    path = tmp_path / "arena.toml"

    @settings(max_examples=hostile.examples(150), suppress_health_check=SUITS_ALL)
    @given(damaged())
    def refused_or_taken(data: bytes) -> None:
        hostile.count("arenas: damaged files")
        path.write_bytes(data)
        said = refusal(load_arena, str(path))
        assert said.isprintable()
        assert len(said) < 3000

    refused_or_taken()


WORLD_OF_MANY = """
import sys

import numpy as np
from worlds import arena

from khepera_emulator.senses.camera import HEIGHT, OmniCamera
from khepera_emulator.world.bullet import load_physics
from khepera_emulator.world.world import World
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.payloads import Pose

load_physics("PyBullet is tried")
from khepera_emulator.senses.renderers.faces import FacesRenderer

MIRROR = Mirror()


def at(k):
    return [(k % 100) * 0.1 - 5.0, (k // 100) * 0.1 + 1.0]


MANY = {
    "lamp": lambda k: {"centre": at(k)},
    "cylinder": lambda k: {"centre": at(k), "radius": 0.02, "height": 0.05 + k % 7 * 0.01},
    "wall": lambda k: {"points": [at(k), [at(k)[0], at(k)[1] + 0.05]]},
    "object": lambda k: {"shape": "box", "size": [0.03, 0.02], "centre": at(k)},
}

for part, numbers in eval(sys.argv[1]).items():
    for number in numbers:
        world = World(arena(**{part: [MANY[part](k) for k in range(number)]}), rigid=True)
        camera = OmniCamera(world, np.random.default_rng(0))
        faces = FacesRenderer(world, HEIGHT, MIRROR.low, MIRROR.high)
        camera.mirror_image(Pose(x=0.0, y=0.0, heading=0.0))
        faces.render(Pose(x=0.0, y=0.0, heading=0.0))
        world.period()
        world.close()
        print(part, number, flush=True)
"""


def test_any_number_of_anything_can_be_seen_and_stepped(hostile: Hostile) -> None:
    few = range(41)
    many = {
        "lamp": [*few, MOST_LAMPS],
        "cylinder": [*few, MOST_SOLIDS],
        "wall": [*few, MOST_SOLIDS],
        "object": [*few, MOST_THINGS],
    }
    # PyBullet takes the whole process with it
    done = subprocess.run(
        [sys.executable, "-c", WORLD_OF_MANY, repr({k: list(v) for k, v in many.items()})],
        env={"PYTHONPATH": ":".join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout.splitlines()[-1:]} {done.stderr}"
    hostile.count("arenas: numbers of things", len(done.stdout.splitlines()))


@pytest.mark.parametrize(
    ("part", "most"),
    [("lamp", MOST_LAMPS), ("cylinder", MOST_SOLIDS), ("object", MOST_THINGS), ("starts", 31)],
)
def test_more_than_can_be_simulated_is_refused(part: str, most: int, tmp_path: Path) -> None:
    parts = {
        "lamp": "centre = [0, 0]",
        "cylinder": "centre = [0, 0]\nradius = 0.1",
        "object": 'shape = "ball"\nradius = 0.1\ncentre = [0, 0]',
        "starts": "x = 0\ny = 0",
    }
    path = tmp_path / "arena.toml"
    text = "version = 1\ntitle = ''\nstart = {x = 0, y = 0}\nfree = {points = [[0, 0], [1, 0]]"
    path.write_text(f"{text}, half_width = 1}}\n" + f"[[{part}]]\n{parts[part]}\n" * (most + 1))
    with pytest.raises(EmulatorError, match=f"{part}: there are more than {most}"):
        load_arena(str(path))


def test_more_stretches_and_posts_than_can_be_simulated_are_refused(tmp_path: Path) -> None:
    points = ", ".join(f"[{k % 2}, 0]" for k in range(MOST_SOLIDS))
    path = tmp_path / "arena.toml"
    text = "version = 1\ntitle = ''\nstart = {x = 0, y = 0}\nfree = {points = [[0, 0], [1, 0]]"
    path.write_text(f"{text}, half_width = 1}}\n" + f"[[wall]]\npoints = [{points}]\n" * 2)
    with pytest.raises(EmulatorError, match=f"there are {2 * MOST_SOLIDS - 2} stretches of walls"):
        load_arena(str(path))


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers from one bound to another, both of them often."""
    return st.sampled_from([low, high]) | st.floats(low, high)


METRES = numbers(-0.3, 0.3) | numbers(-10.0, 10.0)
PLACES = st.tuples(METRES, METRES).map(list)
STARTS = st.fixed_dictionaries({"x": METRES, "y": METRES, "heading": numbers(-360.0, 360.0)})
LINES = st.lists(PLACES, min_size=2, max_size=5)
PARTS = {
    "wall": st.fixed_dictionaries(
        {
            "points": LINES,
            "height": numbers(0.001, 2.0),
            "thickness": numbers(0.001, 1.0),
        }
    ),
    "cylinder": st.fixed_dictionaries(
        {"centre": PLACES, "radius": numbers(0.001, 1.0), "height": numbers(0.001, 2.0)}
    ),
    "lamp": st.fixed_dictionaries({"centre": PLACES, "power": numbers(0.001, 10.0)}),
    "object": st.fixed_dictionaries(
        {
            "shape": st.sampled_from(["post", "ball"]),
            "centre": PLACES,
            "radius": numbers(0.004, 0.5),
            "height": numbers(0.01, 1.0),
            "mass": numbers(0.001, 5.0),
            "friction": numbers(0.001, 2.0),
        }
    )
    | st.fixed_dictionaries(
        {
            "shape": st.just("box"),
            "centre": PLACES,
            "heading": numbers(-360.0, 360.0),
            "size": st.tuples(numbers(0.005, 1.0), numbers(0.005, 1.0)).map(list),
            "mass": numbers(0.001, 5.0),
        }
    ),
    "starts": STARTS,
}


@st.composite
def arenas(draw: st.DrawFn) -> Arena:
    """An arena with everything at its bounds, or in one heap, or one in the other."""
    parts = {name: draw(st.lists(part, max_size=3)) for name, part in PARTS.items()}
    free = {
        "points": draw(LINES),
        "half_width": draw(numbers(0.001, 5.0)),
        "heading_spread": draw(numbers(1e-300, 180.0)),
        "gap": draw(numbers(0.0, 5.0) | st.just(0.0)),
    }
    try:
        return arena(**parts, free=free, start=draw(STARTS))
    except ValueError:  # two points in one
        return arena(start=draw(STARTS))


def started(given: Arena) -> list[Emulator] | str:
    """Robots at all starts of an arena and at one place by chance, or why there are none."""
    try:
        return make_fleet(Setup(given, baud=None), len(given.starts) + 2)
    except EmulatorError as error:
        return str(error)


def test_what_passes_can_be_driven_in_and_looked_at(hostile: Hostile) -> None:
    @settings(max_examples=hostile.examples(12), suppress_health_check=SUITS_ALL)
    @given(arenas(), st.integers(0, 2**32))
    def stays_finite(given: Arena, seed: int) -> None:
        hostile.count("arenas: extreme ones")
        robots = started(given)
        checked = refusal(check_starts, given, KHEPERA)
        # the emulator stops at the first mistake; whether a place by chance is found is chance
        if isinstance(robots, str):
            assert robots in checked or "no free place" in robots
            return
        assert not checked or "no free place" in checked
        try:
            live(robots, seed)
        finally:
            robots[0].close()

    stays_finite()


def live(robots: list[Emulator], seed: int) -> None:
    for number, robot in enumerate(robots):
        robot.write(b"D,%d,%d\n" % (20 - number, 15))
    for _ in range(20):
        robots[0].advance(robots[0].now + 0.1)
    robots[0].mirror_image()
    robots[-1].panorama()
    for robot in robots:
        robot.write(b"N\nO\n")
        robot.advance(robot.now + 0.1)
        pose = robot.truth().pose
        assert all(map(isfinite, (pose.x, pose.y, pose.heading)))
        assert robot.read().count(b"\n") == 3
        robot.outline()
    for thing in robots[0].robot.chassis._world.things:
        assert isfinite(thing.footprint.x)
        assert isfinite(thing.footprint.y)
    robots[0].reset(Reset(seed=seed))


def test_places_out_of_bounds_are_refused_and_nothing_changes(hostile: Hostile) -> None:
    robot = make_fleet(Setup(load_arena("corridor"), baud=None), 1)[0]
    before = robot.truth().pose
    wild = st.floats() | st.floats(-2, 2)

    @settings(max_examples=hostile.examples(150))
    @given(wild, wild, wild, st.none() | st.integers(0, 2**70), st.booleans())
    def refused_or_within(x: float, y: float, heading: float, seed: int | None, anew: bool) -> None:
        hostile.count("arenas: places")
        # without the payloads' own checks: the emulator has its own
        pose = Pose.model_construct(x=x, y=y, heading=heading)
        wanted = Reset.model_construct(pose=pose, random=False, seed=seed if anew else None)
        said = refusal(robot.reset, wanted)
        assert said.isprintable()
        if said:
            assert robot.truth().pose == before
        else:
            # the corridor's floor, seen from above
            assert -0.125 < x < 1.125
            assert -0.125 < y < 1.125
            assert x > 0.875 or y < 0.125
            assert abs(heading) <= radians(360)
            robot.mirror_image()
            assert robot.reset(Reset(pose=before)).pose == before

    refused_or_within()
    robot.close()
