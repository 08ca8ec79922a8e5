"""Draws what is known of a controller; fits a terminal of 80 columns and 24 lines."""

from collections.abc import Sequence
from math import degrees
from typing import Final

from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import (
    Alternative,
    Decision,
    Link,
    State,
)
from rich.columns import Columns
from rich.console import RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from macor_hil.hardware.robots.form import Form
from macor_hil.hardware.robots.robot import FULL
from macor_hil.monitor.driving import driver_of, over
from macor_hil.monitor.goals import goal_seen
from macor_hil.monitor.robot_state import Arrivals, RobotState

_BAR_WIDTH: Final = 24
_MOST_ALTERNATIVES: Final = 5
_LONGEST_REASON: Final = 200
_EIGHTHS: Final = " ▏▎▍▌▋▊▉█"
_LEVELS: Final = "▁▂▃▄▅▆▇█"
_MOODS: Final = {
    "good": "bold green",
    "busy": "bold yellow",
    "calm": "bold cyan",
    "bad": "bold red",
    "gone": "yellow",
}
"""Styles of what is said of a driver, by its mood."""


def render(watched: RobotState, now: float) -> RenderableType:
    """Return the view of a controller.

    Args:
        watched: what is known.
        now: the time that ages are counted to, in seconds of the clock of the arrivals.
    """
    rows = Table.grid(padding=(0, 1), expand=True)
    rows.add_column(style="dim", no_wrap=True, min_width=13, max_width=13)
    rows.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    seen = watched.controlled
    driver = driver_of(watched, now)
    rows.add_row("driver", Text(driver.words, style=_MOODS[driver.mood], no_wrap=False))
    if driver.reason:
        reason = printable(driver.reason, _LONGEST_REASON)
        rows.add_row("", Text(reason, style=_MOODS[driver.mood], overflow="fold", no_wrap=False))
    if seen.state:
        _add_state(rows, seen.state)
    size = f"{len(watched.frame) / 1000:.1f} kB"
    rows.add_row("frames", _stream(watched.frames, now, size, alive=watched.alive))
    missed = f"{seen.missed} missed"
    rows.add_row("decisions", _stream(seen.decisions, now, missed, alive=seen.alive))
    if seen.link:
        rows.add_row("link", _link(seen.link))
    if seen.decision:
        plans = not over(watched) and not driver.reason
        _add_decision(rows, seen.decision, [past.reinforcement for past in seen.history], plans)
    if readings := _readings(watched):
        rows.add_row("infrared", _infrared(readings, watched.form))
    if wheels := _wheels(watched):
        rows.add_row("wheels", Text(wheels))
    if seen.decision and seen.decision.collided:
        rows.add_row("", Text("COLLISION", style="bold red"))
    if trouble := watched.not_taken.words():
        rows.add_row("trouble", Text(trouble, style="red"))
    title = f"macor-hil monitor · {printable(watched.robot)}"
    if watched.emulated.outline:
        title += f" · {printable(watched.kind)}"
    return Panel(rows, title=Text(title), border_style="green" if watched.alive else "dim")


def spark(values: list[float], width: int = 40) -> str:
    """Return a curve of one line, from 0 to the greatest value."""
    shown = values[-width:]
    top = max(shown, default=0.0)
    return "".join(_level(value / top if top > 0.0 else 0.0) for value in shown)


def bar(share: float, width: int = _BAR_WIDTH) -> str:
    """Return a horizontal bar, `share` of a width in characters."""
    eighths = round(min(max(share, 0.0), 1.0) * width * 8)
    full, rest = divmod(eighths, 8)
    return ("█" * full + (_EIGHTHS[rest] if rest else "")).ljust(width)


def _add_state(rows: Table, state: State) -> None:
    rows.add_row("drives", Text(printable(f"{state.port}, camera {state.camera}")))
    rows.add_row("by", Text(printable(f"{state.planner} planner, map {state.map}")))


def _stream(arrivals: Arrivals, now: float, extra: str, *, alive: bool) -> Text:
    age = arrivals.age(now)
    if age is None:
        return Text("none yet", style="dim")
    rate = arrivals.rate(now)
    often = "  -  /s" if rate is None else f"{rate if alive else 0.0:5.1f}/s"
    style = "" if alive else "dim"
    return Text(f"{often}  {extra}  last one {age:.1f} s ago", style=style)


def _link(link: Link) -> Text:
    failed = f"{link.failures} of {link.exchanges} failed", "red" if link.failures else ""
    return Text.assemble(failed, f", mean {1e3 * link.mean:.1f}, worst {1e3 * link.worst:.1f} ms")


def _readings(watched: RobotState) -> Sequence[int]:
    """Return the infrared readings: the line's where no controller of ours tells any."""
    line, decision = watched.emulated.line, watched.controlled.decision
    if decision is not None and watched.controlled.alive:
        return decision.infrared
    if line.proximity is not None:
        return line.proximity.values
    return decision.infrared if decision else ()


def _wheels(watched: RobotState) -> str:
    emulated, counters = watched.emulated, watched.counters
    parts = ["counters {} {}".format(*counters)] if counters else []
    if emulated.alive and emulated.truth:
        parts.append(
            "speeds {} and {} mm/s".format(*(round(1000 * v) for v in emulated.truth.speed))
        )
    return "  ".join(parts)


def _add_decision(
    rows: Table, decision: Decision, reinforcements: list[float], plans: bool
) -> None:
    seen = decision.situation
    resonance = (
        Text("resonates", style="green")
        if seen.resonant
        else Text("no match, nearest used", style="yellow")
    )
    known = f"{seen.node}, match {seen.match:.3f}, ", resonance, f" (neuron {seen.neuron})"
    rows.add_row("situation", Text.assemble(*known))
    if decision.goal:
        rows.add_row("goal", Text(goal_seen(decision.goal)))
    if plans:
        _add_plan(rows, decision)
    total = Text(f"last {decision.reinforcement:.2f}  total {decision.total_reinforcement:.2f}  ")
    total.append(spark(reinforcements, 40), style="green")
    rows.add_row("reinforcement", total)
    pose = decision.odometry.pose
    rows.add_row(
        "odometry",
        f"x {pose.x:+.3f} m  y {pose.y:+.3f} m  heading {degrees(pose.heading):+.0f}°",
    )


def _add_plan(rows: Table, decision: Decision) -> None:
    _add_alternatives(rows, decision)
    ahead = "  ".join(f"{step.command}→{step.node}" for step in decision.sequence_ahead)
    length = len(decision.sequence_ahead)
    rows.add_row("best sequence", Text(printable(f"{length}: {ahead}" if length else "none")))


def _add_alternatives(rows: Table, decision: Decision) -> None:
    shown = decision.alternatives[:_MOST_ALTERNATIVES]
    top = max((abs(a.evaluation) for a in shown if a.evaluation is not None), default=0.0)
    for alternative in shown:
        driven = alternative.command == decision.command
        rows.add_row(
            Text(printable(alternative.command), style="bold" if driven else "default"),
            _alternative(alternative, top, driven=driven),
        )


def _alternative(alternative: Alternative, top: float, *, driven: bool) -> Text:
    value = alternative.evaluation
    if value is None:
        text = Text("never tried here".ljust(_BAR_WIDTH + 9), style="dim")
    else:
        share = abs(value) / top if top > 0.0 else 0.0
        text = Text(f"{bar(share)} {value:8.3f}", style="red" if value < 0.0 else "blue")
    if driven:
        text.append(" ◀ driven", style="bold green")
    return text


def _infrared(readings: Sequence[int], form: Form) -> RenderableType:
    """Return the readings with their sensors' names, on as many lines as they take."""
    each = [
        Text.assemble(
            (f"{_short(name):<6} ", "dim"),
            (f"{_level(reading / FULL)} {reading:4}", _proximity(reading)),
        )
        for name, reading in zip(form.sensors, readings, strict=False)
    ]
    return Columns(each, padding=(0, 1), equal=True)


def _short(sensor: str) -> str:
    return sensor.replace("left", "L").replace("right", "R")


def _proximity(reading: int) -> str:
    share = reading / FULL
    return "red" if share > 0.9 else "yellow" if share > 0.3 else "default"


def _level(share: float) -> str:
    index = round(min(max(share, 0.0), 1.0) * (len(_LEVELS) - 1))
    return _LEVELS[index]
