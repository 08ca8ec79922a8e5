"""Columns of activities, values of commands, reinforcement over time, infrared sensors."""

from collections.abc import Iterable, Sequence
from math import cos, radians, sin
from typing import Any, Final

from khepera_protocol.zenoh.controller_payloads import Decision, Learned

from macor_hil.hardware.robots.form import Form
from macor_hil.hardware.robots.robot import FULL
from macor_hil.monitor.dashboard.drawings.svg import clean, element, tip
from macor_hil.monitor.robot_state import Mark, MarkKind

MOST_BARS: Final = 60
MOST_COLUMNS: Final = 300
"""Situations that are drawn, the first ones."""

LEVELS: Final = "0123456789a"
"""Levels of activity, from none to full."""

_HEIGHT: Final = 80.0
"""Of the bars of reinforcement."""


def columns(learned: Learned) -> str:
    """Return a block for every situation, with a cell for every command that leads into it."""
    rows = len(learned.commands)
    cells = "<i></i>" * rows
    return "".join(
        element("div", cells + (f"<b>{node}</b>" if node % 5 == 0 else ""), class_="column")
        for node in range(min(max(learned.situations, 1), MOST_COLUMNS))
    )


def row_names(learned: Learned) -> str:
    """Return the commands of the rows, from above."""
    return clean(", ".join(command.name for command in learned.commands))


def cells(decision: Decision, learned: Learned) -> dict[str, Any]:
    """Return what the cells show.

    Returns:
        `levels`: a character of `LEVELS` for each neuron; `now`: the present neuron; `ahead`: pairs
        of a neuron and its number in the best sequence. Neurons that are not drawn are left out.
    """
    rows = len(learned.commands)
    count = min(max(learned.situations, 1), MOST_COLUMNS) * rows
    shown = [_level(activity) for activity in decision.activities[:count]]
    names = {command.name: row for row, command in enumerate(learned.commands)}
    ahead = [
        (step.node * rows + names[step.command], number)
        for number, step in enumerate(decision.sequence_ahead, 1)
        if step.command in names
    ]
    neuron = decision.situation.neuron
    return {
        "levels": "".join(shown).ljust(count, LEVELS[0]),
        "now": neuron if neuron < count else None,
        "ahead": [pair for pair in ahead if pair[0] < count],
    }


def activity(decision: Decision, learned: Learned) -> str:
    """Return the cells in words."""
    if not decision.activities:
        return "this planner has no wave of activity"
    active = sum(each > 0.0 for each in decision.activities)
    total = learned.situations * len(learned.commands)
    ahead = ", ".join(f"{step.node} by {step.command}" for step in decision.sequence_ahead[:3])
    more = "..." if len(decision.sequence_ahead) > 3 else ""
    best = f"; best sequence: {ahead}{more}" if ahead else ""
    return clean(f"{active} of {total} neurons active{best}")


def _level(activity: float) -> str:
    if activity <= 0.0:
        return LEVELS[0]
    return LEVELS[min(max(round(activity * (len(LEVELS) - 1)), 1), len(LEVELS) - 1)]


def alternatives(decision: Decision) -> str:
    """Return rows of a table: each command, a bar, its value; the one that was driven is marked."""
    values = [a.evaluation for a in decision.alternatives if a.evaluation is not None]
    top = max((abs(value) for value in values), default=0.0) or 1.0
    rows = []
    for alternative in decision.alternatives:
        driven, value = alternative.command == decision.command, alternative.evaluation
        mark = " ◀ driven" if driven else ""
        if value is None:
            bar, text = "", "never tried here"
        else:
            width = 100 * abs(value) / top
            bar = element(
                "svg",
                element("rect", width=width, height=10),
                viewBox="0 0 100 10",
                preserveAspectRatio="none",
                aria_hidden="true",
            )
            text = f"{value:.3f}"
        rows.append(
            element(
                "tr",
                element("th", clean(alternative.command), scope="row"),
                element("td", bar),
                element("td", text + mark),
                class_="driven" if driven else None,
            )
        )
    return "".join(rows)


def reinforcement(history: Sequence[Decision], marks: Iterable[Mark]) -> str:
    """Draw the reinforcement of the latest commands, a bar each; collisions and failures marked."""
    shown = history[-MOST_BARS:]
    top = top_reinforcement(shown)
    failed = {
        next((each.sequence for each in shown if each.sequence >= mark.sequence), None): mark
        for mark in marks
        if mark.kind is not MarkKind.COLLISION and mark.sequence is not None
    }
    shapes = []
    for k, decision in enumerate(shown):
        x, height = 6 * k, _HEIGHT * max(decision.reinforcement, 0.0) / top
        hint = tip(f"command {decision.sequence}: {decision.reinforcement:.2f}")
        look = "reward collided" if decision.collided else "reward"
        height = max(height, 1.5)
        bar = element("rect", x=x, y=88 - height, width=4.5, height=height)
        if decision.collided:
            bar += element("path", d=f"M{x - 0.5} 76l6 6m0 -6l-6 6", class_="mark collision")
        if mark := failed.get(decision.sequence):
            hint = tip(f"command {decision.sequence}: {mark.words}")
            bar += element("path", d=f"M{x + 2.2} 1l3.2 6h-6.4z", class_=f"mark {mark.kind}")
        shapes.append(element("g", hint, bar, class_=look, data_kind="reward"))
    return "".join(shapes)


def top_reinforcement(shown: Sequence[Decision]) -> float:
    """Return the value at the upper edge of the bars."""
    return max([decision.reinforcement for decision in shown] + [0.7])


def infrared(form: Form, readings: Sequence[int] | None) -> str:
    """Draw the eight sensors around the robot, a wedge as long as the reading; ahead is up."""
    centre, radius, reach = 105.0, 30.0, 48.0
    shapes = [
        element("circle", cx=centre, cy=centre - 8, r=radius + share * reach, class_="ring")
        for share in (0.0, 0.5, 1.0)
    ]
    shapes.append(element("path", d=f"M{centre:g} {centre - 8:g}v{-radius:g}", class_="nose"))
    for name, bearing, reading in zip(form.sensors, form.bearings, readings or (), strict=False):
        share = min(max(reading / FULL, 0.0), 1.0)
        outer = radius + 2 + share * reach
        corners = [
            _around(centre, r, bearing + side)
            for r, side in ((radius, -9), (outer, -9), (outer, 9), (radius, 9))
        ]
        level = "near" if share > 0.9 else "close" if share > 0.3 else "far"
        path = " ".join(f"{x:.0f},{y:.0f}" for x, y in corners)
        hint = tip(f"{name}: {reading}")
        shapes.append(
            element("polygon", hint, points=path, class_=f"sensor {level}", data_kind="sensor")
        )
        x, y = _around(centre, radius + reach + 14, bearing)
        shapes.append(element("text", str(reading), x=round(x), y=round(y + 4), class_="label"))
    return "".join(shapes)


def _around(centre: float, r: float, bearing: float) -> tuple[float, float]:
    angle = radians(bearing)
    return centre - r * sin(angle), centre - 8 - r * cos(angle)
