"""A goal that is driven to, in words."""

from math import degrees

from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Goal


def goal_seen(goal: Goal) -> str:
    """Return a goal's name, where it is seen, and whether it is reached."""
    name = printable(goal.name)
    if goal.reached:
        return f"{name}, reached"
    if goal.bearing is None:
        return f"{name}, not in view"
    turn = round(degrees(goal.bearing))
    side = "left" if turn > 0 else "right"
    return f"{name}, seen {abs(turn)}° to the {side}" if turn else f"{name}, seen ahead"
