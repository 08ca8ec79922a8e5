"""The line in time, by hand-made arithmetic: 11 bits a byte, and nothing without bound."""

from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from khepera_emulator.line.dialect import KHEPERA
from khepera_emulator.line.uart import GRID, Uart, on_grid

BYTE = 11 / 9600
INTERPRETER_TIME = KHEPERA.busy
RECEIVE_LIMIT = KHEPERA.receive_limit
SEND_LIMIT = KHEPERA.send_limit


def ask(uart: Uart, line: bytes, reply: bytes, now: float = 0.0) -> float:
    """Send a line, answer it; the time at which it was executed."""
    uart.receive(line, now)
    [(executed, _)] = list(uart.requests(now + 10))
    uart.send(reply, executed)
    return executed


def test_a_request_is_executed_when_its_last_byte_has_arrived() -> None:
    uart = Uart(9600)
    uart.receive(b"H\n", 1.0)
    assert list(uart.requests(1.0 + 2 * BYTE - 1e-6)) == []
    ((when, request),) = uart.requests(1.0 + 2 * BYTE + 1e-6)
    assert when == pytest.approx(1.0 + 2 * BYTE, abs=2 * GRID)
    assert request == b"H"


@pytest.mark.parametrize("baud", [9600, 19200, 38400, 57600, 115200])
def test_every_byte_of_a_reply_takes_its_wire_time(baud: int) -> None:
    uart = Uart(baud)
    executed = ask(uart, b"H\n", b"h,0,0\r\n")
    byte = 11 / baud
    assert executed == pytest.approx(2 * byte, abs=2 * GRID)
    for count in range(1, 8):
        due = executed + INTERPRETER_TIME + count * byte
        assert uart.due(count) == pytest.approx(due, abs=count * GRID)
        assert uart.arrived(due - 1e-6) == count - 1
        assert uart.arrived(due + 1e-6) == count
    assert uart.sent(executed + INTERPRETER_TIME + 3.5 * byte) == b"h,0"
    assert uart.sent(1.0, 2) == b",0"
    assert uart.sent(1.0) == b"\r\n"
    assert uart.sent(1.0) == b""


def test_a_worst_proximity_reply_takes_49_ms_at_9600() -> None:
    uart = Uart(9600)
    reply = b"n," + b",".join([b"1023"] * 8) + b"\r\n"
    executed = ask(uart, b"N\n", reply)
    assert uart.due(len(reply)) - executed - INTERPRETER_TIME == pytest.approx(0.0493, abs=1e-4)


def test_without_a_rate_the_line_takes_no_time() -> None:
    uart = Uart(None)
    assert ask(uart, b"H\n", b"h,0,0\r\n", 3.0) == 3.0
    assert uart.sent(3.0) == b"h,0,0\r\n"


def test_requests_back_to_back_are_answered_in_order() -> None:
    uart = Uart(115200)
    uart.receive(b"A\nB\nC\n", 0.0)
    executed = list(uart.requests(1.0))
    assert [line for _, line in executed] == [b"A", b"B", b"C"]
    times = [when for when, _ in executed]
    # the second line arrives within the interpreter's time for the first
    assert times[1] - times[0] == INTERPRETER_TIME
    assert times[2] - times[1] == INTERPRETER_TIME


@pytest.mark.parametrize("later", [0.0002, 0.0014])
def test_a_request_that_comes_meanwhile_waits_for_the_interpreter(later: float) -> None:
    uart = Uart(115200)
    first = ask(uart, b"A\n", b"a\r\n")
    second = ask(uart, b"B\n", b"b\r\n", later)
    assert second == first + INTERPRETER_TIME


def test_nothing_is_executed_before_its_time() -> None:
    uart = Uart(115200)
    uart.receive(b"A\nB\n", 0.0)
    first = 2 * 11 / 115200
    assert [line for _, line in uart.requests(first + 0.001)] == [b"A"]
    assert uart.next_request() == pytest.approx(first + INTERPRETER_TIME, abs=4 * GRID)
    assert [line for _, line in uart.requests(first + 0.002)] == [b"B"]
    assert uart.next_request() is None


def test_a_reply_waits_for_the_one_before() -> None:
    uart = Uart(9600)
    uart.send(b"12345", 0.0)
    uart.send(b"678", 0.001)
    assert uart.due(8) == pytest.approx(INTERPRETER_TIME + 8 * BYTE, abs=8 * GRID)


def test_a_flood_of_requests_overflows_the_receive_buffer_and_is_counted() -> None:
    uart = Uart(115200)
    requests = 2000
    uart.receive(b"H\n" * requests, 0.0)
    executed = list(uart.requests(10.0))
    wire = 2 * requests * 11 / 115200
    # while the line talks, the interpreter takes a request every 1.5 ms; then it empties its buffer
    served = wire / INTERPRETER_TIME + RECEIVE_LIMIT / 2
    assert len(executed) == pytest.approx(served, rel=0.1)
    assert uart.lost > 1000


def test_replies_that_do_not_fit_are_dropped_whole_and_counted() -> None:
    uart = Uart(9600)
    for _ in range(SEND_LIMIT // 10 + 5):
        uart.send(b"12345678\r\n", 0.0)
    assert uart.queued() == SEND_LIMIT // 10 * 10
    assert (uart.unsent, uart.lost) == (50, 0)
    assert uart.sent(1e6).count(b"\r\n") == SEND_LIMIT // 10


def test_the_next_request_is_there_with_its_last_byte() -> None:
    uart = Uart(9600)
    uart.receive(b"H", 0.0)
    assert uart.next_request() is None
    uart.receive(b"\n", 0.0)
    assert uart.next_request() == uart.received_by()


def test_finding_text_that_is_still_on_its_way() -> None:
    uart = Uart(9600)
    uart.send(b"h,1,2\r\n", 0.0)
    assert uart.find(b"\n") == 6
    assert uart.find(b"x") == -1


def test_clear_leaves_a_line_as_new() -> None:
    uart = Uart(9600)
    uart.receive(b"H\n" * 500, 5.0)
    list(uart.requests(5.5))
    uart.send(b"x" * 5000, 5.5)
    uart.clear()
    assert (uart.lost, uart.unsent) == (0, 0)
    assert uart.next_request() is None
    assert uart.received_by() == 0.0
    assert ask(uart, b"H\n", b"h\r\n") == pytest.approx(2 * BYTE, abs=2 * GRID)


def test_times_on_the_grid_add_up_exactly_wherever_they_begin() -> None:
    uart, later = Uart(9600), Uart(9600)
    offset = on_grid(123_456.789)
    uart.receive(b"D,5,5\n" * 20, 0.0)
    later.receive(b"D,5,5\n" * 20, offset)
    first = [when for when, _ in uart.requests(10)]
    second = [when - offset for when, _ in later.requests(offset + 10)]
    assert first == second


def test_the_grid_is_a_nanosecond() -> None:
    assert on_grid(0.1) == pytest.approx(0.1, abs=1e-9)
    assert on_grid(on_grid(0.1)) == on_grid(0.1)


class ByteByByte:
    """The receiving side as its words say, a byte at a time: slow, and easy to check by reading."""

    def __init__(self, rate: int | None) -> None:
        self.each = on_grid(11 / rate) if rate else 0.0
        self.busy = INTERPRETER_TIME if rate else 0.0
        self.free = self.line_free = 0.0
        self.lost = 0
        self.arriving: deque[tuple[float, int]] = deque()
        self.held: deque[tuple[float, int]] = deque()
        self.line = b""

    def receive(self, data: bytes, now: float) -> None:
        self.line_free = max(self.line_free, now)
        for byte in data:
            self.line_free += self.each
            self.arriving.append((self.line_free, byte))

    def requests(self, until: float) -> list[tuple[float, bytes]]:
        done = []
        while self.arriving and self.arriving[0][0] <= until:
            when, byte = self.arriving.popleft()
            done += self.interpret(when)
            if len(self.held) < RECEIVE_LIMIT:
                self.held.append((when, byte))
            else:
                self.lost += 1
            if self.free <= when:
                done += self.interpret(when)
        return done + self.interpret(until)

    def interpret(self, until: float) -> list[tuple[float, bytes]]:
        done = []
        while self.held and self.free <= until:
            when, byte = self.held.popleft()
            if byte not in b"\r\n":
                self.line += bytes((byte,))
                continue
            if self.line:
                when = max(when, self.free)
                self.free = when + self.busy
                done.append((when, self.line if len(self.line) <= 128 else b"?"))
            self.line = b""
        return done


@given(
    st.sampled_from([None, 1200, 9600, 115200, 3_000_000]),
    st.lists(
        st.tuples(
            st.sampled_from([b"H\n", b"\r\n", b"D,5,5\r", b"x" * 150, b"A\n" * 300, b"", b"N"]),
            st.floats(0.0, 0.3),
        ),
        max_size=12,
    ),
)
def test_a_line_is_as_if_every_byte_came_by_itself(
    rate: int | None, steps: list[tuple[bytes, float]]
) -> None:
    uart, model = Uart(rate), ByteByByte(rate)
    now = 0.0
    for data, wait in steps:
        uart.receive(data, now)
        model.receive(data, now)
        now = on_grid(now + wait)
        assert list(uart.requests(now)) == model.requests(now)
        assert (uart.lost, uart.arriving()) == (model.lost, len(model.arriving))
        request = uart.next_request()
        if request is not None:
            assert uart.room(now, 256) <= 256


@given(
    st.lists(st.tuples(st.binary(max_size=9), st.floats(0.0, 0.01), st.integers(0, 12))),
    st.sampled_from([None, 9600, 115200]),
)
def test_replies_may_be_taken_in_any_portions(
    steps: list[tuple[bytes, float, int]], rate: int | None
) -> None:
    whole, pieces = Uart(rate), Uart(rate)
    when, taken = 0.0, b""
    times: list[float] = []
    for data, wait, count in steps:
        when = on_grid(when + wait)
        for uart in (whole, pieces):
            uart.send(data, when)
        places = [whole.due(count) for count in range(1, whole.queued() + 1)]
        assert places[: len(times)] == times
        times = places
        assert whole.arrived(when) == sum(each <= when for each in times)
        got = pieces.sent(when, count)
        assert len(got) == min(count, sum(each <= when for each in times) - len(taken))
        taken += got
    assert taken + pieces.sent(1e6) == whole.sent(1e6)
