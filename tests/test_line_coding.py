"""A receiver with other settings than the sender, by bits drawn by hand."""

import pytest

from khepera_emulator.line.coding import Heard, LineFormat, receive

TEXT = b"N,1023,0,512\r\nD,5,-5\n"
EVERY_BYTE = bytes(range(256))
ROBOT = LineFormat(9600, stop=2)


def heard(data: bytes, sender: LineFormat, receiver: LineFormat) -> bytes:
    return bytes(each.byte for each in receive(data, sender, receiver))


@pytest.mark.parametrize("per_cent", [-5, -3, 0, 3, 5])
@pytest.mark.parametrize("stop", [1, 1.5, 2])
def test_five_per_cent_read_clean(per_cent: int, stop: float) -> None:
    other = LineFormat(9600 * (100 + per_cent) // 100, stop=stop)
    assert heard(EVERY_BYTE * 3, other, ROBOT) == EVERY_BYTE * 3
    assert heard(EVERY_BYTE * 3, ROBOT, other) == EVERY_BYTE * 3


@pytest.mark.parametrize("rate", [8700, 10700])
def test_more_does_not(rate: int) -> None:
    assert heard(EVERY_BYTE, LineFormat(rate), LineFormat(9600)) != EVERY_BYTE


@pytest.mark.parametrize("rate", [300, 1200, 4800, 19200, 38400, 115200])
def test_another_rate_reads_garbage(rate: int) -> None:
    there = heard(TEXT, LineFormat(rate), ROBOT)
    back = heard(TEXT, ROBOT, LineFormat(rate))
    for garbage in (there, back):
        assert garbage
        assert b"," not in garbage
        assert not garbage.endswith(b"\n")


def test_garbage_by_hand() -> None:
    # U with its start and stop bit is 0101010101: at half the rate each start bit is a spike
    assert receive(b"U", LineFormat(9600), LineFormat(4800)) == []
    # at twice the rate it is 00110011001100110011 and then idle: bits 1 to 8, a low stop bit;
    # the line falls again at 12, the sender's bit 6
    assert receive(b"U", LineFormat(4800), LineFormat(9600)) == [
        Heard(0.0, 0b01100110),
        Heard(6 / 4800, 0b11100110),
    ]


def test_a_start_bit_is_looked_at_in_its_middle() -> None:
    # the low of one bit lasts for two thirds of the receiver's bit, or for half of it
    assert receive(b"\xff", LineFormat(14400), LineFormat(9600)) == [Heard(0.0, 0xFF)]
    assert receive(b"\xff", LineFormat(19200), LineFormat(9600)) == []


def test_characters_begin_when_they_were_sent() -> None:
    starts = [each.start for each in receive(b"abc", LineFormat(9600), LineFormat(9600))]
    assert starts == pytest.approx([0.0, 10 / 9600, 20 / 9600])
    starts = [each.start for each in receive(b"abc", ROBOT, LineFormat(9600))]
    assert starts == pytest.approx([0.0, 11 / 9600, 22 / 9600])


class TestDataBits:
    def test_seven_sent_to_eight_find_the_stop_bit_for_the_eighth(self) -> None:
        assert heard(b"N", LineFormat(9600, bits=7), ROBOT) == bytes([ord("N") | 0x80])

    def test_eight_sent_to_seven_lose_the_eighth(self) -> None:
        assert heard(b"N\r\n", ROBOT, LineFormat(9600, bits=7)) == b"N\r\n"
        assert heard(b"\xce", ROBOT, LineFormat(9600, bits=7)) == b"N"

    def test_beyond_the_size_are_not_sent(self) -> None:
        five = LineFormat(9600, bits=5)
        assert heard(b"N", five, five) == bytes([ord("N") & 0x1F])


class TestParity:
    @pytest.mark.parametrize("parity", "EOMS")
    @pytest.mark.parametrize("bits", [7, 8])
    def test_of_both_ends_reads_clean(self, parity: str, bits: int) -> None:
        line = LineFormat(9600, bits, parity)
        assert heard(TEXT, line, line) == TEXT

    def test_seven_bits_and_parity_are_eight_bits(self) -> None:
        # C has three ones, N four
        assert heard(b"CN", LineFormat(9600, 7, "E"), ROBOT) == bytes([ord("C") | 0x80, ord("N")])
        assert heard(b"CN", LineFormat(9600, 7, "O"), ROBOT) == bytes([ord("C"), ord("N") | 0x80])

    def test_that_is_wrong_reads_nul(self) -> None:
        # without parity the stop bit, a 1, stands in its place: right for odd numbers of ones only
        assert heard(b"CNCN", ROBOT, LineFormat(9600, 8, "E")) == b"C\x00C\x00"
        assert heard(b"CNCN", ROBOT, LineFormat(9600, 8, "O")) == b"\x00N\x00N"
        assert heard(b"CN", ROBOT, LineFormat(9600, 8, "M")) == b"CN"
        assert heard(b"CN", ROBOT, LineFormat(9600, 8, "S")) == b"\x00\x00"

    def test_stands_where_a_receiver_without_it_has_its_stop_bit(self) -> None:
        # which is taken as it was sampled, and the line has to rise before the next one
        assert heard(b"CNCN", LineFormat(9600, 8, "E"), ROBOT) == b"CNCN"
        assert heard(b"CNCN", LineFormat(9600, 8, "S"), LineFormat(9600)) == b"CNCN"


def test_formats_match_whatever_their_stop_bits() -> None:
    assert LineFormat(9600, stop=1).matches(ROBOT)
    for other in (LineFormat(9601), LineFormat(9600, 7), LineFormat(9600, 8, "E")):
        assert not other.matches(ROBOT)


def test_a_line_that_stays_low_ends_what_is_read() -> None:
    # a break: the receiver reads one NUL, and nothing until the line rises
    slow = LineFormat(300)
    assert heard(b"\x00", slow, LineFormat(9600)) == b"\x00"
