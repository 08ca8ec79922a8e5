"""Wishes of a browser: what it looks at, how a recording is played, and how robots are steered."""

from typing import Annotated, Final, Literal

from khepera_protocol.zenoh.payload_model import Count, Name, Payload, Real
from pydantic import Field

SLOWEST: Final = 0.1
FASTEST: Final = 100.0
"""Speeds at which a recording is played."""

Heading = Annotated[float, Field(ge=-6.3, le=6.3)]
Speed = Annotated[float, Field(ge=SLOWEST, le=FASTEST)]


class Look(Payload):
    """The first word of a page: what it showed before, if it was there before."""

    robot: Annotated[str, Field(max_length=100)] = ""
    position: Annotated[float, Field(ge=0.0, le=1e9)] = 0.0
    playing: bool = True
    speed: Speed = 1.0


class Wish(Payload):
    """A wish; which of the other fields it needs depends on what is to be done.

    `choose` a robot; `toggle`, `seek`, `leap`, `speed` play a recording; the others steer.
    """

    do: Literal[
        "choose",
        "toggle",
        "seek",
        "leap",
        "speed",
        "pause",
        "resume",
        "stop",
        "start",
        "random",
        "place",
        "push",
        "fault-on",
        "fault-off",
        "planner",
        "goal",
    ]
    robot: Annotated[str, Field(max_length=100)] = ""
    value: Real = 0.0
    thing: Count = 0
    x: Real = 0.0
    y: Real = 0.0
    heading: Heading = 0.0
    words: Annotated[str, Field(max_length=1000)] = ""
    name: Name = ""
