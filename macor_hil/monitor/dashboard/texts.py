"""Texts of the dashboard; names and reasons come from elsewhere and stay plain text.

They are cleaned as for a terminal: what turns a text around or hides in it is shown as what it is.
"""

from typing import Final

from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Phase

from macor_hil.monitor.goals import goal_seen
from macor_hil.monitor.robot_state import Arrivals, RobotState

_LINES: Final = 12
_LONGEST: Final = 200
"""Characters of a text, or of a line, that are shown."""

_OF_CONTROLLER: Final = frozenset({"decision", "ring", "columns", "rewards"})
_OF_EITHER: Final = frozenset({"arena", "eyes"})
_OF_EMULATOR: Final = frozenset({"line"})
"""Cards, by whose they are."""


def status(watched: RobotState, now: float) -> tuple[str, str]:
    """Return the state of robot and controller in words, and a colour for it."""
    seen = watched.controlled
    if not seen.alive:
        if not watched.emulated.alive:
            known = seen.met or watched.emulated.truth
            return f"{'it has gone; ' if known else ''}waiting for a robot", "grey"
        client = watched.emulated.client(now)
        return f"robot there, {client or 'nobody drives it'}", "green" if client else "cyan"
    if seen.state is None:
        return "controller there, nothing said yet", "amber"
    state = seen.state
    colours = {Phase.DRIVING: "green", Phase.STOPPED: "cyan", Phase.FAILED: "red"}
    text = f"{state.phase.value}, {state.driven} of {state.limit} commands"
    text += f": {state.reason}" if state.reason else ""
    return printable(text, _LONGEST), colours.get(state.phase, "amber")


def gone(watched: RobotState) -> frozenset[str]:
    """Return the cards that show what was, because whoever told it is not there."""
    there = watched.controlled.alive, watched.emulated.alive
    of_controller = frozenset() if there[0] else _OF_CONTROLLER
    of_emulator = frozenset() if there[1] else _OF_EMULATOR
    return of_controller | of_emulator | (frozenset() if any(there) else _OF_EITHER)


def equipment(watched: RobotState) -> str:
    """Return planner, port, camera and map of the controller."""
    state = watched.controlled.state
    if state is None:
        return ""
    parts = (f"{state.planner} planner", f"map {state.map}", state.port, f"camera {state.camera}")
    return " · ".join(printable(part, _LONGEST) for part in parts)


def situation(watched: RobotState) -> str:
    """Return the situation of the latest decision."""
    decision = watched.controlled.decision
    if decision is None:
        return "no decision yet"
    seen = decision.situation
    known = "resonates" if seen.resonant else "unknown, the nearest one"
    end = f" · to {goal_seen(decision.goal)}" if decision.goal else ""
    end += " · COLLISION" if decision.collided else ""
    return (
        f"command {decision.sequence}: situation {seen.node}, match {seen.match:.3f}, {known} ·"
        f" {len(decision.hypotheses)} sequences in {decision.steps} steps{end}"
    )


def totals(watched: RobotState) -> str:
    """Return the reinforcement of the last command and of the run."""
    decision = watched.controlled.decision
    if decision is None:
        return ""
    return f"last {decision.reinforcement:.2f} · total {decision.total_reinforcement:.2f}"


def health(watched: RobotState, now: float) -> list[tuple[str, str]]:
    """Return names and values that show the health of line, camera and telemetry."""
    seen, truth, link = watched.controlled, watched.emulated.truth, watched.controlled.link
    there = watched.emulated.alive
    rows = [
        ("pictures", _stream(watched.frames, now)),
        ("decisions", f"{_stream(seen.decisions, now)}, {seen.missed} missed"),
    ]
    if link:
        rows.append(
            (
                "exchanges",
                f"{link.exchanges}, {link.failures} failed, {1e3 * link.mean:.1f} ms mean,"
                f" {1e3 * link.worst:.1f} ms worst",
            )
        )
    if truth and there:
        left, right = (round(1000 * speed) for speed in truth.speed)
        rows.append(("wheels", f"left {left} mm/s, right {right} mm/s"))
    if truth:
        pose = truth.pose
        where = f"x {pose.x:+.3f} m, y {pose.y:+.3f} m"
        rows.append(("robot at" if there else "robot was at", where))
    if trouble := watched.not_taken.words():
        rows.append(("trouble", trouble))
    return rows


def wire(watched: RobotState) -> str:
    """Return the latest lines that passed on the serial line."""
    lines: list[tuple[str, str]] = []
    for entry in watched.emulated.wire:
        if lines and lines[-1][0] == entry.what and not lines[-1][1].endswith("\n"):
            lines[-1] = entry.what, lines[-1][1] + entry.text
        else:
            lines.append((entry.what, entry.text))
    marks = {"request": ">", "reply": "<"}
    return "\n".join(
        f"{printable(marks.get(what, what))} {printable(text.rstrip(), _LONGEST)}"
        for what, text in lines[-_LINES:]
    )


def _stream(arrivals: Arrivals, now: float) -> str:
    age, rate = arrivals.age(now), arrivals.rate(now)
    if age is None:
        return "none yet"
    often = "" if rate is None else f"{rate:.1f}/s, "
    return f"{often}last one {age:.1f} s ago"
