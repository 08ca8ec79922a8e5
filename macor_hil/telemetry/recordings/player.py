"""Publishes a recording again, under its own keys and with its own times.

Whoever watches sees emulator and controller appear, drive and go as they did; queries get what was
the latest at that moment.
"""

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.keys import ALIVE, KEYS_BY_PLACE
from khepera_protocol.zenoh.sample import AnsweringPublisher, Content, Sample
from khepera_protocol.zenoh.sample_checks import LONGEST_ENCODING

from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.playing_times import in_playing_time
from macor_hil.telemetry.session import check_robot_name

_NS: Final = 1e-9


def play(
    events: Iterable[Event],
    player: "Player",
    speed: float = 1.0,
    *,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> int:
    """Publish events at the distances that they have (see `in_playing_time`); return their number.

    Args:
        events: what was recorded, in its order; taken one by one.
        player: where to.
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
        player.publish(event)
        count += 1
    return count


class Player:
    """A publisher of recorded events in the place of emulator and controller; use as a context.

    Args:
        session: an open session, which stays its owner's.
        robot: the robot's name in the keys.

    Attributes:
        published: how many events have happened.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(self, session: zenoh.Session, robot: str) -> None:
        check_robot_name(robot)
        self.published = 0
        self._session = session
        self._robot = robot
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        with ExitStack() as stack:
            self._keys = {
                place: AnsweringPublisher(session, key, robot)
                for place, key in KEYS_BY_PLACE.items()
                if (key.published or key.payload) and not key.acts  # nothing can be done to it
            }
            for key_publisher in self._keys.values():
                stack.callback(key_publisher.close)
            stack.callback(self._go)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def publish(self, event: Event) -> None:
        """Publish an event now."""
        self.published += 1
        if isinstance(event, Presence):
            self._appear(event)
            return
        key = self._keys.get((event.side, event.leaf))
        if key is not None:  # nobody has published on the others
            stamp = event.stamp.model_dump_json() if event.stamp else None
            content = Content(event.data, _encoding(event))
            key.put(Sample(content, stamp, self._session.new_timestamp()))

    def _appear(self, presence: Presence) -> None:
        token = self._tokens.pop(presence.side, None)
        if token is not None:
            token.undeclare()
        if presence.alive:
            for (side, _), key in self._keys.items():
                if side == presence.side:
                    key.forget()
            alive = ALIVE[presence.side].of(self._robot)
            self._tokens[presence.side] = self._session.liveliness().declare_token(alive)

    def _go(self) -> None:
        for token in self._tokens.values():
            token.undeclare()
        self._tokens.clear()


def _encoding(arrival: Arrival) -> zenoh.Encoding:
    """Return the encoding of a sample, which Zenoh cannot send if it is long."""
    return zenoh.Encoding(arrival.encoding.encode()[:LONGEST_ENCODING].decode(errors="ignore"))
