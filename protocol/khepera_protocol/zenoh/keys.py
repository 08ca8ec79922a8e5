"""The Zenoh keys of both sides as a table: content of each, its form, and when it is sent."""

from dataclasses import dataclass
from typing import Final

from khepera_protocol.zenoh.controller_payloads import Decision, Learned, Link, State, Steer
from khepera_protocol.zenoh.payload_model import MOST_JSON, MOST_PICTURE, Payload
from khepera_protocol.zenoh.payloads import (
    CameraQuery,
    FaultsOn,
    FaultSwitch,
    Outline,
    Push,
    Reset,
    Stop,
    Truth,
    Wire,
)

DESCRIBE: Final = "describe"
"""Selector parameter that asks a JSON key for its schema: `macor/<robot>/decision?describe`."""

SCHEMA_MEDIA_TYPE: Final = "application/schema+json"
"""Encoding of the answer to a `describe` query."""

EMULATOR: Final = "khepera"
CONTROLLER: Final = "macor"
"""The sides: first parts of all keys."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of one side, for every robot: `<side>/<robot>/<leaf>`.

    Attributes:
        side: EMULATOR or CONTROLLER, its first part.
        leaf: its last part.
        what: its content, a sentence.
        payload: model of its JSON, or None for pictures and liveliness tokens.
        media: media types of its samples, if they are not JSON.
        published: when samples are published; empty: never, it answers queries alone.
        answers: the answer to a query; empty: none.
        request: model of a query's JSON payload, where it takes one.
        acts: whether a query has effects. Such a key answers only to queries on exactly this
            key, not to wildcards, and only with a payload: to look around has no effects.
    """

    side: str
    leaf: str
    what: str
    payload: type[Payload] | None = None
    media: tuple[str, ...] = ()
    published: str = ""
    answers: str = ""
    request: type[Payload] | None = None
    acts: bool = False

    def of(self, robot: str) -> str:
        """Return the key of one robot."""
        return f"{self.side}/{robot}/{self.leaf}"

    @property
    def pattern(self) -> str:
        """The key with `<robot>` for the robot's name."""
        return self.of("<robot>")

    @property
    def limit(self) -> int:
        """Bytes of its longest sample that is taken."""
        return MOST_JSON if self.payload else MOST_PICTURE

    @property
    def encodings(self) -> tuple[str, ...]:
        """The encodings of its samples: for JSON with the name of the schema."""
        if self.payload is None:
            return self.media
        return (f"application/json;{schema_name(self.side, self.payload)}",)


def schema_name(side: str, payload: type[Payload]) -> str:
    """Return the name of a payload's schema in encodings, such as `macor.Decision`."""
    return f"{side}.{payload.__name__}"


CAMERA: Final = Key(
    side=EMULATOR,
    leaf="camera",
    what="Pictures of the robot's camera.",
    media=("image/jpeg", "image/png"),
    published="10 times a second as JPEG, while someone listens",
    answers="a picture of this moment, as the query's payload asks for",
    request=CameraQuery,
)
TRUTH: Final = Key(
    side=EMULATOR,
    leaf="truth",
    what="The robot's true pose and speed.",
    payload=Truth,
    published="10 times a second, while someone listens",
    answers="the truth of this moment",
)
RESET: Final = Key(
    side=EMULATOR,
    leaf="reset",
    what="Puts the robot in a place, powered on afresh.",
    payload=Truth,
    answers="the truth after the reset",
    request=Reset,
    acts=True,
)
ARENA: Final = Key(
    side=EMULATOR,
    leaf="arena",
    what="The arena from above.",
    payload=Outline,
    published="when a thing has moved, while someone listens",
    answers="the arena as it is now",
)
PUSH: Final = Key(
    side=EMULATOR,
    leaf="push",
    what="Puts a thing that robots can push somewhere else.",
    payload=Outline,
    answers="the arena with the thing in its new place",
    request=Push,
    acts=True,
)
FAULTS: Final = Key(
    side=EMULATOR,
    leaf="faults",
    what="Switches faults of the robot and its line on and off.",
    payload=FaultsOn,
    answers="the kinds of faults that are on afterwards",
    request=FaultSwitch,
    acts=True,
)
WIRE: Final = Key(
    side=EMULATOR,
    leaf="wire",
    what="The bytes on the serial line, both ways.",
    payload=Wire,
    published="10 times a second, while someone listens and something passes",
    answers="the latest entries",
)
EMULATOR_ALIVE: Final = Key(
    side=EMULATOR,
    leaf="alive",
    what="Liveliness token: there while the robot is switched on.",
)

FRAME: Final = Key(
    side=CONTROLLER,
    leaf="frame",
    what="The mirror image that is decided on.",
    media=("image/jpeg",),
    published="before every decision (training: 4 a second at most), while someone listens",
)
DECISION: Final = Key(
    side=CONTROLLER,
    leaf="decision",
    what="A decision and its outcome.",
    payload=Decision,
    published="when its command has been driven",
    answers="the latest decision",
)
MAP: Final = Key(
    side=CONTROLLER,
    leaf="map",
    what="The basis of the run: its map in numbers.",
    payload=Learned,
    published="when driving begins",
    answers="what was published last",
)
STATE: Final = Key(
    side=CONTROLLER,
    leaf="state",
    what="The state of the controller, and what it works with.",
    payload=State,
    published="with every change and every decision",
    answers="the latest state",
)
LINK: Final = Key(
    side=CONTROLLER,
    leaf="link",
    what="The health of the serial line to the robot.",
    payload=Link,
    published="after every command",
    answers="what was published last",
)
STOP: Final = Key(
    side=CONTROLLER,
    leaf="stop",
    what="Ends the run, where that was allowed with `--stop-key`: by a query, or by a sample.",
    media=("text/plain",),
    answers="`stopping`",
    request=Stop,
    acts=True,
)
STEER: Final = Key(
    side=CONTROLLER,
    leaf="steer",
    what="Pauses the run, or changes planner or goal, where that was allowed with `--steer-key`.",
    media=("text/plain",),
    answers="what is done, in words",
    request=Steer,
    acts=True,
)
CONTROLLER_ALIVE: Final = Key(
    side=CONTROLLER,
    leaf="alive",
    what="Liveliness token: there while the controller runs.",
)

EMULATOR_KEYS: Final = (CAMERA, TRUTH, RESET, ARENA, PUSH, FAULTS, WIRE, EMULATOR_ALIVE)
CONTROLLER_KEYS: Final = (FRAME, DECISION, MAP, STATE, LINK, STOP, STEER, CONTROLLER_ALIVE)

KEYS: Final = EMULATOR_KEYS + CONTROLLER_KEYS
"""All keys of a robot."""

ALIVE: Final = {EMULATOR: EMULATOR_ALIVE, CONTROLLER: CONTROLLER_ALIVE}
"""The key of a side's liveliness token."""

KEYS_BY_PLACE: Final = {(key.side, key.leaf): key for key in KEYS}
"""A key by its side and leaf."""

PAYLOADS: Final = {place: key.payload for place, key in KEYS_BY_PLACE.items() if key.payload}
"""The models of JSON keys, by side and leaf."""
