"""Helpers of the tests of service, telemetry and monitor."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from queue import SimpleQueue
from typing import Any, TypeVar, overload

import numpy as np
import zenoh
from emulator_process import PATIENCE, free_endpoint
from khepera_protocol.zenoh.controller_payloads import (
    Ahead,
    Alternative,
    Decision,
    Hypothesis,
    Odometry,
    Phase,
    Situation,
    State,
)
from khepera_protocol.zenoh.payloads import Pose

from macor_hil.hardware.cameras import Frame
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session

T = TypeVar("T")
Samples = SimpleQueue[zenoh.Sample]


def a_decision(sequence: int = 0, **changes: Any) -> Decision:
    values: dict[str, Any] = {
        "time": 1.5 + sequence,
        "sequence": sequence,
        "frame_time": 0.5 + sequence,
        "situation": Situation(node=17, neuron=53, resonant=True, match=0.9612),
        "alternatives": [
            Alternative(command="left", evaluation=2.125),
            Alternative(command="right", evaluation=None),
            Alternative(command="straight", evaluation=4.25),
        ],
        "command": "straight",
        "steps": 21,
        "hypotheses": [
            Hypothesis(
                evaluation=4.25,
                ahead=[Ahead(node=18, command="straight"), Ahead(node=4, command="left")],
            ),
            Hypothesis(evaluation=2.125, ahead=[Ahead(node=4, command="left")]),
        ],
        "activities": [0.0] * 53 + [1.0, 0.95, 0.9025],
        "features": [0.5] * 36,
        "sequence_ahead": [Ahead(node=18, command="straight"), Ahead(node=4, command="left")],
        "reinforcement": 0.7,
        "total_reinforcement": 0.7 * (sequence + 1),
        "collided": False,
        "infrared": [0, 12, 1023, 4, 5, 6, 7, 8],
        "odometry": Odometry(pose=Pose(x=0.021, y=-0.004, heading=0.1), counters=(262, 263)),
    }
    return Decision(**{**values, **changes})


def a_state(phase: Phase = Phase.DRIVING, **changes: Any) -> State:
    values: dict[str, Any] = {
        "planner": "anticipative",
        "port": "khepera://corridor",
        "camera": "auto",
        "map": "runs/corridor.npz",
        "driven": 3,
        "limit": 40,
    }
    return State(phase=phase, **{**values, **changes})


def a_frame(time: float = 0.25) -> Frame:
    return Frame(np.full((16, 16, 3), 128, dtype=np.uint8), time, 7)


@contextmanager
def publishing(endpoint: str, robot: str = "khepera") -> Iterator[tuple[zenoh.Session, Publisher]]:
    """A session that listens, and the publisher of a controller in it."""
    with open_session([endpoint], []) as session, Publisher(session, robot) as publisher:
        yield session, publisher


@overload
def watching(endpoint: str, /) -> AbstractContextManager[tuple[zenoh.Session]]: ...


@overload
def watching(
    endpoint: str, key: str, /
) -> AbstractContextManager[tuple[zenoh.Session, Samples]]: ...


@overload
def watching(
    endpoint: str, key: str, other: str, /
) -> AbstractContextManager[tuple[zenoh.Session, Samples, Samples]]: ...


@overload
def watching(
    endpoint: str, key: str, other: str, third: str, /
) -> AbstractContextManager[tuple[zenoh.Session, Samples, Samples, Samples]]: ...


def watching(endpoint: str, *keys: str) -> AbstractContextManager[Any]:
    """A session connected to an endpoint, and a queue of what comes on each key."""
    return _watching(endpoint, *keys)


@contextmanager
def _watching(endpoint: str, *keys: str) -> Iterator[tuple[zenoh.Session, *tuple[Samples, ...]]]:
    with open_session([], [endpoint]) as session:
        queues: list[Samples] = [SimpleQueue() for _ in keys]
        for key, queue in zip(keys, queues, strict=True):
            session.declare_subscriber(key, queue.put)
        yield session, *queues


def receive(queue: SimpleQueue[T]) -> T:
    """The next sample; an error when none comes."""
    return queue.get(timeout=PATIENCE)


def wait_until_watched(session: zenoh.Session, *keys: str) -> None:
    """Return when someone who will receive what this session puts listens on every key."""
    for key in keys:
        with session.declare_publisher(key) as probe:
            matches: SimpleQueue[zenoh.MatchingStatus] = SimpleQueue()
            probe.declare_matching_listener(matches.put)
            while not _matches(probe):
                matches.get(timeout=PATIENCE)


def _matches(probe: zenoh.Publisher) -> bool:
    status: Any = probe.matching_status  # not a bool, as the library's stubs have it
    return bool(status.matching)


def ask(session: zenoh.Session, selector: str, payload: str | bytes | None = None) -> zenoh.Reply:
    """The only reply to a query."""
    (reply,) = session.get(selector, payload=payload, timeout=PATIENCE)
    return reply


def ask_until(
    session: zenoh.Session, selector: str, holds: Callable[[zenoh.Sample], object]
) -> zenoh.Sample:
    """The only reply to a query, asked again until it holds what is on its way."""
    end = time.monotonic() + PATIENCE
    while True:
        sample = ask(session, selector).ok
        if sample and holds(sample):
            return sample
        assert time.monotonic() < end, f"{selector}: {sample and sample.payload.to_string()}"


__all__ = [
    "PATIENCE",
    "a_decision",
    "a_frame",
    "a_state",
    "ask",
    "ask_until",
    "free_endpoint",
    "publishing",
    "receive",
    "wait_until_watched",
    "watching",
]
