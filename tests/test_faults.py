"""Line faults: what each does to bytes, that chance is the seed's alone, and how they are told."""

from math import inf

import pytest

from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.dialect import KHEPERA
from khepera_emulator.line.fault import FAULTS, Direction, Fault
from khepera_emulator.line.fault_text import parse_fault, parse_script
from khepera_emulator.line.faults import Faults
from khepera_emulator.line.uart import Uart

EACH = 2.0**-10
TEXT = b"N,1,2,3\r\n"
BOTH = (Direction.REQUEST, Direction.REPLY)


def faults(*specs: str, seed: int = 1) -> tuple[Faults, list[str]]:
    told: list[str] = []
    made = Faults(map(parse_fault, specs), seed, lambda happening: told.append(str(happening)))
    return made, told


def through(
    made: Faults, data: bytes = TEXT, direction: Direction = Direction.REPLY, start: float = 0.0
) -> tuple[bytes, list[float], float]:
    items = [(start + EACH * count, byte) for count, byte in enumerate(data, 1)]
    passed, late = made.on_bytes(direction, items, EACH)
    return bytes(byte for _, byte in passed), [when for when, _ in passed], late


class TestBytes:
    def test_are_dropped_in_their_time(self) -> None:
        made, told = faults("drop:p=1,n=1")
        data, times, late = through(made)
        assert data == TEXT[1:]
        assert times == [EACH * count for count in range(2, 10)]
        assert late == 0.0
        assert told == ["0.000977 s, reply: drop: b'N'"]

    def test_have_one_bit_flipped(self) -> None:
        made, told = faults("flip:p=1")
        data, _, _ = through(made)
        flips = [(a ^ b).bit_count() for a, b in zip(data, TEXT, strict=True)]
        assert flips == [1] * len(TEXT)
        assert len({a ^ b for a, b in zip(data, TEXT, strict=True)}) > 3
        assert told[0] == f"0.000977 s, reply: flip: b'N' becomes {data[:1]!r}"

    def test_have_any_bit_flipped_however_rare_it_is(self) -> None:
        data, _, _ = through(faults("flip:p=0.05")[0], bytes(4000))
        assert set(data) == {0, *(1 << bit for bit in range(8))}

    def test_come_twice(self) -> None:
        made, _ = faults("duplicate:n=1")
        data, times, late = through(made)
        assert data == b"N" + TEXT
        assert times == [EACH * count for count in range(1, 11)]
        assert late == EACH

    def test_come_late_and_hold_up_those_behind(self) -> None:
        made, told = faults("delay:time=0.5,n=2")
        data, times, late = through(made)
        assert data == TEXT
        assert times[:3] == [EACH + 0.5, 2 * EACH + 1.0, 3 * EACH + 1.0]
        assert late == 1.0
        assert told[0] == "0.500977 s, reply: delay: b'N' 0.5 s late"

    def test_pass_outside_their_time(self) -> None:
        made, _ = faults("drop:at=1,for=1")
        for start, expected in ((0.0, TEXT), (1.0, b""), (1.9, b""), (2.0, TEXT)):
            assert through(made, start=start)[0] == expected

    @pytest.mark.parametrize("direction", BOTH)
    def test_pass_the_other_way(self, direction: Direction) -> None:
        made, _ = faults(f"drop:dir={direction}")
        for each in BOTH:
            assert (through(made, direction=each)[0] == b"") == (each is direction)

    def test_are_hit_as_often_as_chance_says(self) -> None:
        made, told = faults("drop:p=0.1", seed=5)
        data, _, _ = through(made, bytes(10_000))
        assert 8_800 < len(data) < 9_200
        assert len(told) == 10_000 - len(data)

    @pytest.mark.parametrize("kind", ["drop", "flip", "duplicate", "delay"])
    def test_are_hit_alike_however_they_are_cut(self, kind: str) -> None:
        whole = through(faults(f"{kind}:p=0.1")[0], TEXT * 20)[0]
        made, _ = faults(f"{kind}:p=0.1")
        for piece in (TEXT * 2, TEXT * 18):
            through(made, piece, Direction.REQUEST)
        pieces = [through(made, piece)[0] for piece in (TEXT * 7, TEXT, TEXT * 12)]
        assert b"".join(pieces) == whole
        other = through(faults(f"{kind}:p=0.1", seed=2)[0], TEXT * 20)
        assert kind == "delay" or other[0] != whole


class TestReplies:
    def test_are_truncated_anywhere(self) -> None:
        made, told = faults("truncate:p=1")
        kept = {made.on_reply(1.0, TEXT) for _ in range(200)}
        assert kept == {TEXT[:count] for count in range(len(TEXT))}
        assert told[0].startswith("1.000000 s, reply: truncate: b'")
        made, _ = faults("truncate:p=0.1")
        rare = {len(made.on_reply(1.0, TEXT)) for _ in range(2000)}
        assert rare == set(range(len(TEXT) + 1))

    def test_have_text_before_them(self) -> None:
        made, told = faults(r"stray:p=1,n=1,text=a,b\r\n\xff")
        assert made.on_reply(1.0, TEXT) == b"a,b\r\n\xff" + TEXT
        assert made.on_reply(1.0, TEXT) == TEXT
        assert told == [r"1.000000 s, reply: stray: b'a,b\r\n\xff'"]


BYTE = 11 / 9600


def line(*specs: str, baud: int | None = 9600) -> tuple[Uart, list[str]]:
    made, told = faults(*specs)
    return Uart(baud, made), told


def converse(
    uart: Uart, *requests: tuple[float, bytes], until: float = 10.0
) -> tuple[list[tuple[float, bytes]], bytes]:
    """Answer each request with itself in lower case; requests that came, bytes at the client."""
    seen: list[tuple[float, bytes]] = []
    for when, data in requests:
        seen += answer(uart, when)
        uart.receive(data, when)
    seen += answer(uart, until)
    return seen, uart.sent(until)


def answer(uart: Uart, until: float) -> list[tuple[float, bytes]]:
    seen = []
    for when, request in uart.requests(until):
        uart.send(request.lower() + b"\r\n", when)
        seen.append((round(when, 6), request))
    return seen


class TestLine:
    def test_without_faults_is_left_alone(self) -> None:
        uart, told = line()
        assert converse(uart, (0.0, b"H\n")) == ([(round(2 * BYTE, 6), b"H")], b"h\r\n")
        assert told == []

    def test_that_stalls_goes_on_where_it_stood(self) -> None:
        uart, told = line("stall:at=1,for=2,dir=reply")
        uart.receive(b"HHHHHHH\n", 1.0 - 9 * BYTE)
        answer(uart, 1.0)
        assert uart.next_request() is not None or told
        answer(uart, 1.1)
        due = [uart.due(count) for count in range(1, 10)]
        assert due == pytest.approx([3.0 + BYTE * count for count in range(9)])
        assert told == ["1.000000 s, reply: stall: 2 s"]

    def test_that_is_cut_loses_both_directions_and_comes_back(self) -> None:
        uart, told = line("cut:at=1,for=1")
        requests, said = converse(uart, (0.5, b"A\n"), (1.5, b"B\n"), (2.0 - BYTE / 2, b"C\nD\n"))
        assert [each for _, each in requests] == [b"A", b"C", b"D"]
        assert said == b"a\r\nc\r\nd\r\n"
        assert told[:2] == ["1.000000 s, reply: cut: 1 s", "1.501146 s, request: cut: b'B' lost"]

    def test_may_be_cut_by_a_request(self) -> None:
        uart, _ = line("cut:p=1,n=1,for=0.5")
        requests, said = converse(uart, (0.0, b"A\n"), (0.1, b"B\n"), (1.0, b"C\n"))
        assert [each for _, each in requests] == [b"A", b"C"]
        assert said == b"c\r\n"

    def test_may_stall_by_a_request(self) -> None:
        uart, _ = line("stall:p=1,n=1,for=0.5,dir=reply")
        converse(uart, (0.0, b"A\n"), until=0.1)
        assert uart.due(1) == pytest.approx(2 * BYTE + 0.5)

    def test_has_stray_text_at_a_time(self) -> None:
        uart, told = line(r"stray:at=1,text=tick\n")
        assert uart.next_request() == 1.0
        assert answer(uart, 2.0) == []
        assert uart.due(5) == pytest.approx(1.0 + 5 * BYTE)
        assert uart.sent(2.0) == b"tick\n"
        assert told == [r"1.000000 s, reply: stray: b'tick\n'"]
        assert uart.next_request() is None


class TestReset:
    def test_loses_what_was_half_done(self) -> None:
        uart, told = line("reset:at=1")
        # one byte of a request has arrived, the next one arrives after the reset
        uart.receive(b"H\n", 1.0 - 1.5 * BYTE)
        seen = converse(uart, (2.0, b"B\n"))
        assert seen == (
            [(1.0, b"restart"), (round(2.0 + 2 * BYTE, 6), b"B")],
            b"restart\r\nb\r\n",
        )
        assert told == ["1.000000 s, reply: reset: the robot starts again"]

    def test_ends_a_reply_in_the_middle(self) -> None:
        uart, _ = line("reset:at=1")
        # the request ends so that three bytes of the reply are out at one second
        uart.receive(b"HHHHHHH\n", 1.0 - 11.5 * BYTE - KHEPERA.busy)
        requests = answer(uart, 2.0)
        assert [each for _, each in requests] == [b"HHHHHHH", b"restart"]
        assert uart.sent(2.0) == b"hhhrestart\r\n"

    def test_by_chance_takes_the_place_of_a_request(self) -> None:
        uart, _ = line("reset:p=1,n=1")
        requests, said = converse(uart, (0.0, b"A\nB\n"), (1.0, b"C\n"))
        assert [each for _, each in requests] == [b"restart", b"B", b"C"]
        assert said == b"restart\r\nb\r\nc\r\n"

    def test_is_heard_by_a_client_that_has_not_asked(self) -> None:
        uart, _ = line("reset:at=1")
        uart.receive(b"A\nB", 0.9)
        uart.hang_up()
        requests, said = converse(uart)
        assert [each for _, each in requests] == [b"A", b"restart"]
        assert said == b"restart\r\n"
        assert converse(uart, (10.0, b"C\n"), until=20.0)[1] == b"c\r\n"

    def test_keeps_the_order_of_requests_before_it(self) -> None:
        uart, _ = line("reset:at=0.5", baud=None)
        uart.receive(b"A\n", 0.4)
        assert [each for _, each in answer(uart, 1.0)] == [b"A", b"restart"]


def test_a_line_begins_anew() -> None:
    made, _ = faults("drop:p=0.3", "stray:at=1")
    first = through(made, TEXT * 10)
    assert made.next_moment() == 1.0
    made.take_moment()
    assert made.next_moment() is None
    made.begin(1, 5.0)
    assert made.next_moment() == 6.0
    assert through(made, TEXT * 10, start=5.0)[0] == first[0]


class TestSpec:
    @pytest.mark.parametrize(
        ("text", "fault"),
        [
            ("drop", Fault("drop")),
            ("flip:p=0.25,dir=request", Fault("flip", 0.25, (Direction.REQUEST,))),
            ("drop:at=2,for=3,n=4", Fault("drop", at=2.0, lasts=3.0, most=4.0)),
            ("delay:time=0.25", Fault("delay", time=0.25)),
            ("stall:at=2", Fault("stall", None, at=2.0, lasts=1.0)),
            ("cut:p=0.5,for=3", Fault("cut", 0.5, lasts=3.0)),
            ("reset:at=9", Fault("reset", None, at=9.0)),
            ("stray:p=1,text=a,p=2", Fault("stray", 1.0, (Direction.REPLY,), text=b"a,p=2")),
        ],
    )
    def test_is_read(self, text: str, fault: Fault) -> None:
        assert parse_fault(text) == fault

    @pytest.mark.parametrize("kind", FAULTS.names())
    def test_knows_every_kind(self, kind: str) -> None:
        assert parse_fault(f"{kind}:at=1").kind == kind

    @pytest.mark.parametrize(
        ("text", "why"),
        [
            ("", "there are drop, flip"),
            ("fire", "there are drop, flip"),
            ("drop:0.1", "'0.1' is no KEY=VALUE"),
            ("drop:p=often", "p=often is no number"),
            ("drop:p=1.5", "p=1.5 is out of range"),
            ("drop:at=-1", "at=-1 is out of range"),
            ("drop:at=inf", "at=inf is out of range"),
            ("drop:p=1,p=1", "p is given twice"),
            ("drop:time=1", "drop knows p, n, dir, at, for, not 'time'"),
            ("cut:dir=reply", "cut knows p, n, at, for, not 'dir'"),
            ("drop:dir=up", "dir is request, reply or both"),
            ("cut", "cut needs p (a chance) or at (a time)"),
            ("stray:text=a", "stray needs p"),
            ("stray:p=1,text=ä", "give ASCII with escapes"),
        ],
    )
    def test_that_is_wrong_is_told(self, text: str, why: str) -> None:
        with pytest.raises(EmulatorError) as caught:
            parse_fault(text)
        assert str(caught.value).startswith(f"cannot read the fault {text!r}: ")
        assert why in str(caught.value)

    def test_of_a_script_has_times(self) -> None:
        script = "# a bad day\n\n1.5 cut:for=2\n 3 drop:p=0.5,for=1 \n4 reset\n"
        assert parse_script(script) == (
            Fault("cut", None, at=1.5, lasts=2.0),
            Fault("drop", 0.5, at=3.0, lasts=1.0),
            Fault("reset", None, at=4.0),
        )
        assert parse_script("") == ()
        assert parse_fault("drop").lasts == inf

    @pytest.mark.parametrize("line", ["cut", "soon cut", "1 fire", "1", "1 cut:at=2"])
    def test_of_a_script_that_is_wrong_has_a_line(self, line: str) -> None:
        with pytest.raises(EmulatorError, match="line 2 of the fault script"):
            parse_script(f"1 reset\n{line}\n")
