"""Publishes a recording again, under its own keys and with its own times.

Whoever watches sees emulator and controller appear, drive and go as they did; queries get what was
the latest at that moment.
"""

import json
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.keys import DESCRIBE, SCHEMA_MEDIA_TYPE
from khepera_protocol.zenoh.payloads import Payload
from khepera_protocol.zenoh.schema import schema_of

from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.keys import ALIVE, KEYS
from macor_hil.telemetry.recordings.playing_times import in_playing_time
from macor_hil.telemetry.samples import LONGEST_ENCODING
from macor_hil.telemetry.session import check_robot_name

_NS: Final = 1e-9


def replay(
    events: Iterable[Event],
    stage: "Stage",
    speed: float = 1.0,
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> int:
    """Publish events at the distances that they have (see `in_playing_time`); return their number.

    Args:
        events: what was recorded, in its order; taken one by one.
        stage: where to.
        speed: how many times faster.
        clock: seconds.
        sleep: waits for so many of them.
    """
    begin, first, count = clock(), 0, 0
    for event in in_playing_time(events):
        first = event.received if count == 0 else first
        due = begin + (event.received - first) * _NS / speed
        if (left := due - clock()) > 0.0:
            sleep(left)
        stage.show(event)
        count += 1
    return count


class Stage:
    """Publishes events as those whom they came from did; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.

    Attributes:
        shown: how many events have happened.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str) -> None:
        check_robot_name(robot)
        self.shown = 0
        self._session = session
        self._robot = robot
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        # replaced as a whole, for the library's thread that answers the queries
        self._latest: dict[str, tuple[Arrival, zenoh.Timestamp]] = {}
        with ExitStack() as stack:
            for key in KEYS:
                if key.published or key.payload:
                    name = f"{key.side}/{robot}/{key.leaf}"
                    answer = partial(self._answer, name, key.payload)
                    stack.enter_context(session.declare_queryable(name, answer))
            stack.callback(self._go)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def show(self, event: Event) -> None:
        """Let an event happen now."""
        self.shown += 1
        if isinstance(event, Presence):
            self._appear(event)
            return
        key = f"{event.side}/{self._robot}/{event.leaf}"
        timestamp = self._session.new_timestamp()
        self._latest = {**self._latest, key: (event, timestamp)}
        self._session.put(
            key,
            event.data,
            encoding=_encoding(event),
            attachment=_attachment(event),
            timestamp=timestamp,
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def _appear(self, presence: Presence) -> None:
        token = self._tokens.pop(presence.side, None)
        if token is not None:
            token.undeclare()
        if presence.alive:
            self._latest = {
                key: known
                for key, known in self._latest.items()
                if not key.startswith(f"{presence.side}/")
            }
            self._tokens[presence.side] = self._session.liveliness().declare_token(
                f"{presence.side}/{self._robot}/{ALIVE}"
            )

    def _go(self) -> None:
        for token in self._tokens.values():
            token.undeclare()
        self._tokens.clear()

    def _answer(self, key: str, payload: type[Payload] | None, query: zenoh.Query) -> None:
        with query:
            if payload and DESCRIBE in query.parameters:
                schema = json.dumps(schema_of(payload))
                query.reply(key, schema, encoding=zenoh.Encoding(SCHEMA_MEDIA_TYPE))
            elif known := self._latest.get(key):
                arrival, timestamp = known
                query.reply(
                    key,
                    arrival.data,
                    encoding=_encoding(arrival),
                    attachment=_attachment(arrival),
                    timestamp=timestamp,
                )
            else:
                query.reply_err("nothing yet", encoding=zenoh.Encoding.TEXT_PLAIN)


def _encoding(arrival: Arrival) -> zenoh.Encoding:
    """Return the encoding of a sample, which Zenoh cannot send if it is long."""
    return zenoh.Encoding(arrival.encoding.encode()[:LONGEST_ENCODING].decode(errors="ignore"))


def _attachment(arrival: Arrival) -> str | None:
    return arrival.stamp.model_dump_json() if arrival.stamp else None
