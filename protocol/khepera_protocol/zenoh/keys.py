"""The Zenoh keys of both ends as a table: what is said on each, in which form, and when."""

from dataclasses import dataclass
from typing import Final

from khepera_protocol.zenoh.payloads import CameraQuery, Outline, Payload, Reset, Truth, Wire

DESCRIBE: Final = "describe"
"""Selector parameter that asks a JSON key for its schema: `macor/<robot>/decision?describe`."""

SCHEMA_MEDIA_TYPE: Final = "application/schema+json"
"""Encoding of the answer to a `describe` query."""

EMULATOR: Final = "khepera"
CONTROLLER: Final = "macor"


@dataclass(frozen=True, slots=True)
class Key:
    """A key under `<side>/<robot>/`.

    Attributes:
        side: EMULATOR or CONTROLLER, the first part of the key.
        leaf: its last part.
        what: what it tells, a sentence.
        payload: model of its JSON, or None for pictures and liveliness tokens.
        encodings: media types of its samples.
        published: when samples are published; empty: never, it answers queries alone.
        answers: what a query gets; empty: nothing.
        request: model of a query's JSON payload, where it takes one.
        acts: whether a query does something. Such a key answers only to queries on exactly this
            key, not to wildcards, and only with a payload: to look around has no effects.
    """

    side: str
    leaf: str
    what: str
    payload: type[Payload] | None = None
    encodings: tuple[str, ...] = ()
    published: str = ""
    answers: str = ""
    request: type[Payload] | None = None
    acts: bool = False

    @property
    def pattern(self) -> str:
        """The key with `<robot>` for the robot's name."""
        return f"{self.side}/<robot>/{self.leaf}"


def json_key(
    side: str,
    leaf: str,
    what: str,
    payload: type[Payload],
    published: str,
    answers: str,
    request: type[Payload] | None = None,
    *,
    acts: bool = False,
) -> Key:
    """A key of JSON samples."""
    encoding = f"application/json;{schema_name(side, payload)}"
    return Key(side, leaf, what, payload, (encoding,), published, answers, request, acts)


def schema_name(side: str, payload: type[Payload]) -> str:
    """Name of a payload's schema in encodings, such as `macor.Decision`."""
    return f"{side}.{payload.__name__}"


EMULATOR_KEYS: Final = (
    Key(
        EMULATOR,
        "camera",
        "What the robot's camera sees.",
        None,
        ("image/jpeg", "image/png"),
        "10 times a second as JPEG, while someone listens",
        "a picture of this moment, as the query's payload asks for",
        CameraQuery,
    ),
    json_key(
        EMULATOR,
        "truth",
        "Where the robot really is.",
        Truth,
        "10 times a second, while someone listens",
        "the truth of this moment",
    ),
    json_key(
        EMULATOR,
        "reset",
        "Puts the robot somewhere, powered on afresh.",
        Truth,
        "",
        "the truth after the reset",
        Reset,
        acts=True,
    ),
    json_key(EMULATOR, "arena", "The arena from above.", Outline, "", "the arena as it is now"),
    json_key(
        EMULATOR,
        "wire",
        "The bytes on the serial line, both ways.",
        Wire,
        "10 times a second, while someone listens and something passes",
        "the latest entries",
    ),
    Key(EMULATOR, "alive", "Liveliness token: there while the robot is switched on."),
)
