"""Short forms of what `make soak` does for long: the daemon outlives its clients' habits."""

from collections.abc import Iterator

import pytest
from soaking import PORTS, Place, Use, kill_clients, never_read, reopen, robot_at, take_fuzz

LEAK = 4096
"""Kilobytes that memory may grow by in a short run: a little warms up."""

SWING = 1
"""A client's end may be open still, or the terminal be held open again since it has left."""


@pytest.fixture(scope="module", params=PORTS)
def place(request: pytest.FixtureRequest) -> Iterator[Place]:
    with robot_at(request.param) as place:
        yield place


@pytest.fixture
def robot(place: Place) -> Place:
    if place.kind == "khepera":
        pytest.skip("its robot is switched off with the port")
    return place


def assert_flat(before: Use, after: Use) -> None:
    assert abs(after.files - before.files) <= SWING
    assert after.kilobytes < before.kilobytes + LEAK


def test_the_next_good_request_after_garbage_is_answered_at_once(place: Place) -> None:
    fuzzed = take_fuzz(place, 100_000)
    assert_flat(fuzzed.before, fuzzed.after)
    assert fuzzed.answer < 1.0


def test_reopening_leaves_nothing_behind(place: Place) -> None:
    assert_flat(reopen(place, 20), place.use())


def test_killed_clients_leave_nothing_to_the_next(robot: Place) -> None:
    before = robot.use()
    kill_clients(robot, 3)
    assert_flat(before, robot.use())


def test_a_client_that_never_reads_leaves_nothing_to_the_next(robot: Place) -> None:
    before = robot.use()
    never_read(robot, 10_000)
    assert_flat(before, robot.use())
