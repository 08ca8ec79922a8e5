"""The arena from above: the robot, the way it drove, and the sequences that its planner weighs."""

from collections.abc import Iterable, Mapping, Sequence
from math import cos, degrees, sin
from typing import Final, NamedTuple

from khepera_protocol.serial.units import BODY_RADIUS
from khepera_protocol.zenoh.controller_payloads import Ahead, Command, Hypothesis
from khepera_protocol.zenoh.payloads import Outline, Pose

from macor_hil.monitor.dashboard.svg import (
    BAD,
    BEST,
    INK,
    OTHER,
    drawing,
    element,
    label,
    points,
    rgb,
)
from macor_hil.monitor.robot_state import RobotState

_MOST_HYPOTHESES: Final = 12
_MARGIN: Final = 0.02
_SMALLEST: Final = 0.36
"""Metres that are shown at least."""

_INSET: Final = 0.3
"""Share of the drawing that the whole arena takes in a corner."""

Place = tuple[float, float]


def arena(watched: RobotState) -> str:
    """Draw the surroundings of the robot, and in a corner the whole arena.

    In the frame of the odometry where nobody knows the truth.
    """
    outline, path = watched.emulated.outline, driven_path(watched)
    radius = outline.robot_radius if outline else BODY_RADIUS
    ways = hypothetical_ways(watched)
    robot = [_robot(path[-1], radius, touching=_touching(watched))] if path else []
    ground = _solids(outline) if outline else []
    if path:
        ground.append(_line([(pose.x, pose.y) for pose in path], INK, 0.003, opacity=0.75))
    plans = [
        shape
        for rank, (hypothesis, way) in reversed(list(enumerate(ways)))
        for shape in _way(hypothesis, way, radius, best=rank == 0)
    ]
    whole = _bounds(outline, path)
    near = _close_up(path[-1], ways) if path else whole
    return drawing(
        near.size,
        near.size,
        _upright([*ground, *robot, *plans]),
        *_best_value(ways, radius),
        _inset(near, whole, [*ground, *robot]),
        title=_title(ways),
        viewBox=near.box,
    )


def driven_path(watched: RobotState) -> Sequence[Pose]:
    """Return the robot's path: the true one if it is published, else that of its encoders."""
    if watched.emulated.path:
        return watched.emulated.path
    start = [Pose(x=0.0, y=0.0, heading=0.0)] if watched.controlled.history else []
    return start + [decision.odometry.pose for decision in watched.controlled.history]


def hypothetical_ways(watched: RobotState) -> list[tuple[Hypothesis, list[Place]]]:
    """Return the sequences of the latest decision and their ways, the best one first."""
    decision, learned = watched.controlled.decision, watched.controlled.learned
    if decision is None or learned is None:
        return []
    start = watched.emulated.pose_at(decision.frame_time)
    if start is None:
        if watched.emulated.path:
            start = watched.emulated.path[-1]
        else:
            path = driven_path(watched)
            start = path[-2] if len(path) > 1 else path[0]
    commands = {command.name: command for command in learned.commands}
    return [
        (hypothesis, way_of(start, hypothesis.ahead, commands))
        for hypothesis in decision.hypotheses[:_MOST_HYPOTHESES]
    ]


def way_of(start: Pose, ahead: Iterable[Ahead], commands: Mapping[str, Command]) -> list[Place]:
    """Return the way of a sequence of commands: the start, and the end of each command."""
    x, y, heading = start.x, start.y, start.heading
    way = [(x, y)]
    for step in ahead:
        command = commands.get(step.command)
        if command is None:
            break
        half = command.turn / 2
        chord = command.way * (sin(half) / half if half else 1.0)
        x += chord * cos(heading + half)
        y += chord * sin(heading + half)
        heading += command.turn
        way.append((x, y))
    return way


def _solids(outline: Outline) -> list[str]:
    if not outline.solids:
        return []
    shapes = []
    (left, bottom), (right, top) = _extent(outline)
    floor = rgb(tuple(0.35 * part for part in outline.floor))  # type: ignore[arg-type]
    shapes.append(
        element("rect", x=left, y=bottom, width=right - left, height=top - bottom, fill=floor)
    )
    for solid in outline.solids:
        colour = rgb(tuple(0.85 * part for part in solid.colour))  # type: ignore[arg-type]
        shapes.append(element("polygon", points=points(solid.corners), fill=colour))
    return shapes


def _way(hypothesis: Hypothesis, way: list[Place], radius: float, *, best: bool) -> list[str]:
    colour = BEST if best else OTHER
    shapes = [_line(way, colour, 0.004 if best else 0.002, opacity=1.0 if best else 0.65)]
    if best:
        shapes += [
            element("circle", cx=x, cy=y, r=0.0032, fill=colour, data_kind="best-step")
            for x, y in way[1:]
        ]
    x, y = way[-1]
    size = radius if best else 0.004
    end = element("circle", cx=x, cy=y, r=size, fill="none", stroke=colour, stroke_width=0.0012)
    return [
        element(
            "g",
            *shapes,
            end,
            data_kind="best" if best else "hypothesis",
            data_value=hypothesis.evaluation,
        )
    ]


def _robot(pose: Pose, radius: float, *, touching: bool) -> str:
    colour = BAD if touching else INK
    body = element("circle", r=radius, fill="#10141d", stroke=colour, stroke_width=0.003)
    nose = element("line", x1=0, y1=0, x2=radius, y2=0, stroke=colour, stroke_width=0.003)
    turn = f"translate({pose.x:.4f} {pose.y:.4f}) rotate({degrees(pose.heading):.1f})"
    return element("g", body, nose, transform=turn, data_kind="robot")


def _touching(watched: RobotState) -> bool:
    truth, decision = watched.emulated.truth, watched.controlled.decision
    return bool((truth and truth.contact) or (decision and decision.collided))


def _line(places: Sequence[Place], colour: str, width: float, opacity: float) -> str:
    return element(
        "polyline",
        points=points(places),
        fill="none",
        stroke=colour,
        stroke_width=width,
        stroke_linejoin="round",
        stroke_linecap="round",
        opacity=opacity,
    )


def _extent(outline: Outline) -> tuple[Place, Place]:
    xs = [x for solid in outline.solids for x, _ in solid.corners]
    ys = [y for solid in outline.solids for _, y in solid.corners]
    return (min(xs), min(ys)), (max(xs), max(ys))


class _Window(NamedTuple):
    """A square of the arena: its left and lower edge, and its size, in metres."""

    left: float
    bottom: float
    size: float

    @property
    def box(self) -> str:
        """As a `viewBox`, in which y goes down."""
        top = self.bottom + self.size
        return f"{self.left:.4f} {-top:.4f} {self.size:.4f} {self.size:.4f}"


def _around(places: Sequence[Place], smallest: float) -> _Window:
    xs, ys = zip(*places, strict=True)
    size = max(max(xs) - min(xs), max(ys) - min(ys), smallest) + 2 * _MARGIN
    return _Window((min(xs) + max(xs) - size) / 2, (min(ys) + max(ys) - size) / 2, size)


def _bounds(outline: Outline | None, path: Sequence[Pose]) -> _Window:
    if outline and outline.solids:
        return _around(_extent(outline), 0.0)
    return _around([(pose.x, pose.y) for pose in path] or [(0.0, 0.0)], _SMALLEST)


def _close_up(robot: Pose, ways: list[tuple[Hypothesis, list[Place]]]) -> _Window:
    places = [(robot.x, robot.y)]
    if ways:
        places += ways[0][1]
    return _around(places, _SMALLEST)


def _upright(shapes: Sequence[str]) -> str:
    """Wrap shapes in the arena's frame: there y goes up, in SVG down."""
    return element("g", *shapes, transform="scale(1,-1)")


def _inset(near: _Window, whole: _Window, shapes: Sequence[str]) -> str:
    """Draw the whole arena in the upper left corner, with a frame around the part shown large."""
    frame = element(
        "rect",
        x=near.left,
        y=near.bottom,
        width=near.size,
        height=near.size,
        fill="none",
        stroke=BEST,
        stroke_width=0.008,
    )
    back = element(
        "rect",
        x=whole.left,
        y=-whole.bottom - whole.size,
        width=whole.size,
        height=whole.size,
        fill="#0b0e14",
        fill_opacity=0.85,
    )
    size = near.size * _INSET
    return element(
        "svg",
        back,
        _upright([*shapes, frame]),
        x=near.left,
        y=-near.bottom - near.size,
        width=size,
        height=size,
        viewBox=whole.box,
    )


def _best_value(ways: list[tuple[Hypothesis, list[Place]]], radius: float) -> list[str]:
    if not ways:
        return []
    hypothesis, way = ways[0]
    (x, y), text = way[-1], f"{hypothesis.evaluation:.2f}"
    return [label(x, -y - 1.4 * radius, text, font_size=0.016, fill=BEST, text_anchor="middle")]


def _title(ways: list[tuple[Hypothesis, list[Place]]]) -> str:
    if not ways:
        return "the arena from above, with the robot"
    best = ways[0][0]
    return (
        f"the arena from above; {len(ways)} hypothetical sequences, the best one of"
        f" {len(best.ahead)} commands is worth {best.evaluation:.2f}"
    )
