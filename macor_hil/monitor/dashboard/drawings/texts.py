"""Texts of the dashboard; names and reasons come from elsewhere and stay plain text.

They are cleaned as for a terminal: what turns a text around or hides in it is shown as what it is.
"""

from collections.abc import Iterable
from html import escape
from typing import Final, NamedTuple

from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Decision, Phase

from macor_hil.monitor.dashboard.drawings.svg import element
from macor_hil.monitor.goals import goal_seen
from macor_hil.monitor.line_state import LineState
from macor_hil.monitor.robot_state import Arrivals, RobotState

_LINES: Final = 40
_LONGEST: Final = 200
"""Characters of a text, or of a line, that are shown."""

_OLD: Final = 2.0
"""Seconds after which the age of a sample is told."""


class Row(NamedTuple):
    """A name and a value; `gone` where whoever told it is not there any more."""

    name: str
    value: str
    gone: bool = False


def rows(shown: Iterable[Row]) -> str:
    """Return rows as the content of a `dl`."""
    return "".join(
        element("dt", escape(row.name))
        + element("dd", escape(printable(row.value, _LONGEST)), class_="gone" if row.gone else None)
        for row in shown
    )


def equipment(watched: RobotState) -> str:
    """Return planner, port, camera and map of the controller that is there."""
    state = watched.controlled.state
    if state is None or not watched.controlled.alive:
        return ""
    what = state.planner if state.phase is Phase.TRAINING else f"{state.planner} planner"
    parts = (what, f"map {state.map}", state.port, f"camera {state.camera}")
    return escape(" · ".join(printable(part, _LONGEST) for part in parts))


def situation(decision: Decision) -> str:
    """Return the situation of a decision."""
    seen = decision.situation
    known = "resonates" if seen.resonant else "no match, nearest used"
    end = f" · to {goal_seen(decision.goal)}" if decision.goal else ""
    end += " · COLLISION" if decision.collided else ""
    return escape(
        f"command {decision.sequence}: situation {seen.node}, match {seen.match:.3f}, {known} ·"
        f" {len(decision.hypotheses)} sequences in {decision.steps} steps{end}"
    )


def totals(decision: Decision) -> str:
    """Return the reinforcement of a command and of the run."""
    return f"last {decision.reinforcement:.2f}, total {decision.total_reinforcement:.2f}"


def of_the_robot(watched: RobotState) -> list[Row]:
    """Return what is known of a robot's wheels, lamps and place, from whoever tells it."""
    line, truth = watched.emulated.line, watched.emulated.truth
    gone = not watched.emulated.alive
    found = [Row("kind", watched.kind, gone)] if watched.emulated.outline else []
    if truth:
        left, right = (0 if gone else round(1000 * speed) for speed in truth.speed)
        found.append(Row("wheels", f"{left} and {right} mm/s", gone))
    if line.wanted:
        found.append(Row("speeds set", "{} and {}".format(*line.wanted), gone))
    if line.speed and not truth:
        found.append(Row("speeds read", "{} and {}".format(*line.speed), gone))
    if counters := watched.counters:
        found.append(Row("counters", "{} and {}".format(*counters), gone and not watched.alive))
    if line.lamps:
        lit = [f"{name} {'on' if shines else 'off'}" for name, shines in line.lamps.items()]
        found.append(Row("lamps", ", ".join(lit), gone))
    if line.battery is not None:
        found.append(Row("battery", f"{line.battery:.2f} V", gone))
    if line.ambient:
        found.append(Row("ambient light", " ".join(map(str, line.ambient.values)), gone))
    if truth:
        pose = truth.pose
        where = f"x {100 * pose.x:+.1f} cm, y {100 * pose.y:+.1f} cm"
        found.append(Row("was at" if gone else "at", where, gone))
        if truth.faults:
            found.append(Row("faults", ", ".join(truth.faults), gone))
    return found


def health(watched: RobotState, now: float) -> list[Row]:
    """Return names and values that show the health of line, camera and telemetry."""
    seen = watched.controlled
    decisions, link = _stream(seen.decisions, now, alive=seen.alive), seen.link
    missed = f", {seen.missed} missed" if seen.missed else ""
    found = [
        Row("pictures", _stream(watched.frames, now, alive=watched.alive), not watched.alive),
        Row("decisions", f"{decisions}{missed}", not seen.alive),
    ]
    if link:
        failed = f", {link.failures} failed" if link.failures else ""
        mean, worst = 1e3 * link.mean, 1e3 * link.worst
        text = f"{link.exchanges}{failed}; {mean:.1f} ms, at worst {worst:.1f} ms"
        found.append(Row("exchanges", text, not seen.alive))
    if trouble := watched.not_taken.words():
        found.append(Row("trouble", trouble))
    return found


def exchanges(line: LineState) -> str:
    """Return the latest exchanges of a line, newest first, as rows of a table."""
    shown = []
    for row in list(line.rows)[: -_LINES - 1 : -1]:
        if not row.request:
            words = element("td", escape(row.reply), colspan=3)
            shown.append(element("tr", words, _time(row.time), class_="event"))
            continue
        count = f" ({row.count} times)" if row.count > 1 else ""
        taken = "" if row.taken is None else f"{1000 * row.taken:.0f}"
        shown.append(
            element(
                "tr",
                element("td", escape(row.request + count)),
                element("td", escape(row.reply or "no reply yet")),
                element("td", taken),
                _time(row.time),
            )
        )
    return "".join(shown)


def stale(watched: RobotState, now: float) -> bool:
    """Return whether the latest picture shows what was, not what is."""
    return bool(watched.frame) and (not watched.alive or watched.frames.rate(now) == 0.0)


def _time(seconds: float) -> str:
    return element("td", f"{seconds:.2f}")


def _stream(arrivals: Arrivals, now: float, *, alive: bool) -> str:
    age, rate = arrivals.age(now), arrivals.rate(now)
    if age is None:
        return "none yet"
    often = "" if rate is None else f"{rate if alive else 0.0:.1f}/s"
    old = f"last one {age:.0f} s ago" if age > _OLD else ""
    return ", ".join(filter(None, [often, old])) or "one"
