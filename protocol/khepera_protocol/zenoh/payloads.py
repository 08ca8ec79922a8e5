"""Keys and payloads that travel over Zenoh beside the serial line.

The emulator offers `khepera/<robot>/{camera,truth,reset,arena,wire,alive}`, the controller
`macor/<robot>/{frame,decision,map,state,link,alive}`; `khepera_protocol.zenoh.keys` lists them.
A sample carries its sequence number and the time it was taken at as an attachment, so that any
payload (a JPEG, a JSON text) can be placed.

Whatever comes over Zenoh is foreign. Every number is finite and bounded, every text and list has a
greatest length, and `Payload.parse` is the one way in: it returns a value or raises PayloadError.
"""

from typing import Annotated, Final, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    PlainSerializer,
    ValidationError,
    WithJsonSchema,
)

from khepera_protocol.validation import first_fault

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
"""Where the emulator listens for Zenoh peers: on this machine only."""

CONTROLLER_ENDPOINT = "tcp/127.0.0.1:7448"
"""Where the controller listens for Zenoh peers: on this machine only."""


MOST_JSON: Final = 4_000_000
"""Bytes of the longest JSON payload that is parsed."""

MOST_PICTURE: Final = 8_000_000
"""Bytes of the largest encoded picture that is taken."""

MOST_STAMP: Final = 1_000
"""Bytes of the longest attachment that is parsed."""

MOST_SOLIDS: Final = 2_000
"""Solids of an outline."""

MOST_TITLE: Final = 200
MOST_TEXT: Final = 4_096
"""Characters of a title, and of any other text."""

Real = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Anything measured or computed: no robot comes near the bounds, and sums of it stay finite."""

Amount = Annotated[float, Field(ge=0.0, le=1e9)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

Time = Annotated[float, Field(ge=0.0, le=1e10)]
"""Seconds, to the year 2286; as nanoseconds they fit into 64 bits."""

Integer = Annotated[int, Field(ge=-(2**53) + 1, le=2**53 - 1)]
"""What every reader of JSON can hold."""

Count = Annotated[int, Field(ge=0, le=2**53 - 1)]
Number = Annotated[int, Field(ge=0, le=2**32 - 1)]
"""Number of a sample; recordings keep 32 bits of it."""

Name = Annotated[str, Field(max_length=64)]
Title = Annotated[str, Field(max_length=MOST_TITLE)]
Text = Annotated[str, Field(max_length=MOST_TEXT)]


def _pair(value: object) -> object:
    """Take `{"x": 1.0, "y": 2.0}` for `(1.0, 2.0)`."""
    if isinstance(value, dict) and value.keys() == {"x", "y"}:
        return value["x"], value["y"]
    return value


# an object in JSON: viewers of recordings know no lists of lists
Point = Annotated[
    tuple[Real, Real],
    BeforeValidator(_pair),
    PlainSerializer(lambda pair: {"x": pair[0], "y": pair[1]}, when_used="json"),
    WithJsonSchema(
        {
            "type": "object",
            "properties": {
                "x": {"type": "number", "description": "metres", "minimum": -1e9, "maximum": 1e9},
                "y": {"type": "number", "description": "metres", "minimum": -1e9, "maximum": 1e9},
            },
            "required": ["x", "y"],
            "additionalProperties": False,
        }
    ),
]


class PayloadError(ValueError):
    """What came is not what its key promises; the message says why, fit for a terminal."""


class Payload(BaseModel):
    """Base of every JSON payload: immutable, bounded, and strict about unknown names."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __deepcopy__(self, _: object = None) -> Self:
        return self  # nobody can tell a copy of what never changes

    @classmethod
    def parse(cls, data: bytes, limit: int = MOST_JSON) -> Self:
        """Return the payload of a JSON text.

        Args:
            data: the text, of anyone's making.
            limit: greatest number of bytes.

        Raises:
            PayloadError: it is too long, not JSON, or outside the bounds of a field.
        """
        if len(data) > limit:
            raise PayloadError(f"it has {len(data):,} bytes, {limit:,} at most are read")
        try:
            return cls.model_validate_json(data)
        except ValidationError as error:
            raise PayloadError(first_fault(error)) from None


class Stamp(Payload):
    """Attachment of every sample."""

    sequence: Number = Field(description="counts samples of this key from 0")
    time: Time = Field(description="seconds on the robot's clock; wall clock for a real robot")


class Pose(Payload):
    """Where a robot is: x forward at heading 0, y to its left, counter-clockwise positive."""

    x: Real = Field(description="metres")
    y: Real = Field(description="metres")
    heading: Real = Field(description="radians")


class WheelDrift(Payload):
    """What the encoders do not see, as drawn for one emulated robot."""

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


class Reset(Payload):
    """Put an emulated robot somewhere, powered on afresh. Nothing given: its start pose."""

    pose: Pose | None = Field(default=None, description="where to; absent: see random")
    random: bool = Field(default=False, description="a free place drawn from the robot's seed")
    seed: int | None = Field(
        default=None, ge=0, le=2**63 - 1, description="start all chance anew from this seed"
    )


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


class WireEntry(Payload):
    """Something that happened on a serial line, as in a wire log."""

    time: Time = Field(description="seconds of simulated time")
    what: Name = Field(description="request, reply, close, line or fault")
    text: Text = Field(
        description="a request's or reply's bytes as the characters U+0000 to U+00FF; settings of"
        " the line, such as 9600 8N2; what the fault did"
    )


class Wire(Payload):
    """What passed on a robot's serial line of late."""

    first: Count = Field(description="number of the first entry; a gap: entries were lost")
    entries: Annotated[list[WireEntry], FailFast()] = Field(max_length=4096)


class Stop(Payload):
    """The wish to end a run, said so that no mere look at a key can be taken for it."""

    stop: Literal[True] = Field(description="always true")


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
