"""The driver of a robot, in words: this project's controller, a training, another program, nobody.

For the terminal and the browser alike.
"""

from enum import StrEnum
from math import inf
from typing import Final, NamedTuple

from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Phase, State

from macor_hil.monitor.robot_state import RobotState

_LONGEST: Final = 600
"""Characters of a reason."""

_IN_A_LINE: Final = 100
"""Characters of words and reason together; a longer reason stands apart."""

_TURNS: Final = 0.004
"""m/s from which on a wheel turns."""

_LATELY: Final = 5.0
"""Seconds for which a request tells that a program is on the line."""

_LAST_WORDS: Final = 0.5
"""Seconds for which the requests of a controller that has gone may still arrive."""

_OVER: Final = frozenset({Phase.STOPPED, Phase.FAILED})
"""Phases after which nothing of a run comes."""


class Who(StrEnum):
    """Kinds of drivers."""

    CONTROLLER = "controller"
    TRAINING = "training"
    CLIENT = "client"
    NOBODY = "nobody"
    ABSENT = "absent"
    """There is no robot."""


class Driver(NamedTuple):
    """A robot's driver.

    Attributes:
        who: its kind.
        mood: `good`, `busy`, `bad`, `calm` or `gone`, for a colour.
        words: what is known of it, in a line.
        brief: a few words, for lists of robots.
        reason: a sentence that does not fit into that line, such as that of a failure.
    """

    who: Who
    mood: str
    words: str
    brief: str
    reason: str = ""


def driver_of(watched: RobotState, now: float) -> Driver:
    """Return who drives a robot now."""
    seen, emulated = watched.controlled, watched.emulated
    if seen.alive:
        return _controller(watched)
    if not emulated.alive:
        known = seen.met or emulated.truth is not None
        words = "the robot has gone" if known else "waiting for a robot"
        brief = "gone" if known else "not there"
        return _after_a_run(Driver(Who.ABSENT, "gone", words, brief), watched)
    if client := client_of(watched, now):
        return Driver(Who.CLIENT, "good", client, "another program")
    nobody = Driver(Who.NOBODY, "calm", "nobody drives", "nobody drives")
    return _after_a_run(nobody, watched)


def client_of(watched: RobotState, now: float) -> str:
    """Return what a program does that is no controller of ours; empty without one."""
    emulated = watched.emulated
    if not emulated.alive:
        return ""
    since = -inf if watched.left is None else watched.left + _LAST_WORDS
    if now < since + _LAST_WORDS:
        return ""
    turns = emulated.truth is not None and any(abs(v) > _TURNS for v in emulated.truth.speed)
    if turns or _lately(emulated.line.driven, since, now):
        return "another program drives"
    return "another program talks to the robot" if _lately(emulated.line.asked, since, now) else ""


def over(watched: RobotState) -> bool:
    """Return whether what the controller told is of a run that is over."""
    seen = watched.controlled
    return not seen.alive or (seen.state is not None and seen.state.phase in _OVER)


def _after_a_run(driver: Driver, watched: RobotState) -> Driver:
    """Add how the run of a controller that has gone ended, if one was seen."""
    seen = watched.controlled
    if seen.alive or not seen.met or seen.state is None:
        return driver
    run = driver._replace(words=f"{driver.words}; {_last_run(seen.state)}")
    return _because(run, seen.state.reason if seen.state.phase in _OVER else "", ": ")


def _last_run(state: State) -> str:
    what = "training" if state.phase is Phase.TRAINING else "run"
    if state.phase is Phase.TRAINING and state.driven >= state.limit:
        return f"last training is done: {state.driven} commands"
    if state.phase in _OVER:
        return f"last {what} {state.phase.value} after {_commands(state)}"
    return f"last {what} vanished after {_commands(state)}"


def _controller(watched: RobotState) -> Driver:
    state = watched.controlled.state
    if state is None:
        return Driver(Who.CONTROLLER, "busy", "a controller is there, nothing said yet", "starting")
    if state.phase is Phase.TRAINING:
        share = f"{100 * state.driven / max(state.limit, 1):.0f} %"
        words = f"training, {share}: {state.driven} of {state.limit} commands"
        return Driver(Who.TRAINING, "good", words, f"training {share}")
    words = f"controller {state.phase.value}, {_commands(state)}"
    moods = {
        Phase.DRIVING: "good",
        Phase.PAUSED: "calm",
        Phase.STOPPED: "calm",
        Phase.FAILED: "bad",
    }
    share = f"/{state.limit}" if state.limit else ""
    brief = f"{state.phase.value} {state.driven}{share}"
    driver = Driver(Who.CONTROLLER, moods.get(state.phase, "busy"), words, brief)
    return _because(driver, state.reason, "; ")


def _commands(state: State) -> str:
    """Return how many commands were driven, and of how many, where there is a limit."""
    return (
        f"{state.driven} of {state.limit} commands" if state.limit else f"{state.driven} commands"
    )


def _because(driver: Driver, reason: str, joint: str) -> Driver:
    """Add a reason to the words, or apart from them where it is long."""
    told = printable(reason, _LONGEST)
    line = f"{driver.words}{joint}{told}" if told else driver.words
    if len(line) <= _IN_A_LINE:
        return driver._replace(words=line)
    return driver._replace(reason=told)


def _lately(when: float | None, since: float, now: float) -> bool:
    return when is not None and when > since and now - when < _LATELY
