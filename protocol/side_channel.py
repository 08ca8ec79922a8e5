"""Keys and payloads that travel over Zenoh beside the serial line.

The emulator offers `khepera/<robot>/{camera,truth,reset,arena,wire,alive}`, the controller
`macor/<robot>/{frame,decision,map,state,link,alive}`; `protocol.keys` lists them. A sample
carries its sequence number and the time it was taken at as an attachment, so that any payload (a
JPEG, a JSON text) can be placed.
"""

from pydantic import BaseModel, ConfigDict, Field

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where the emulator listens for Zenoh peers: on this machine only."""

CONTROLLER_ENDPOINT = "tcp/127.0.0.1:7448"
"""Where the controller listens for Zenoh peers: on this machine only."""


class Payload(BaseModel):
    """Base of every JSON payload: immutable, and strict about unknown names."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Stamp(Payload):
    """Attachment of every sample."""

    sequence: int = Field(ge=0, description="counts samples of this key from 0")
    time: float = Field(description="seconds on the robot's clock; wall clock for a real robot")


class Pose(Payload):
    """Where a robot is: x forward at heading 0, y to its left, counter-clockwise positive."""

    x: float = Field(description="metres")
    y: float = Field(description="metres")
    heading: float = Field(description="radians")


class WheelDrift(Payload):
    """What the encoders do not see, as drawn for one emulated robot."""

    left_scale: float = Field(description="true way of the left wheel over the counted way")
    right_scale: float = Field(description="true way of the right wheel over the counted way")
    wheel_base: float = Field(description="true wheel base, metres")
    slip: float = Field(description="standard deviation of the way of one control period, relative")


class Truth(Payload):
    """Ground truth of an emulated robot: for scoring and set-up, never for control."""

    time: float = Field(description="seconds of simulated time")
    pose: Pose
    speed: tuple[float, float] = Field(description="left and right wheel over ground, m/s")
    contact: bool = Field(description="whether the body touches something now")
    touched: bool = Field(description="whether it has touched something since the last reset")
    drift: WheelDrift


class Reset(Payload):
    """Put an emulated robot somewhere, powered on afresh. Nothing given: its start pose."""

    pose: Pose | None = Field(default=None, description="where to; absent: see random")
    random: bool = Field(default=False, description="a free place drawn from the robot's seed")
    seed: int | None = Field(default=None, ge=0, description="start all chance anew from this seed")


class Solid(Payload):
    """Something upright in an arena, seen from above."""

    corners: list[tuple[float, float]] = Field(min_length=3, description="metres")
    colour: tuple[float, float, float] = Field(description="red, green and blue, 0 to 1")


class Outline(Payload):
    """An arena seen from above, to draw what happens in it."""

    title: str
    floor: tuple[float, float, float] = Field(description="red, green and blue, 0 to 1")
    solids: list[Solid]
    start: Pose
    robot_radius: float = Field(gt=0.0, description="metres")


class WireEntry(Payload):
    """Something that happened on a serial line, as in a wire log."""

    time: float = Field(description="seconds of simulated time")
    what: str = Field(description="request, reply, close, line or fault")
    text: str = Field(
        description="a request's or reply's bytes as the characters U+0000 to U+00FF; settings of"
        " the line, such as 9600 8N2; what the fault did"
    )


class Wire(Payload):
    """What passed on a robot's serial line of late."""

    first: int = Field(ge=0, description="number of the first entry; a gap: entries were lost")
    entries: list[WireEntry]


class CameraQuery(Payload):
    """What a query on the camera key asks for."""

    view: str = Field(default="mirror", pattern="^(mirror|panorama)$")
    encoding: str = Field(default="png", pattern="^(png|jpeg)$")


def robot_key(robot: str, leaf: str) -> str:
    """Key of the emulator for one of its robots."""
    return f"khepera/{robot}/{leaf}"


def controller_key(robot: str, leaf: str) -> str:
    """Key of the controller of a robot."""
    return f"macor/{robot}/{leaf}"
