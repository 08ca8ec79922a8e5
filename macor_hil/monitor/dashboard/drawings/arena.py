"""The arena from above: robots, the way that one drove, and the sequences that its planner weighs.

All drawings are in millimetres with y down, as SVG has it.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import degrees
from typing import Final, NamedTuple

import cv2
import numpy as np
from khepera_protocol.zenoh.controller_payloads import Ahead, Command, Hypothesis
from khepera_protocol.zenoh.payloads import Outline, Pose

from macor_hil.monitor.dashboard.drawings.svg import clean, element, points, rgb, tip
from macor_hil.monitor.driving import over
from macor_hil.monitor.robot_state import Mark, MarkKind, RobotState
from macor_hil.monitor.way import PIECE
from macor_hil.telemetry.viewers.frames import arc, seen_from

_MOST_HYPOTHESES: Final = 12
_MARGIN: Final = 0.02
_SMALLEST: Final = 0.36
"""Metres that are shown at least."""

_GRID: Final = 0.1
"""Metres by which a view without walls grows: it stands still most of the time."""

_SCALES: Final = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Lengths that a scale may have, metres."""

_PIXELS: Final = 400
"""Of the longer side, where the floor within the walls is looked for."""

_REACHED: Final = 128

Place = tuple[float, float]


class Window(NamedTuple):
    """A part of the floor: its left and lower edge, its width and height, in metres."""

    left: float
    bottom: float
    width: float
    height: float

    @property
    def box(self) -> str:
        """As a `viewBox`."""
        numbers = self.left, -self.bottom - self.height, self.width, self.height
        return " ".join(f"{1000 * number:.0f}" for number in numbers)


def ground(outline: Outline) -> str:
    """Draw the floor within the walls, and all that stands on it."""
    if not outline.solids:
        return ""
    floor = "".join(
        element("polygon", points=points(places), fill=rgb(outline.floor))
        for places in _inside(outline)
    )
    first = len(outline.solids) - outline.things
    return floor + "".join(
        element(
            "polygon",
            points=points(solid.corners),
            fill=rgb(solid.colour),
            data_thing=number - first if number >= first else None,
            class_="thing" if number >= first else None,
        )
        for number, solid in enumerate(outline.solids)
    )


def way_pieces(watched: RobotState) -> Mapping[int, Sequence[Pose]]:
    """Return the robot's way in numbered pieces: the true one if it is told, else its encoders'."""
    way = watched.emulated.way
    if way:
        return {way.first + k: piece for k, piece in enumerate(way.pieces)}
    history = list(watched.controlled.history)
    if not history:
        return {}
    poses = [Pose(x=0.0, y=0.0, heading=0.0)] + [each.odometry.pose for each in history]
    first = history[0].sequence // PIECE
    starts = range(0, len(poses), PIECE)
    return {first + k: poses[max(0, start - 1) : start + PIECE] for k, start in enumerate(starts)}


def way_piece(poses: Sequence[Pose]) -> str:
    """Draw a piece of a way."""
    places = [(pose.x, pose.y) for pose in poses]
    return element("polyline", points=points(places), class_="way") if len(places) > 1 else ""


def hypothetical_ways(watched: RobotState) -> list[tuple[Hypothesis, list[Place]]]:
    """Return the sequences of the latest decision and their ways, the best one first.

    Those of a run that is over are none.
    """
    decision, learned = watched.controlled.decision, watched.controlled.learned
    if decision is None or learned is None or over(watched):
        return []
    start = watched.emulated.pose_at(decision.frame_time)
    if start is None:
        start = watched.emulated.way.last if watched.emulated.way else _before(watched)
    commands = {command.name: command for command in learned.commands}
    return [
        (hypothesis, way_of(start, hypothesis.ahead, commands))
        for hypothesis in decision.hypotheses[:_MOST_HYPOTHESES]
    ]


def _before(watched: RobotState) -> Pose:
    """Return where the robot decided, by its odometry."""
    history = watched.controlled.history
    return history[-2].odometry.pose if len(history) > 1 else Pose(x=0.0, y=0.0, heading=0.0)


def way_of(start: Pose, ahead: Iterable[Ahead], commands: Mapping[str, Command]) -> list[Place]:
    """Return the way of a sequence of commands: the start, and the end of each command."""
    pose, way = start, [(start.x, start.y)]
    for step in ahead:
        command = commands.get(step.command)
        if command is None:
            break
        pose = seen_from(pose, arc(command.turn, command.way))
        way.append((pose.x, pose.y))
    return way


def plans(ways: list[tuple[Hypothesis, list[Place]]], radius: float) -> str:
    """Draw sequences, the best one on top and with its value."""
    return "".join(
        _plan(hypothesis, way, radius, best=rank == 0)
        for rank, (hypothesis, way) in reversed(list(enumerate(ways)))
    )


def _plan(hypothesis: Hypothesis, way: list[Place], radius: float, *, best: bool) -> str:
    shapes = [element("polyline", points=points(way))]
    x, y = way[-1]
    end = {"cx": round(1000 * x), "cy": round(-1000 * y)}
    if best:
        dots = points(way[1:]).split()
        cut = [dot.split(",") for dot in dots]
        shapes += [element("circle", cx=a, cy=b, r=3, data_kind="best-step") for a, b in cut]
        shapes.append(element("circle", **end, r=round(1000 * radius), class_="end"))
        above = round(-1000 * (y + 1.35 * radius))
        text = f"{hypothesis.evaluation:.2f}"
        shapes.append(element("text", text, x=end["cx"], y=above, class_="label"))
    else:
        shapes.append(element("circle", **end, r=4, class_="end"))
    kind = "best" if best else "hypothesis"
    value = tip(f"{kind}: worth {hypothesis.evaluation:.2f}")
    return element(
        "g",
        value,
        *shapes,
        class_=kind,
        data_kind=kind,
        data_value=hypothesis.evaluation,
    )


def told(ways: list[tuple[Hypothesis, list[Place]]]) -> str:
    """Return what the arena shows, for those who do not see it."""
    if not ways:
        return "the arena from above, with the robot"
    best = ways[0][0]
    return (
        f"the arena from above; {len(ways)} hypothetical sequences, the best one of"
        f" {len(best.ahead)} commands is worth {best.evaluation:.2f}"
    )


def robot(name: str, pose: Pose, radius: float, look: str, *, named: bool) -> str:
    """Draw a robot.

    Args:
        name: of the robot.
        pose: where it is.
        radius: of its body, metres.
        look: classes, such as `chosen` or `touching`.
        named: whether its name stands beside it.
    """
    x, y, r = round(1000 * pose.x), round(-1000 * pose.y), round(1000 * radius)
    body = element("circle", r=r) + element("path", d=f"M0 0H{r}")
    turned = f"translate({x} {y}) rotate({degrees(-pose.heading):.1f})"
    shapes = element("g", body, transform=turned)
    if named:
        shapes += element("text", clean(name), x=x, y=y + r, dy="1.2em", class_="label")
    return element("g", tip(name), shapes, class_=f"robot {look}".strip(), data_kind="robot")


def marks(all_of_them: Iterable[Mark]) -> str:
    """Draw collisions as crosses, touched walls as rings, failures as triangles."""
    shapes = []
    for mark in all_of_them:
        if mark.pose is None:
            continue
        x, y = round(1000 * mark.pose.x), round(-1000 * mark.pose.y)
        if mark.kind is MarkKind.COLLISION:
            shape = f"M{x - 9} {y - 9}l18 18m0 -18l-18 18"
        elif mark.kind is MarkKind.FAILURE:
            shape = f"M{x} {y - 11}l10 18h-20z"
        else:
            shape = f"M{x - 5} {y}a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z"
        shapes.append(
            element("path", tip(mark.words), d=shape, class_=f"mark {mark.kind}", data_kind="mark")
        )
    return "".join(shapes)


def whole(outline: Outline | None, places: Iterable[Place]) -> Window:
    """Return the part of the floor within the walls, or around all places where none are known."""
    if outline and outline.solids:
        (left, bottom), (right, top) = _extent(outline)
        below = _MARGIN + 0.07 * (top - bottom)  # for the scale
        width, height = right - left + 2 * _MARGIN, top - bottom + _MARGIN + below
        return Window(left - _MARGIN, bottom - below, width, height)
    around = _around(list(places) or [(0.0, 0.0)], _SMALLEST)
    left, bottom = (_GRID * ((side - _MARGIN) // _GRID) for side in around[:2])
    size = _GRID * (around.width // _GRID + 3)
    return Window(left, bottom, size, size)


def close_up(pose: Pose, ways: list[tuple[Hypothesis, list[Place]]]) -> Window:
    """Return the surroundings of a robot and of its best sequence."""
    places = [(pose.x, pose.y)]
    if ways:
        places += ways[0][1]
    return _around(places, _SMALLEST)


def scale(window: Window) -> str:
    """Draw a length below the walls, for comparison."""
    length = max((each for each in _SCALES if each <= window.width / 3), default=_SCALES[0])
    x = round(1000 * (window.left + _MARGIN))
    y = round(-1000 * (window.bottom + _MARGIN / 2))
    end = x + round(1000 * length)
    tick = round(8 * window.height)
    bar = element("path", d=f"M{x} {y - tick}V{y}H{end}v{-tick}")
    text = f"{100 * length:g} cm" if length < 1.0 else f"{length:g} m"
    return bar + element("text", text, x=end, y=y, dx="0.5em", class_="label")


def _extent(outline: Outline) -> tuple[Place, Place]:
    xs = [x for solid in outline.solids for x, _ in solid.corners]
    ys = [y for solid in outline.solids for _, y in solid.corners]
    return (min(xs), min(ys)), (max(xs), max(ys))


def _inside(outline: Outline) -> list[list[Place]]:
    """Return the floor that can be reached from the start: outlines of what the walls enclose.

    All within the outermost walls where they leave a gap.
    """
    (left, bottom), (right, top) = _extent(outline)
    size = max(right - left, top - bottom)
    pixel = max(size / _PIXELS, 1e-3)
    shape = int((top - bottom) / pixel) + 3, int((right - left) / pixel) + 3
    free = np.full(shape, 255, np.uint8)

    def at(place: Place) -> tuple[int, int]:
        return round((place[0] - left) / pixel) + 1, round((place[1] - bottom) / pixel) + 1

    for solid in outline.solids[: len(outline.solids) - outline.things]:
        corners = np.array([at(corner) for corner in solid.corners], np.int32)
        cv2.fillPoly(free, [corners], 0)
        cv2.polylines(free, [corners], isClosed=True, color=0)
    x, y = at((outline.start.x, outline.start.y))
    known = 0 <= y < shape[0] and 0 <= x < shape[1] and free[y, x]
    if known:
        cv2.floodFill(free, None, (x, y), _REACHED)
    if not known or (free[0] == _REACHED).any() or (free[:, 0] == _REACHED).any():
        return [[(left, bottom), (right, bottom), (right, top), (left, top)]]
    reached = cv2.dilate((free == _REACHED).astype(np.uint8), np.ones((5, 5), np.uint8))
    found, _ = cv2.findContours(reached, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return [
        [(left + (i - 1) * pixel, bottom + (j - 1) * pixel) for i, j in contour[:, 0].tolist()]
        for contour in found
    ]


def _around(places: Sequence[Place], smallest: float) -> Window:
    xs, ys = zip(*places, strict=True)
    size = max(max(xs) - min(xs), max(ys) - min(ys), smallest) + 2 * _MARGIN
    return Window((min(xs) + max(xs) - size) / 2, (min(ys) + max(ys) - size) / 2, size, size)
