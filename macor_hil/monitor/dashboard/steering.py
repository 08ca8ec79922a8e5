"""Steers robots and their controllers, for a page that may: asks over Zenoh what it is wished."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

import zenoh
from khepera_protocol.zenoh.ask import AskError, ask
from khepera_protocol.zenoh.controller_payloads import Steer
from khepera_protocol.zenoh.keys import FAULTS, PUSH, RESET
from khepera_protocol.zenoh.payloads import (
    FaultsOn,
    FaultSwitch,
    Outline,
    Pose,
    Push,
    Reset,
    Truth,
)

from macor_hil.errors import TelemetryError
from macor_hil.monitor.dashboard.wishes import Wish
from macor_hil.telemetry.session import check_robot_name
from macor_hil.telemetry.wishes.steer_key import ask_to_steer
from macor_hil.telemetry.wishes.stop_key import ask_to_stop


def steer(session: zenoh.Session, robot: str, wish: Wish) -> str:
    """Carry out a wish, and return in words what was done; waits for the answer.

    Raises:
        TelemetryError: nobody answers, or the robot or controller refuses.
    """
    check_robot_name(robot)
    action = _ACTIONS.get(wish.do)
    if action is None:
        raise TelemetryError(f"{wish.do} steers nothing")
    try:
        return action(session, robot, wish)
    except AskError as error:
        raise TelemetryError(str(error)) from None


def _stop(session: zenoh.Session, robot: str, _: Wish) -> str:
    ask_to_stop(session, robot)
    return f"the controller of {robot} is stopping it"


def _course(session: zenoh.Session, robot: str, wish: Wish) -> str:
    wishes = {
        "pause": Steer(pause=True),
        "resume": Steer(pause=False),
        "planner": Steer(planner=wish.name),
        "goal": Steer(goal=wish.name),
    }
    return ask_to_steer(session, robot, wishes[wish.do])


def _put(session: zenoh.Session, robot: str, wish: Wish) -> str:
    resets = {
        "start": Reset(),
        "random": Reset(random=True),
        "place": Reset(pose=Pose(x=wish.x, y=wish.y, heading=wish.heading)),
    }
    pose = ask(session, robot, RESET, Truth, resets[wish.do]).pose
    return f"{robot} stands at x {100 * pose.x:.1f} cm, y {100 * pose.y:.1f} cm"


def _push(session: zenoh.Session, robot: str, wish: Wish) -> str:
    ask(session, robot, PUSH, Outline, Push(thing=wish.thing, x=wish.x, y=wish.y))
    return f"thing {wish.thing} is at x {100 * wish.x:.1f} cm, y {100 * wish.y:.1f} cm"


def _fault(session: zenoh.Session, robot: str, wish: Wish) -> str:
    on = wish.do == "fault-on"
    switch = FaultSwitch(on=[wish.words]) if on else FaultSwitch(off=[wish.words])
    kinds = ask(session, robot, FAULTS, FaultsOn, switch).kinds
    return f"faults of {robot}: {', '.join(kinds)}" if kinds else f"{robot} has no faults"


_Action = Callable[[zenoh.Session, str, Wish], str]

_ACTIONS: Final[Mapping[str, _Action]] = MappingProxyType(
    {
        "stop": _stop,
        **dict.fromkeys(("pause", "resume", "planner", "goal"), _course),
        **dict.fromkeys(("start", "random", "place"), _put),
        "push": _push,
        **dict.fromkeys(("fault-on", "fault-off"), _fault),
    }
)

STEERS: Final = frozenset(_ACTIONS)
"""Wishes that steer."""
