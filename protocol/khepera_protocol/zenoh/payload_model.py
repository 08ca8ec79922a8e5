"""The model of a JSON payload: immutable, bounded, and read from a text by one function.

Whatever comes over Zenoh is foreign. Every number is finite and bounded, every text and list has a
greatest length, and `Payload.parse` is the one way in: it returns a value or raises PayloadError.
"""

from typing import Annotated, Final, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    ValidationError,
    WithJsonSchema,
)

from khepera_protocol.validation import first_fault

MOST_JSON: Final = 4_000_000
"""Bytes of the longest JSON payload that is parsed."""

MOST_PICTURE: Final = 8_000_000
"""Bytes of the largest encoded picture that is taken."""

MOST_STAMP: Final = 1_000
"""Bytes of the longest attachment that is parsed."""

MOST_NAME: Final = 64
MOST_TITLE: Final = 200
MOST_TEXT: Final = 4_096
"""Characters of a name, of a title, and of any other text."""

Real = Annotated[float, Field(ge=-1e9, le=1e9)]
"""Anything measured or computed: no robot comes near the bounds, and sums of it stay finite."""

Amount = Annotated[float, Field(ge=0.0, le=1e9)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]

Time = Annotated[float, Field(ge=0.0, le=1e10)]
"""Seconds, to the year 2286; as nanoseconds they fit into 64 bits."""

Integer = Annotated[int, Field(ge=-(2**53) + 1, le=2**53 - 1)]
"""An integer that every reader of JSON can hold."""

Count = Annotated[int, Field(ge=0, le=2**53 - 1)]
Number = Annotated[int, Field(ge=0, le=2**32 - 1)]
"""Number of a sample; recordings keep 32 bits of it."""

Name = Annotated[str, Field(max_length=MOST_NAME)]
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
    """A payload that is not what its key promises; the message says why, fit for a terminal."""


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
