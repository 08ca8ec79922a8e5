"""Draws what is known of a controller; fits a terminal of 80 columns and 24 lines."""

from math import degrees
from typing import Final

from khepera_protocol.serial.commands import SENSORS
from khepera_protocol.serial.units import PROXIMITY_FULL
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import (
    Alternative,
    Decision,
    Link,
    Phase,
    State,
)
from rich.console import RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from macor_hil.monitor.goals import goal_seen
from macor_hil.monitor.robot_state import Arrivals, Controlled, Emulated, RobotState

_BAR_WIDTH: Final = 32
_MOST_ALTERNATIVES: Final = 5
_EIGHTHS: Final = " ▏▎▍▌▋▊▉█"
_LEVELS: Final = "▁▂▃▄▅▆▇█"
_SENSORS: Final = tuple(
    name.replace("left", "L").replace("right", "R").replace("back", "back") for name in SENSORS
)
_PHASE_STYLES: Final = {
    Phase.STARTING: "yellow",
    Phase.DRIVING: "bold green",
    Phase.LATE: "bold yellow",
    Phase.RECOVERING: "bold yellow",
    Phase.STOPPED: "bold cyan",
    Phase.FAILED: "bold red",
}


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
    rows.add_row("controller", _status(seen, watched.emulated.client(now)))
    if seen.state:
        _add_state(rows, seen.state)
    rows.add_row("frames", _stream(watched.frames, now, f"{len(watched.frame) / 1000:.1f} kB"))
    rows.add_row("decisions", _stream(seen.decisions, now, f"{seen.missed} missed"))
    if seen.link:
        rows.add_row("link", _link(seen.link))
    if seen.decision:
        _add_decision(rows, seen.decision, [past.reinforcement for past in seen.history])
        rows.add_row("wheels", Text(_wheels(seen.decision, watched.emulated)))
        if seen.decision.collided:
            rows.add_row("", Text("COLLISION", style="bold red"))
    if trouble := watched.not_taken.words():
        rows.add_row("trouble", Text(trouble, style="red"))
    title = f"macor-hil monitor · {printable(watched.robot)}"
    return Panel(rows, title=Text(title), border_style="green" if seen.alive else "dim")


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


def _status(watched: Controlled, client: str) -> Text:
    if not watched.alive:
        what = f"none; {client}" if client else "waiting for a controller..."
        return Text(f"{what}{_farewell(watched)}", style="yellow")
    if watched.state is None:
        return Text("there, nothing said yet", style="yellow")
    state = watched.state
    text = Text(state.phase.value, style=_PHASE_STYLES[state.phase])
    of = f" of {state.limit}" if state.limit else ""
    text.append(f"  {state.driven}{of} commands", style="default not bold")
    if state.reason:
        text.append(f"  {printable(state.reason)}", style="default not bold")
    return text


def _farewell(watched: Controlled) -> str:
    """Return how the controller that has gone ended, as far as it said."""
    state = watched.state
    if not watched.met or state is None:
        return ""
    if state.phase in (Phase.STOPPED, Phase.FAILED):
        return printable(f"  the last one {state.phase.value}: {state.reason}")
    return "  the last one vanished " + state.phase.value


def _add_state(rows: Table, state: State) -> None:
    rows.add_row("drives", Text(printable(f"{state.port}, camera {state.camera}")))
    rows.add_row("by", Text(printable(f"{state.planner} planner, map {state.map}")))


def _stream(arrivals: Arrivals, now: float, extra: str) -> Text:
    age = arrivals.age(now)
    if age is None:
        return Text("none yet", style="dim")
    rate = arrivals.rate(now)
    often = "  -  /s" if rate is None else f"{rate:5.1f}/s"
    return Text(f"{often}  {extra}  last one {age:.1f} s ago")


def _link(link: Link) -> Text:
    text = Text(f"{link.exchanges} exchanges, {1e3 * link.mean:.1f} ms mean, ")
    text.append(f"{1e3 * link.worst:.1f} ms worst, ")
    text.append(f"{link.failures} failed", style="red" if link.failures else "")
    return text


def _wheels(decision: Decision, emulated: Emulated) -> str:
    left, right = decision.odometry.counters
    text = f"counters {left} {right}"
    if emulated.alive and emulated.truth:
        speeds = [round(1000 * speed) for speed in emulated.truth.speed]
        text += f"  speeds {speeds[0]} and {speeds[1]} mm/s"
    return text


def _add_decision(rows: Table, decision: Decision, reinforcements: list[float]) -> None:
    seen = decision.situation
    resonance = (
        Text("resonates", style="green")
        if seen.resonant
        else Text("unknown, the nearest one", style="yellow")
    )
    rows.add_row(
        "situation",
        Text(f"{seen.node} (neuron {seen.neuron}), match {seen.match:.3f}, ") + resonance,
    )
    _add_alternatives(rows, decision)
    if decision.goal:
        rows.add_row("goal", Text(goal_seen(decision.goal)))
    ahead = "  ".join(f"{step.command}→{step.node}" for step in decision.sequence_ahead)
    length = len(decision.sequence_ahead)
    rows.add_row("best sequence", Text(printable(f"{length}: {ahead}" if length else "none")))
    total = Text(f"last {decision.reinforcement:.2f}  total {decision.total_reinforcement:.2f}  ")
    total.append(spark(reinforcements, 40), style="green")
    rows.add_row("reinforcement", total)
    rows.add_row("infrared", _infrared(decision.infrared))
    pose = decision.odometry.pose
    rows.add_row(
        "odometry",
        f"x {pose.x:+.3f} m  y {pose.y:+.3f} m  heading {degrees(pose.heading):+.0f}°",
    )


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
        text.append("  ◀ driven", style="bold green")
    return text


def _infrared(readings: list[int]) -> Table:
    table = Table.grid(padding=(0, 1))
    for _ in readings:
        table.add_column(justify="right", width=6)
    table.add_row(*(Text(name, style="dim") for name in _SENSORS))
    table.add_row(
        *(
            Text(f"{_level(reading / PROXIMITY_FULL)} {reading:4}", style=_proximity(reading))
            for reading in readings
        )
    )
    return table


def _proximity(reading: int) -> str:
    share = reading / PROXIMITY_FULL
    return "red" if share > 0.9 else "yellow" if share > 0.3 else "default"


def _level(share: float) -> str:
    index = round(min(max(share, 0.0), 1.0) * (len(_LEVELS) - 1))
    return _LEVELS[index]
