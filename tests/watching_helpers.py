"""A short life of a robot as events, for the tests of those who watch."""

import cv2
import numpy as np
from controller_helpers import a_decision, a_state
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import (
    Ahead,
    Fields,
    Hypothesis,
    Learned,
    Link,
)
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR, schema_name
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Outline, Pose, Stamp, Truth, Wire

from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Arrival, Event, Presence

SECOND = 1_000_000_000
BEGIN = 1_700_000_000 * SECOND


def a_picture(seed: int = 0) -> bytes:
    """A picture of noise: larger than a chunk of a recording."""
    mirror = Mirror()
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (mirror.height, mirror.width, 3), dtype=np.uint8)
    return cv2.imencode(".jpg", image)[1].tobytes()


def json_event(
    side: str, leaf: str, payload: Payload, seconds: float, sequence: int = 0
) -> Arrival:
    return Arrival(
        side,
        leaf,
        payload.model_dump_json().encode(),
        f"application/json;{schema_name(side, type(payload))}",
        Stamp(sequence=sequence, time=round(seconds, 6)),
        BEGIN + round(seconds * SECOND),
    )


def picture_event(
    seconds: float,
    sequence: int = 0,
    seed: int = 0,
    side: str = CONTROLLER,
    leaf: str = "frame",
) -> Arrival:
    stamp = Stamp(sequence=sequence, time=round(seconds, 6))
    received = BEGIN + round(seconds * SECOND)
    return Arrival(side, leaf, a_picture(seed), "image/jpeg", stamp, received)


def truth(time: float, x: float, y: float = 0.0, heading: float = 0.0) -> Truth:
    example = EXAMPLES[Truth]
    assert isinstance(example, Truth)
    return example.model_copy(update={"time": time, "pose": Pose(x=x, y=y, heading=heading)})


def learned(situations: int = 50) -> Learned:
    example = EXAMPLES[Learned]
    assert isinstance(example, Learned)
    fields = Fields(sectors=12, width=0.26, channels=example.fields.channels)
    return example.model_copy(update={"situations": situations, "fields": fields})


def hypothesis(evaluation: float, *commands: str) -> Hypothesis:
    ahead = [Ahead(node=7, command=command) for command in commands]
    return Hypothesis(evaluation=evaluation, ahead=ahead)


def a_life(decisions: int = 3) -> list[Event]:
    """Emulator and controller appear, drive some commands, a second each, and go."""

    events: list[Event] = [
        Presence(EMULATOR, True, BEGIN),
        json_event(EMULATOR, "arena", EXAMPLES[Outline], 0.1),
        json_event(EMULATOR, "truth", truth(0.2, 0.1), 0.2),
        json_event(EMULATOR, "wire", EXAMPLES[Wire], 0.25),
        Presence(CONTROLLER, True, BEGIN + SECOND // 2),
        json_event(CONTROLLER, "map", learned(), 0.6),
        json_event(CONTROLLER, "state", a_state(driven=0), 0.7),
    ]
    for k in range(decisions):
        start = 1.0 + k
        events += [
            picture_event(start, k, seed=k),
            json_event(EMULATOR, "truth", truth(start + 0.5, 0.1 + 0.02 * (k + 1)), start + 0.5, k),
            json_event(
                CONTROLLER, "decision", a_decision(k, frame_time=start), start + 0.8, sequence=k
            ),
            json_event(CONTROLLER, "link", EXAMPLES[Link], start + 0.81, sequence=k),
            json_event(CONTROLLER, "state", a_state(driven=k + 1), start + 0.82, sequence=k + 1),
        ]
    end = BEGIN + round((1.0 + decisions) * SECOND)
    return [*events, Presence(CONTROLLER, False, end), Presence(EMULATOR, False, end)]
