"""Columns and activities, alternatives, reinforcement over time, infrared around the robot."""

from collections.abc import Iterable, Iterator, Sequence
from math import cos, radians, sin
from typing import Final

from khepera_protocol.serial.commands import SENSOR_BEARINGS, SENSORS
from khepera_protocol.serial.units import PROXIMITY_FULL
from khepera_protocol.zenoh.controller_payloads import Ahead, Decision, Learned

from macor_hil.monitor.dashboard.svg import (
    BAD,
    BEST,
    FAINT,
    GOOD,
    INK,
    LINE,
    OTHER,
    drawing,
    element,
    heat,
    label,
    points,
    tip,
)

_CELL: Final = 12.0
_LEFT: Final = 62.0
_MOST_BARS: Final = 60
_MOST_COLUMNS: Final = 300
"""Situations that are drawn, the first ones."""


def columns(decision: Decision | None, learned: Learned | None) -> str:
    """Draw the activity of every neuron: a column a situation, a row a command that leads into it.

    The ring marks the present neuron, the numbers the best sequence in its order.
    """
    if decision is None or learned is None:
        return drawing(660, 40, title="no activity yet")
    names = [command.name for command in learned.commands]
    count, rows = min(max(learned.situations, 1), _MOST_COLUMNS), len(names)
    activities = [*decision.activities, *[0.0] * (count * rows)][: count * rows]
    active = sum(activity > 0.0 for activity in activities)
    width, height = _LEFT + count * _CELL + 2, (rows + 1.2) * _CELL
    return drawing(
        width,
        height,
        *(_neuron(*divmod(k, rows), names, activity) for k, activity in enumerate(activities)),
        *_numbers(decision.sequence_ahead, names, count),
        *_ring(*divmod(decision.situation.neuron, rows), count),
        *_axes(names, count),
        title=f"{active} of {count * rows} neurons active",
        viewBox=f"0 -2 {width:g} {height + 2:g}",
    )


def _neuron(node: int, row: int, names: Sequence[str], activity: float) -> str:
    return element(
        "rect",
        tip(f"situation {node}, {names[row]}: {activity:.3f}"),
        x=_LEFT + node * _CELL,
        y=row * _CELL,
        width=_CELL - 1.5,
        height=_CELL - 1.5,
        rx=2,
        fill=heat(activity),
        data_kind="neuron",
    )


def _numbers(ahead: Iterable[Ahead], names: Sequence[str], count: int) -> Iterator[str]:
    """Yield the numbers of a sequence's steps, each in its neuron."""
    for number, step in enumerate(ahead, 1):
        if step.command in names and step.node < count:
            yield label(
                _LEFT + (step.node + 0.44) * _CELL,
                (names.index(step.command) + 0.72) * _CELL,
                str(number),
                font_size=8,
                fill=BEST,
                text_anchor="middle",
                font_weight="bold",
                stroke="#10141d",
                stroke_width=1.6,
                paint_order="stroke",
            )


def _ring(node: int, row: int, count: int) -> Iterator[str]:
    """Yield the ring around a neuron, if that is drawn."""
    if node < count:
        yield element(
            "rect",
            x=_LEFT + node * _CELL - 1,
            y=row * _CELL - 1,
            width=_CELL + 0.5,
            height=_CELL + 0.5,
            rx=3,
            fill="none",
            stroke=INK,
            stroke_width=1.6,
        )


def _axes(names: Sequence[str], count: int) -> Iterator[str]:
    """Yield the names of the rows, and the numbers of every fifth column."""
    for row, name in enumerate(names):
        yield label(_LEFT - 6, (row + 0.75) * _CELL, name, font_size=9, text_anchor="end")
    y = (len(names) + 0.9) * _CELL
    for node in range(0, count, 5):
        yield label(_LEFT + (node + 0.44) * _CELL, y, str(node), font_size=8, text_anchor="middle")


def alternatives(decision: Decision | None) -> str:
    """Draw the evaluation of each command; the one that was driven is marked."""
    if decision is None:
        return drawing(320, 60, title="no decision yet")
    values = [a.evaluation for a in decision.alternatives if a.evaluation is not None]
    top = max((abs(value) for value in values), default=0.0) or 1.0
    shapes = []
    for row, alternative in enumerate(decision.alternatives):
        y, driven = 22 * row, alternative.command == decision.command
        colour = BEST if driven else OTHER
        shapes.append(
            label(
                64,
                y + 15,
                alternative.command,
                font_size=13,
                text_anchor="end",
                fill=INK if driven else FAINT,
            )
        )
        if alternative.evaluation is None:
            shapes.append(label(72, y + 15, "never tried here", font_size=12))
            continue
        width = 170 * abs(alternative.evaluation) / top
        shapes.append(element("rect", x=72, y=y + 4, width=width, height=14, rx=2, fill=colour))
        shapes.append(
            label(78 + width, y + 15, f"{alternative.evaluation:.3f}", font_size=12, fill=INK)
        )
    return drawing(
        320,
        22 * len(decision.alternatives) + 2,
        *shapes,
        title=f"the command {decision.command} was driven",
    )


def reinforcement(history: list[Decision]) -> str:
    """Draw the reinforcement of the latest commands, a bar each; red marks a collision."""
    shown = history[-_MOST_BARS:]
    top = max([decision.reinforcement for decision in shown] + [0.7])
    shapes = [
        element("line", x1=30, x2=392, y1=y, y2=y, stroke=LINE, stroke_width=0.8)
        for y in (10, 50, 90)
    ]
    shapes += [
        label(26, y + 4, f"{value:.2f}", font_size=9, text_anchor="end")
        for y, value in ((10, top), (50, top / 2), (90, 0.0))
    ]
    for k, decision in enumerate(shown):
        x, height = 32 + k * 6, 80 * max(decision.reinforcement, 0.0) / top
        colour = BAD if decision.collided else GOOD
        hint = tip(f"command {decision.sequence}: {decision.reinforcement:.2f}")
        shapes.append(
            element(
                "rect",
                hint,
                x=x,
                y=90 - height,
                width=4.5,
                height=max(height, 1.0),
                fill=colour,
                data_kind="reward",
            )
        )
        if decision.collided:
            shapes.append(
                element("path", d=f"M{x - 1} 78l6 6m0 -6l-6 6", stroke=BAD, stroke_width=1.5)
            )
        if decision.sequence % 10 == 0:
            shapes.append(
                label(x + 2, 102, str(decision.sequence), font_size=9, text_anchor="middle")
            )
    return drawing(400, 106, *shapes, title="reinforcement of the latest commands")


def infrared(readings: list[int] | None) -> str:
    """Draw the eight sensors around the robot, a wedge as long as the reading; ahead is up."""
    centre, radius, reach = 100.0, 34.0, 52.0
    shapes = [
        element(
            "circle",
            cx=centre,
            cy=centre,
            r=radius + share * reach,
            fill="none",
            stroke=LINE,
            stroke_width=0.8,
        )
        for share in (0.0, 0.5, 1.0)
    ]
    shapes.append(
        element(
            "polyline",
            points=points([(centre, centre), (centre, centre - radius)]),
            stroke=FAINT,
            stroke_width=2,
        )
    )
    for name, bearing, reading in zip(SENSORS, SENSOR_BEARINGS, readings or (), strict=False):
        share = min(max(reading / PROXIMITY_FULL, 0.0), 1.0)
        outer = radius + 2 + share * reach
        corners = [
            _around(centre, r, bearing + side)
            for r, side in ((radius, -9), (outer, -9), (outer, 9), (radius, 9))
        ]
        colour = BAD if share > 0.9 else BEST if share > 0.3 else GOOD
        hint = tip(f"{name}: {reading}")
        shapes.append(
            element("polygon", hint, points=points(corners), fill=colour, data_kind="sensor")
        )
        x, y = _around(centre, radius + 10 + share * (reach - 10), bearing + 17)
        shapes.append(label(x, y + 3, str(reading), font_size=8, fill=INK, text_anchor="middle"))
    return drawing(200, 200, *shapes, title="infrared sensors, ahead is up")


def _around(centre: float, r: float, bearing: float) -> tuple[float, float]:
    angle = radians(bearing)
    return centre - r * sin(angle), centre - r * cos(angle)
