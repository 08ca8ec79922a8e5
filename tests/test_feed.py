"""Feeds: they take all samples of their robot, and nothing without bounds."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any, cast

import pytest
import zenoh
from as_type import as_type, not_none
from controller_helpers import PATIENCE, a_decision, a_state, free_endpoint, wait_until_watched
from khepera_protocol.zenoh.payload_model import MOST_JSON
from khepera_protocol.zenoh.payloads import Stamp
from watching_helpers import a_life

from macor_hil.monitor.follower import Follower
from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.feed import Arrival, Event, Feed, Loss, NotTaken, Presence, Refusal
from macor_hil.telemetry.inbox import Inbox
from macor_hil.telemetry.recordings.player import Player, play
from macor_hil.telemetry.recordings.playing_times import in_playing_time
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.steady_clock import SteadyClock

STATE = "macor/khepera/state"
TEXT = a_state().model_dump_json()


@contextmanager
def followed() -> Iterator[tuple[Feed, zenoh.Session]]:
    """A feed, and a session of somebody who publishes to it."""
    endpoint = free_endpoint()
    with (
        open_session([endpoint], []) as session,
        Feed(session, "khepera") as feed,
        open_session([], [endpoint]) as other,
    ):
        wait_until_watched(other, STATE)
        yield feed, other


NOTHING_DROPPED = zenoh.CongestionControl.BLOCK
"""A sample as large as these is dropped where a busy machine takes it too slowly."""


def until_state(feed: Feed, other: zenoh.Session) -> list[Arrival | Presence | Refusal | Loss]:
    """All that is heard before a good state, which comes last."""
    stamp = Stamp(sequence=0, time=1.0).model_dump_json()
    other.put(STATE, TEXT, attachment=stamp, congestion_control=NOTHING_DROPPED)
    heard: list[Arrival | Presence | Refusal | Loss] = []
    while not (isinstance(event := feed.get(PATIENCE), Arrival) and event.leaf == "state"):
        assert event is not None
        heard.append(event)
    return heard


def test_samples_for_many_keys_are_refused_and_counted() -> None:
    with followed() as (feed, other):
        for key in ("**", "macor/**", "macor/*/state", "macor/khepera/*", "*/khepera/state"):
            other.put(key, TEXT)
        heard = until_state(feed, other)
    assert heard
    assert all(isinstance(event, Refusal) for event in heard)
    refused = [as_type(Refusal, event) for event in heard]
    assert {e.reason for e in refused if e.leaf == "state"} == {
        f"it came for {key}, not for one key"
        for key in ("**", "macor/**", "macor/*/state", "macor/khepera/*", "*/khepera/state")
    }


def test_tokens_of_many_robots_are_nobody() -> None:
    with followed() as (feed, other):
        tokens = [
            other.liveliness().declare_token(key)
            for key in ("**/alive", "*/khepera/alive", "macor/*/alive")
        ]
        # the first two are also those of emulators
        assert {type(feed.get(PATIENCE)) for _ in range(5)} == {Refusal}
        for token in tokens:
            token.undeclare()


@pytest.mark.parametrize(
    ("sample", "reason"),
    [
        ({"payload": bytes(MOST_JSON + 1)}, "4,000,001 bytes"),
        ({"payload": TEXT, "attachment": "7"}, "its stamp cannot be read"),
        ({"payload": TEXT, "attachment": b"\xff" * 5000}, "its stamp cannot be read: it has 5,000"),
        (
            {"payload": TEXT, "attachment": '{"sequence": 1099511627776, "time": 0}'},
            "sequence should be",
        ),
        ({"payload": TEXT, "attachment": '{"sequence": 1, "time": 1e300}'}, "time should be"),
        ({"payload": TEXT, "attachment": '{"sequence": 1, "time": NaN}'}, "its stamp"),
        ({"payload": TEXT, "encoding": "x" * 240}, "its encoding has no end"),
    ],
)
def test_samples_out_of_bounds_are_refused_with_a_reason(
    sample: dict[str, Any], reason: str
) -> None:
    with followed() as (feed, other):
        other.put(STATE, **sample, congestion_control=NOTHING_DROPPED)
        (refusal,) = until_state(feed, other)
    assert isinstance(refusal, Refusal)
    assert reason in refusal.reason
    watched = RobotState("khepera")
    watched.take(refusal)
    assert watched.not_taken.words() == f"1 refused; the last one of state: {refusal.reason}"


def test_a_sample_that_is_deleted_is_refused_by_who_reads_it() -> None:
    with followed() as (feed, other):
        other.delete(STATE)
        arrival = feed.get(PATIENCE)
    watched = RobotState("khepera")
    assert arrival is not None
    watched.take(arrival)
    assert watched.not_taken.refused == 1


def test_a_time_stamp_of_the_far_future_makes_nothing_old() -> None:
    with followed() as (feed, other):
        now = other.new_timestamp()
        future = zenoh.Timestamp(now.get_time() + timedelta(days=9999), now.get_id())
        other.put(STATE, TEXT, timestamp=future)
        assert isinstance(feed.get(PATIENCE), Arrival)
        other.put(STATE, TEXT, timestamp=now)
        assert isinstance(feed.get(PATIENCE), Arrival)


COMES_AND_GOES = """
import sys, cv2, numpy
from macor_hil.hardware.cameras import Frame
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.session import open_session
noise = numpy.random.default_rng(1).integers(0, 256, (100, 100, 3)).astype(numpy.uint8)
with open_session([], [sys.argv[1]]) as session, Publisher(session, "khepera") as publisher:
    for line in sys.stdin:
        publisher.frame(Frame(noise, 0.0, 0))
"""


def test_a_watcher_keeps_no_descriptor_of_controllers_that_have_gone() -> None:
    endpoint, open_files = free_endpoint(), []
    with open_session([endpoint], []) as session, Follower(session, "khepera") as watcher:
        for _ in range(4):
            command = [sys.executable, "-c", COMES_AND_GOES, endpoint]
            with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as controller:
                watcher.watched.frame = b""
                while not watcher.watched.frame:  # more than what Zenoh would share memory for
                    not_none(controller.stdin).write("frame\n")
                    not_none(controller.stdin).flush()
                    watcher.follow(0.1)
                not_none(controller.stdin).close()
            watcher.follow(PATIENCE, until=lambda: not watcher.watched.controlled.alive)
            open_files.append(len(list(Path("/proc/self/fd").iterdir())))
    assert len(watcher.watched.frame) > 3072
    assert open_files[-1] <= open_files[1]


def test_a_sender_faster_than_who_takes_loses_the_oldest_and_that_is_told() -> None:
    inbox: Inbox[int | str] = Inbox(items=10, size=1000)
    for number in range(25):
        inbox.put(number, 10)
    assert inbox.take_losses() == 15
    assert [inbox.get(0.0) for _ in range(10)] == list(range(15, 25))
    inbox.put("small", 1)
    inbox.put("large", 1000)
    assert (inbox.take_losses(), inbox.get(0.0), inbox.get(0.0)) == (1, "large", None)
    assert inbox.take_losses() == 0


def test_samples_do_not_crowd_out_notices_and_all_keep_their_order() -> None:
    inbox: Inbox[int | str] = Inbox(items=3)
    inbox.notify("comes")
    for number in range(5):
        inbox.put(number, 1)
    inbox.notify("goes")
    inbox.put(5, 1)
    assert [inbox.get(0.0) for _ in range(6)] == ["comes", 3, 4, "goes", 5, None]


def test_notices_have_a_bound_too() -> None:
    inbox: Inbox[int] = Inbox()
    for number in range(5000):
        inbox.notify(number)
    assert inbox.get(0.0) == 4000


def test_what_is_lost_reaches_watchers() -> None:
    with followed() as (feed, other):
        feed._inbox._most_items = 5
        for sequence in range(50):
            other.put(STATE, TEXT, attachment=Stamp(sequence=sequence, time=0.0).model_dump_json())
        wait_for_bytes(feed)
        watched, losses = RobotState("khepera"), 0
        while (event := feed.get(0.5)) is not None:
            losses += event.count if isinstance(event, Loss) else 0
            watched.take(event)
    assert watched.not_taken.lost == losses > 0
    assert watched.not_taken.words() == f"{losses} lost, they came too fast"


def wait_for_bytes(feed: Feed) -> None:
    end = time.monotonic() + PATIENCE
    while not feed._inbox._lost:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_what_is_not_taken_is_told_in_words() -> None:
    counts = NotTaken()
    assert counts.words() == ""
    counts.count(Refusal("decision", "\x1b[31mred", 0))
    counts.count(Loss(7, 0))
    assert counts.words() == (
        r"1 refused, 7 lost, they came too fast; the last one of decision: \x1b[31mred"
    )


def test_a_clock_that_is_set_moves_no_times(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SteadyClock()
    before = clock()
    assert abs(before - time.time_ns()) < 1e9
    real = time.time_ns
    for hours in (-9000, 9000):
        monkeypatch.setattr(time, "time_ns", lambda hours=hours: real() + hours * 3600 * 10**9)
        assert 0 <= clock() - before < 60e9
        assert 0.0 <= clock.seconds() - before * 1e-9 < 60.0


def shifted(events: list[Event], first: int, hours: int) -> list[Event]:
    """Events of a recording made while the wall clock was set, by a recorder that believed it."""
    step = hours * 3600 * 1_000_000_000
    return [
        Presence(e.side, e.alive, e.received + step)
        if isinstance(e, Presence)
        else Arrival(e.side, e.leaf, e.data, e.encoding, e.stamp, e.received + step, e.live)
        if k >= first
        else e
        for k, e in enumerate(events)
    ]


@pytest.mark.parametrize("hours", [-8760, -1, 1, 8760])
def test_a_recording_made_while_the_clock_was_set_plays(hours: int) -> None:
    events = a_life(2)
    odd = [*events[:6], *shifted(events[6:], 0, hours)]
    slept: list[float] = []
    shown: list[Event] = []

    class Shown:
        def publish(self, event: Event) -> None:
            shown.append(event)

    play(odd, cast(Player, Shown()), clock=lambda: sum(slept), sleep=slept.append)
    assert len(shown) == len(odd)
    assert sum(slept) == pytest.approx(3.0 if hours < 0 else 62.9, abs=0.2)
    times = [event.received for event in shown]
    assert times == sorted(times)


def test_a_recording_with_good_times_is_played_as_it_is() -> None:
    events = a_life(3)
    assert list(in_playing_time(events)) == events
    assert not list(in_playing_time([]))


def test_all_that_keeps_to_the_bounds_is_taken() -> None:
    with followed() as (feed, other):
        watched = RobotState("khepera")
        for sequence in range(3):
            other.put("macor/khepera/decision", a_decision(sequence).model_dump_json())
            heard = feed.get(PATIENCE)
            assert heard is not None
            watched.take(heard)
    assert [decision.sequence for decision in watched.controlled.history] == [0, 1, 2]
    assert not watched.not_taken.words()
