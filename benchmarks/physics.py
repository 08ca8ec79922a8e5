"""The emulator's own arithmetic against PyBullet: motion, pictures, and what each costs.

    python benchmarks/physics.py [--write]

Tables and pictures of docs/physics.md. Each course is driven twice over the serial protocol, with
`physics=auto` and `physics=pybullet`; pictures are drawn of the same places by both renderers.
"""

from collections.abc import Sequence
from math import degrees, pi
from time import process_time
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from khepera_protocol.mirror import Mirror
from khepera_protocol.palette import SERIES, drawing_style
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose
from matplotlib.figure import Figure
from numpy.typing import NDArray
from page import DOCS, PICTURES, report

from khepera_emulator.arenas.arena import Arena, load_arena
from khepera_emulator.body.drift import PRESETS
from khepera_emulator.robot.emulator import Emulator, Setup
from khepera_emulator.senses.camera import HEIGHT, OmniCamera
from khepera_emulator.senses.renderers.faces import FacesRenderer
from khepera_emulator.senses.renderers.layered import LayeredRenderer
from khepera_emulator.senses.renderers.view import Image, Renderer
from khepera_emulator.world.world import World

PAGE: Final = DOCS / "physics.md"

_STEP: Final = 0.1
"""Seconds between two looks at where the robot is."""

Array = NDArray[np.float64]


class Leg(NamedTuple):
    """Speeds of both wheels as D takes them, 8 mm/s each, for some seconds."""

    left: int
    right: int
    seconds: float


class Course(NamedTuple):
    """A drive, and what is around: the parts of an arena, and the heading in degrees."""

    name: str
    legs: tuple[Leg, ...]
    parts: dict[str, Any]
    heading: float = 0.0


_WALL: Final = {"wall": [{"points": [[0.105, -1.0], [0.105, 1.0]]}]}
_BOX: Final = {"shape": "box", "centre": [0.10, 0.008], "size": [0.04, 0.04], "mass": 0.02}
_AHEAD: Final = (Leg(5, 5, 5.0),)
_LONG: Final = (Leg(5, 5, 10.0),)

_MANY: Final = (Leg(20, 20, 2.0), Leg(5, 15, 2.0), Leg(-10, 10, 1.0), Leg(0, 0, 1.0))

COURSES: Final = (
    Course("1 m straight ahead", (Leg(10, 10, 12.5),), {}),
    Course("an arc", (Leg(10, 6, 10.0),), {}),
    Course("two turns on the spot", (Leg(-5, 5, 8.3),), {}),
    Course("a start, a curve, a turn, a stop", _MANY, {}),
    Course("against a wall, head on", _AHEAD, _WALL),
    Course("against a wall at 30 degrees", _LONG, _WALL, 30.0),
    Course("against a wall at 60 degrees", _LONG, _WALL, 60.0),
    Course("a box pushed", _AHEAD, {"object": [_BOX]}),
)


class Driven(NamedTuple):
    """Motion on a course.

    Attributes:
        poses: x, y in metres and heading in radians, every tenth of a second; shape (N, 3).
        thing: x and y of the first thing at the end; NaN without one.
        cost: seconds of processor time a control period.
    """

    poses: Array
    thing: Array
    cost: float


def drive(course: Course, *, rigid: bool) -> Driven:
    """Drive a course over the serial line, without drift."""
    arena = _arena({"heading": course.heading}, course.parts)
    emulator = Emulator(Setup(arena, drift=PRESETS["none"], baud=None, rigid=rigid))
    poses, spent = [], 0.0
    for leg in course.legs:
        emulator.write(f"D,{leg.left},{leg.right}\n".encode())
        for _ in range(round(leg.seconds / _STEP)):
            begin = process_time()
            emulator.advance(emulator.now + _STEP)
            spent += process_time() - begin
            pose = emulator.truth().pose
            poses.append((pose.x, pose.y, pose.heading))
    corners = emulator.outline().solids[-1].corners if course.parts.get("object") else []
    emulator.close()
    thing = np.mean(corners, axis=0) if corners else np.full(2, np.nan)
    return Driven(np.array(poses), thing, spent / (len(poses) * _STEP / CONTROL_PERIOD))


def apart(one: Driven, other: Driven) -> tuple[float, float]:
    """Return the greatest distance in metres and angle in radians between two drives."""
    gaps = np.hypot(*(one.poses - other.poses).T[:2])
    turns = (one.poses - other.poses)[:, 2]
    return float(gaps.max()), float(np.abs((turns + pi) % (2 * pi) - pi).max())


def _arena(start: dict[str, float], parts: dict[str, Any]) -> Arena:
    free = {"points": [[0, 0], [0.1, 0]], "half_width": 0.1}
    place = {"x": 0.0, "y": 0.0, **start}
    known = {"version": 1, "title": "course", "start": place, "free": free}
    return Arena.model_validate({**known, **parts})


def _motion_rows() -> list[tuple[str, ...]]:
    rows = []
    for course in COURSES:
        own, rigid = drive(course, rigid=False), drive(course, rigid=True)
        gap, turn = apart(own, rigid)
        way = float(np.hypot(*np.diff(own.poses[:, :2], axis=0).T).sum())
        box = float(np.hypot(*(own.thing - rigid.thing)))
        rows.append(
            (
                *(course.name, f"{1e3 * way:.0f} mm", f"{1e3 * gap:.1f} mm"),
                f"{degrees(turn):.1f}°",
                *("" if np.isnan(box) else f"{1e3 * box:.1f} mm",),
                *(f"{1e6 * each.cost:.0f} µs" for each in (own, rigid)),
            )
        )
    return rows


def _renderers(world: World) -> tuple[Renderer, Renderer, Renderer]:
    """Return the emulator's own renderer, PyBullet's, and PyBullet's with three times the pixels.

    That one is the reference.
    """
    mirror = Mirror()
    sight = (HEIGHT, mirror.low, mirror.high)
    return (
        LayeredRenderer(world, *sight),
        FacesRenderer(world, *sight),
        FacesRenderer(world, *sight, 192),
    )


def _views(arena: Arena) -> list[Pose]:
    start = arena.start
    places = ((0.3, 0.0, 0.0), (2.0, 0.05, 0.03), (-1.0, -0.03, -0.04))
    return [Pose(x=start.x + x, y=start.y + y, heading=turn) for turn, x, y in places]


def _picture(world: World, renderer: Renderer, pose: Pose) -> Image:
    camera = OmniCamera(world, np.random.default_rng(0), noise=0.0, renderer=renderer)
    return camera.mirror_image(pose)


def _cost(renderer: Renderer, pose: Pose) -> float:
    times = []
    for _ in range(200):
        begin = process_time()
        renderer.render(pose)
        times.append(process_time() - begin)
    return min(times)


def _picture_rows() -> list[tuple[str, ...]]:
    rows = []
    for name in ("corridor", "maze", "toys", "lamp-room"):
        world = World(load_arena(name), rigid=True)
        renderers = _renderers(world)
        seen = []
        for pose in _views(world.arena):
            own, coarse, fine = (_picture(world, each, pose) for each in renderers)
            seen.append([_difference(own, fine), _difference(coarse, fine)])
        means = np.mean(seen, axis=0)
        costs = [_cost(each, _views(world.arena)[0]) for each in renderers[:2]]
        world.close()
        rows.append(
            (
                f"`{name}`",
                *(f"{mean:.1f}, {100 * share:.1f} %" for mean, share in means),
                *(f"{1e3 * cost:.2f} ms" for cost in costs),
            )
        )
    return rows


def _difference(one: Image, other: Image) -> tuple[float, float]:
    """Return the mean difference in grey levels, and the share of pixels of more than 30."""
    difference = cv2.absdiff(one, other).max(axis=2)
    return float(difference.mean()), float((difference > 30).mean())


def _draw_motion() -> None:
    figure = Figure(figsize=(11.5, 5.0), layout="constrained")
    path, turn, gap = figure.subplots(1, 3)
    known = {course.name: course for course in COURSES}
    wall = known["against a wall at 60 degrees"]
    for rigid, style in ((False, {"lw": 3.5, "alpha": 0.5}), (True, {"lw": 1.2, "ls": "--"})):
        label, colour = ("pybullet", SERIES[1]) if rigid else ("auto", SERIES[0])
        arc, slide = drive(known["an arc"], rigid=rigid), drive(wall, rigid=rigid)
        path.plot(*(1e3 * arc.poses[:, :2].T), color=colour, label=label, **style)
        turn.plot(_times(slide), np.degrees(slide.poses[:, 2]), color=colour, **style)
    shown = ("an arc", "against a wall at 30 degrees", wall.name, "a box pushed")
    for name, colour, line in zip(shown, SERIES[2:6], ("-", "--", "-.", ":"), strict=True):
        own, rigid_one = (drive(known[name], rigid=each) for each in (False, True))
        apart_by = 1e3 * np.hypot(*(own.poses - rigid_one.poses).T[:2])
        gap.plot(_times(own), apart_by, line, color=colour, label=name)
    path.set(title="an arc", xlabel="x in mm", ylabel="y in mm", aspect="equal")
    turn.set(title=wall.name, xlabel="seconds", ylabel="heading in degrees", ylim=(0, None))
    gap.set(title="auto and pybullet apart", xlabel="seconds", ylabel="mm", ylim=(0, None))
    path.legend(loc="center", frameon=False)
    figure.legend(*gap.get_legend_handles_labels(), loc="outside lower right", ncols=2)
    figure.savefig(PICTURES / "physics.png")


def _times(driven: Driven) -> Array:
    return np.asarray(_STEP * np.arange(1, len(driven.poses) + 1), dtype=np.float64)


def _draw_pictures(scale: int = 2) -> None:
    rows: list[Sequence[Image]] = []
    for name in ("toys", "lamp-room"):
        world = World(load_arena(name), rigid=True)
        pose = _views(world.arena)[2]
        own, _, fine = (_picture(world, each, pose) for each in _renderers(world))
        rows.append([own, fine, np.asarray(cv2.absdiff(own, fine), dtype=np.uint8)])
        world.close()
    picture = np.vstack([np.hstack(row) for row in rows])
    size = picture.shape[1] * scale, picture.shape[0] * scale
    cv2.imwrite(
        str(PICTURES / "renderers.png"), cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST)
    )


def main() -> None:
    """Measure, draw and print; `--write` puts the tables into the page, too."""
    courses = ("course", "way", "apart", "turned apart", "the box apart", "auto", "pybullet")
    report("Motion", courses, _motion_rows(), (PAGE, "motion"))
    arenas = ("arena", "own against fine", "PyBullet against fine", "own", "PyBullet")
    report("Pictures", arenas, _picture_rows(), (PAGE, "pictures"))
    with drawing_style():
        _draw_motion()
    _draw_pictures()


if __name__ == "__main__":
    main()
