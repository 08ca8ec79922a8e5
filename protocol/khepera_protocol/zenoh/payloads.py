"""JSON payloads of the emulator's keys, and what both sides use: stamps, poses and stops.

Those of the controller are in `khepera_protocol.zenoh.controller_payloads`;
`khepera_protocol.zenoh.keys` says which key holds which.
"""

from typing import Annotated, Final, Literal

from pydantic import FailFast, Field

from khepera_protocol.zenoh.payload_model import (
    Count,
    Name,
    Number,
    Payload,
    Point,
    Real,
    Share,
    Text,
    Time,
    Title,
)

MOST_SOLIDS: Final = 2_000
"""Solids of an outline."""

MOST_FAULTS: Final = 1_000
"""Faults of a robot that last at the same time."""


USUAL_ROBOT: Final = "khepera"
"""Kind of the robots of samples that tell none."""


class Stamp(Payload):
    """Attachment of every sample."""

    sequence: Number = Field(description="counts samples of this key from 0")
    time: Time = Field(description="seconds on the robot's clock; wall clock for a real robot")


class Pose(Payload):
    """The pose of a robot: x forward at heading 0, y to its left, counter-clockwise positive."""

    x: Real = Field(description="metres")
    y: Real = Field(description="metres")
    heading: Real = Field(description="radians")


class WheelDrift(Payload):
    """The drift that encoders do not see, as drawn for one emulated robot."""

    left_scale: Real = Field(description="true way of the left wheel over the counted way")
    right_scale: Real = Field(description="true way of the right wheel over the counted way")
    wheel_base: Real = Field(description="true wheel base, metres")
    slip: Real = Field(description="standard deviation of the way of one control period, relative")


class Truth(Payload):
    """Ground truth of an emulated robot: for scoring and set-up, never for control."""

    time: Time = Field(description="seconds of simulated time")
    pose: Pose
    speed: tuple[Real, Real] = Field(description="left and right wheel over ground, m/s")
    contact: bool = Field(description="whether the body touches something now")
    touched: bool = Field(description="whether it has touched something since the last reset")
    drift: WheelDrift
    faults: Annotated[tuple[Text, ...], FailFast()] = Field(
        default=(), max_length=MOST_FAULTS, description="kinds of its own faults that last now"
    )


class Reset(Payload):
    """A place for an emulated robot, which is powered on afresh. Nothing given: its start pose."""

    pose: Pose | None = Field(default=None, description="where to; absent: see random")
    random: bool = Field(default=False, description="a free place drawn from the robot's seed")
    seed: int | None = Field(
        default=None, ge=0, le=2**63 - 1, description="start all chance anew from this seed"
    )


class Push(Payload):
    """Another place for a thing that robots can push."""

    thing: Count = Field(description="its number, from 0")
    x: Real = Field(description="metres")
    y: Real = Field(description="metres")


Kinds = Annotated[list[Text], FailFast(), Field(max_length=MOST_FAULTS)]


class FaultSwitch(Payload):
    """Faults of a robot or its line that are switched on or off; nothing given: a look at them."""

    on: Kinds = Field(default=[], description="faults as --fault takes them; `at` counts from now")
    off: Kinds = Field(default=[], description="kinds of faults")


class FaultsOn(Payload):
    """The faults of a robot and its line that are switched on."""

    kinds: Kinds = Field(description="in the order in which they were switched on")


class Solid(Payload):
    """Something upright in an arena, seen from above."""

    corners: Annotated[list[Point], FailFast()] = Field(
        min_length=3, max_length=64, description="of its outline, one after the other around it"
    )
    colour: tuple[Share, Share, Share] = Field(description="red, green and blue, 0 to 1")


class Outline(Payload):
    """An arena seen from above, to draw what happens in it."""

    title: Title
    floor: tuple[Share, Share, Share] = Field(description="red, green and blue, 0 to 1")
    solids: Annotated[list[Solid], FailFast()] = Field(max_length=MOST_SOLIDS)
    start: Pose
    robot_radius: float = Field(gt=0.0, le=1.0, description="metres")
    robot_kind: Name = Field(
        default=USUAL_ROBOT, description="kind of the robot: khepera, epuck or another program's"
    )
    robot_model: Name = Field(default="", description="its model; empty: unknown")
    things: Count = Field(
        default=0, description="the last so many solids can be pushed; numbers begin at the first"
    )
    world: Name = Field(
        default="", description="the same for all robots of one world; empty: unknown"
    )


class WireEntry(Payload):
    """An event on a serial line, as in a wire log."""

    time: Time = Field(description="seconds of simulated time")
    what: Name = Field(description="request, reply, close, line or fault")
    text: Text = Field(
        description="a request's or reply's bytes as the characters U+0000 to U+00FF; settings of"
        " the line, such as 9600 8N2; what the fault did"
    )


class Wire(Payload):
    """The latest entries of a robot's serial line."""

    first: Count = Field(description="number of the first entry; a gap: entries were lost")
    entries: Annotated[list[WireEntry], FailFast()] = Field(max_length=4096)
    robot_kind: Name = Field(default=USUAL_ROBOT, description="kind of the robot on the line")
    dialect: Name = Field(
        default="", description="which of its kind's ways of speaking it has; empty: the only one"
    )


class Stop(Payload):
    """The wish to end a run, said so that no mere look at a key can be taken for it."""

    stop: Literal[True] = Field(description="always true")


class CameraQuery(Payload):
    """The picture that a query on the camera key asks for."""

    view: str = Field(default="mirror", pattern="^(mirror|panorama)$")
    encoding: str = Field(default="png", pattern="^(png|jpeg)$")
