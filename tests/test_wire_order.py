"""Order on a line: entries are told in the order of their times."""

from hypothesis import given
from hypothesis import strategies as st

from khepera_emulator.line.coding import LineFormat
from khepera_emulator.line.fault import Direction, Happening
from khepera_emulator.line.wire_order import InOrder
from khepera_emulator.line.wire_tap import WireTap


def told(tap: WireTap) -> list[tuple[float, str, str]]:
    return [(entry.time, entry.what, entry.text) for entry in tap.since(0).entries]


def test_a_reply_that_had_arrived_before_a_request_comes_before_it() -> None:
    tap = WireTap()
    order = InOrder(tap)
    order.request(1.0, b"N\n")
    order.pass_on(1.0)
    order.request(2.0, b"O\n")  # written while the reply lies ready
    order.reply(1.5, b"n\r\n")
    order.pass_on(2.0)
    assert told(tap) == [
        (1.0, "request", "N\n"),
        (1.5, "reply", "n\r\n"),
        (2.0, "request", "O\n"),
    ]


def test_what_happens_at_once_stays_in_its_order() -> None:
    tap = WireTap()
    order = InOrder(tap)
    order.line(1.0, LineFormat(9600))
    order.request(1.0, b"N\n")
    order.close(1.0)
    order.request(1.0, b"O\n")
    order.reply(1.0, b"o\r\n")
    order.pass_on(1.0)
    assert [what for _, what, _ in told(tap)] == ["line", "request", "close", "request", "reply"]


def test_a_fault_ahead_waits_for_its_time_or_the_end() -> None:
    tap = WireTap()
    order = InOrder(tap)
    order.fault(Happening(5.0, Direction.REPLY, "delay", "late"))
    order.request(1.0, b"N\n")
    order.pass_on(4.0)
    assert [what for _, what, _ in told(tap)] == ["request"]
    order.pass_on()
    assert [what for _, what, _ in told(tap)] == ["request", "fault"]


@given(
    st.lists(st.tuples(st.sampled_from(["request", "reply"]), st.floats(-2.0, 2.0)), max_size=40)
)
def test_no_time_steps_back(events: list[tuple[str, float]]) -> None:
    tap = WireTap()
    order = InOrder(tap)
    for now, (what, ahead) in enumerate(events, 3):
        getattr(order, what)(now + ahead, b"x")
        order.pass_on(now)
    order.pass_on()
    times = [time for time, _, _ in told(tap)]
    assert len(times) == len(events)
    assert times == sorted(times)
