"""The controller's Zenoh keys as a table, and all keys together."""

from typing import Final

from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR_KEYS, Key, json_key
from khepera_protocol.zenoh.payloads import Stop

from macor_hil.telemetry.schemas import Decision, Learned, Link, State

FRAME: Final = "frame"
DECISION: Final = "decision"
MAP: Final = "map"
STATE: Final = "state"
LINK: Final = "link"
STOP: Final = "stop"
ALIVE: Final = "alive"

CONTROLLER_KEYS: Final = (
    Key(
        CONTROLLER,
        FRAME,
        "The mirror image that is decided on.",
        None,
        ("image/jpeg",),
        "before every decision, while someone listens",
    ),
    json_key(
        CONTROLLER,
        DECISION,
        "A decision and what came of it.",
        Decision,
        "when its command has been driven",
        "the latest decision",
    ),
    json_key(
        CONTROLLER,
        MAP,
        "What the run drives by.",
        Learned,
        "when driving begins",
        "what was published last",
    ),
    json_key(
        CONTROLLER,
        STATE,
        "What the controller is doing, with what.",
        State,
        "with every change and every decision",
        "the latest state",
    ),
    json_key(
        CONTROLLER,
        LINK,
        "How the serial line to the robot does.",
        Link,
        "after every command",
        "what was published last",
    ),
    Key(
        CONTROLLER,
        STOP,
        "Ends the run, where that was allowed with `--stop-key`: by a query, or by a sample.",
        None,
        ("text/plain",),
        "",
        "`stopping`",
        Stop,
        acts=True,
    ),
    Key(CONTROLLER, ALIVE, "Liveliness token: there while the controller runs."),
)

KEYS: Final = EMULATOR_KEYS + CONTROLLER_KEYS
"""All keys of a robot: the emulator's, then the controller's."""

PAYLOADS: Final = {(key.side, key.leaf): key.payload for key in KEYS if key.payload}
"""What travels as JSON, by side and leaf."""
