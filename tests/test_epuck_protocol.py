"""The e-puck's requests, answers and packets as bytes: tables, framing, numbers, round trips."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.epuck import codes, generations, letters
from khepera_protocol.epuck.framing import Command, RequestSplitter, Sign
from khepera_protocol.epuck.generations import BTCOM, GCTRONIC, GCTRONIC2, Generation
from khepera_protocol.epuck.letters import Line, reply_numbers, request
from khepera_protocol.epuck.packets import Actuators, AllSensors, Behaviour, PacketError, Sound
from khepera_protocol.epuck.units import battery_share, battery_volts
from khepera_protocol.epuck.wifi import (
    EMPTY,
    PICTURE,
    SENSORS,
    WifiReader,
    WifiRequest,
    WifiSplitter,
)

ALL = generations.GENERATIONS


def cut(data: bytes, generation: Generation = GCTRONIC2, piece: int = 10**6) -> list[object]:
    """The requests in bytes that come in pieces of a size."""
    splitter = RequestSplitter(generation.codes, generation.longest)
    found: list[object] = []
    held = bytearray()
    for at in range(0, len(data), piece):
        held += data[at : at + piece]
        while held:
            count = splitter.end(held, len(held)) or len(held)
            request = splitter.take(bytes(held[:count]))
            del held[:count]
            if request is not None:
                found.append(request)
    return found


# letter, byte, parameters, and bytes of the answer of gctronic, btcom and gctronic2; None: unknown
CODES = [
    ("a", 0x9F, 0, 6, 6, 6),
    ("A", 0xBF, 0, 12, 12, 12),
    ("b", 0x9E, 0, 2, None, 2),
    ("D", 0xBC, 4, 0, 0, 0),
    ("E", 0xBB, 0, 4, 4, 4),
    ("g", 0x99, 0, 6, None, 6),
    ("L", 0xB4, 2, 0, 0, 0),
    ("M", 0xB3, 0, 10, 6, 8),
    ("N", 0xB2, 0, 16, 16, 16),
    ("O", 0xB1, 0, 16, 16, 16),
    ("P", 0xB0, 4, 0, None, 0),
    ("Q", 0xAF, 0, 4, 4, 4),
    ("t", 0x8C, 0, 1, None, 1),
    ("u", 0x8B, 0, 6, 6, 6),
    ("U", 0xAB, 0, 1, 1, 0),
    ("W", 0xA9, 3, 0, None, 0),
    ("w", 0x89, 35, 0, None, 0),
    ("Y", 0xA7, 2, None, None, 1),
    ("0xF8", 0xF8, 0, None, None, 103),
    ("0xF7", 0xF7, 19, None, None, 0),
    ("0xF6", 0xF6, 12, None, None, 0),
    ("0xF5", 0xF5, 0, None, None, 1),
    ("0xF4", 0xF4, 0, None, None, 8),
    ("0xF3", 0xF3, 0, None, None, 2),
    ("0xF2", 0xF2, 0, None, None, 1),
    ("0xF1", 0xF1, 1, None, None, 1),
    ("0xF0", 0xF0, 1, None, None, 1),
    ("0xEF", 0xEF, 1, None, None, 1),
]


class TestTables:
    @pytest.mark.parametrize("row", CODES, ids=lambda row: row[0])
    def test_codes_are_those_of_the_firmwares(
        self, row: tuple[str, int, int, int | None, int | None, int | None]
    ) -> None:
        name, byte, parameters, *answers = row
        for generation, answer in zip(ALL, answers, strict=True):
            code = generation.codes.get(byte)
            assert (code is None) == (answer is None)
            if code is not None:
                assert (code.name, code.parameters, code.answer) == (name, parameters, answer)

    def test_there_are_no_others_but_pictures(self) -> None:
        known = {row[1] for row in CODES}
        for generation in ALL:
            others = [code for byte, code in generation.codes.items() if byte not in known]
            assert [(code.name, code.answer) for code in others] == [("I", None)]

    @pytest.mark.parametrize(
        ("generation", "missing"), [(GCTRONIC, "X"), (BTCOM, "bgYZ"), (GCTRONIC2, "X")]
    )
    def test_letters_are_those_of_the_firmwares(self, generation: Generation, missing: str) -> None:
        assert set(letters.LETTERS) - generation.letters == set(missing)

    def test_a_byte_is_the_complement_of_its_letter(self) -> None:
        assert codes.row("N") == b"\xb2\x00"
        assert codes.row(("D", codes.pack([300, -100])), "Q") == b"\xbc\x2c\x01\x9c\xff\xaf\x00"
        assert codes.row(0xF8) == b"\xf8\x00"
        assert codes.unpack(b"\x2c\x01\x9c\xff\x07", signed=True) == (300, -100)
        assert codes.unpack(b"\x2c\x01\x9c\xff") == (300, 65436)

    def test_the_battery_is_as_the_firmware_reckons_it(self) -> None:
        assert battery_volts(3195) == pytest.approx(3.9, abs=0.001)
        assert [battery_share(raw) for raw in (0, 2785, 3195, 4000)] == [0, 0, 62, 100]


class TestFraming:
    @pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n", b"\n\r"])
    def test_every_line_end_ends_a_line(self, end: bytes) -> None:
        assert cut(b"D,1,2" + end + b"Q" + end) == [Line(b"D,1,2"), Line(b"Q")]

    def test_line_ends_alone_are_nothing(self) -> None:
        assert cut(b"\r\n\r\r\n\nQ\r") == [Line(b"Q")]

    def test_a_row_is_its_commands_and_its_end(self) -> None:
        driving = GCTRONIC2.codes[0xBC]
        assert cut(b"\xbc\x00\x0d\x0a\x00\xaf\x00") == [
            Command(driving, b"\x00\x0d\x0a\x00"),
            Command(GCTRONIC2.codes[0xAF]),
            Sign.ROW_END,
        ]

    def test_a_set_command_needs_no_end_before_the_next_one(self) -> None:
        names = [
            each.code.name if isinstance(each, Command) else each
            for each in cut(b"\xbc\x01\x02\x03\x04\xb4\x07\x01\xb2\x00")
        ]
        assert names == ["D", "L", "N", Sign.ROW_END]

    def test_a_row_behind_cr_lf_is_swallowed(self) -> None:
        assert cut(b"Q\r\n\xb2\x00\r\xb2\x00") == [
            Line(b"Q"),
            Line(b"\xb2\x00"),
            Command(GCTRONIC2.codes[0xB2]),
            Sign.ROW_END,
        ]

    def test_zeros_between_requests_are_nothing(self) -> None:
        assert cut(b"\x00\x00Q\r\x00\xaf\x00\x00") == [
            Line(b"Q"),
            Command(GCTRONIC2.codes[0xAF]),
            Sign.ROW_END,
        ]

    def test_unknown_bytes_of_a_row_are_passed_over(self) -> None:
        assert cut(b"\xf8AQ\xaf\x00", GCTRONIC) == [Command(GCTRONIC.codes[0xAF]), Sign.ROW_END]

    def test_a_line_that_is_too_long_is_cut(self) -> None:
        (line,) = cut(b"P," + b"1" * 10_000 + b"\r")
        assert isinstance(line, Line)
        assert len(line.text) == GCTRONIC2.longest

    @settings(max_examples=40)
    @given(
        st.lists(
            st.sampled_from([b"Q\r", b"D,1,2\r\n", b"\xb2\x00", b"\xf8\xf7", b"\x00", b"\x0d\x0a"])
            | st.binary(max_size=30)
        ).map(b"".join),
        st.integers(1, 9),
        st.sampled_from(ALL),
    )
    def test_requests_are_the_same_in_any_pieces(
        self, data: bytes, piece: int, generation: Generation
    ) -> None:
        assert cut(data, generation, piece) == cut(data, generation)

    @settings(max_examples=40)
    @given(st.binary(max_size=200))
    def test_a_splitter_takes_everything_and_is_free_again(self, data: bytes) -> None:
        row = b"\x00" * 36 + b"\r\rQ\r"  # ends a row, a command's parameters, or a line
        assert cut(data + row)[-1] == Line(b"Q")


class TestNumbers:
    @pytest.mark.parametrize(
        ("text", "found"),
        [
            (b"D,300,-100", [300, -100]),
            (b"d,300,-100", [300, -100]),
            (b"D", []),
            (b"D,", []),
            (b"D,5", [5]),
            (b"D,5,", [5]),
            (b"D,5,x", [5]),
            (b"D,x,5", []),
            (b"D5,6", []),
            (b"D,\t 5, +6", [5, 6]),
            (b"D,5 ,6", [5]),
            (b"D,5,6,7", [5, 6]),
            (b"D,5x6", [5]),
            (b"D,--5,6", []),
        ],
    )
    def test_are_read_as_by_sscanf(self, text: bytes, found: list[int]) -> None:
        assert Line(text).numbers("D", 2, 32) == found

    def test_wrap_as_the_robots_int(self) -> None:
        assert Line(b"P,40000,-40000").numbers("P", 2, 16) == [-25536, 25536]
        assert Line(b"P,40000,-40000").numbers("P", 2, 32) == [40000, -40000]

    @settings(max_examples=40)
    @given(st.integers(-(10**60), 10**60), st.sampled_from([16, 32]))
    def test_of_any_length_wrap(self, value: int, bits: int) -> None:
        half = 1 << (bits - 1)
        (found,) = Line(f"X,{value}".encode()).numbers("X", 1, bits)
        assert -half <= found < half
        assert (found - value) % (2 * half) == 0


class TestReplies:
    @pytest.mark.parametrize(
        ("letter", "line", "numbers"),
        [
            ("A", b"a,2051,2050,2849", (2051, 2050, 2849)),
            ("b", b"b,2380 (63%)", (2380,)),
            ("b", b"b,1", (1,)),
            ("I", b"i,1,40,40,8,3200", (1, 40, 40, 8, 3200)),
            ("M", b"m,1,2,3,4,5", (1, 2, 3, 4, 5)),
            ("M", b"m,0,0,0", (0, 0, 0)),
            ("N", b"n,1,2,3,4,5,6,7,8", (1, 2, 3, 4, 5, 6, 7, 8)),
            ("Q", b"q,-5,6", (-5, 6)),
            ("D", b"d", ()),
        ],
    )
    def test_give_their_numbers(self, letter: str, line: bytes, numbers: tuple[int, ...]) -> None:
        assert reply_numbers(letter, line) == numbers

    @pytest.mark.parametrize(
        ("letter", "line"),
        [
            ("Q", b"q,1"),
            ("Q", b"n,1,2"),
            ("Q", b""),
            ("Q", b"q,1,x"),
            ("Q", b"q,1,99999999999"),
            ("N", b"z,Command not found"),
            ("b", b"b"),
        ],
    )
    def test_that_do_not_fit_are_refused(self, letter: str, line: bytes) -> None:
        with pytest.raises(ValueError, match=r".+"):
            reply_numbers(letter, line)

    def test_a_request_ends_with_cr_that_a_row_may_follow(self) -> None:
        both = request("D", 300, -100) + codes.row("Q")
        assert both == b"D,300,-100\r\xaf\x00"
        assert len(cut(both)) == 3


WORDS = st.integers(-(2**15), 2**15 - 1)
BYTES = st.integers(0, 255)


class TestPackets:
    @settings(max_examples=40)
    @given(
        st.builds(
            Actuators,
            st.integers(0, 255).map(Behaviour),
            st.tuples(WORDS, WORDS),
            BYTES,
            st.lists(BYTES, min_size=12, max_size=12).map(tuple),
            st.integers(0, 255).map(Sound),
        )
    )
    def test_actuators_come_back(self, wanted: Actuators) -> None:
        data = wanted.pack()
        assert len(data) == codes.ACTUATORS_SIZE
        assert Actuators.unpack(data) == wanted

    @given(st.binary(min_size=103, max_size=103))
    def test_sensors_come_back(self, data: bytes) -> None:
        found = AllSensors.unpack(data)
        again = AllSensors.unpack(found.pack())
        assert repr(again) == repr(found)  # a float may be no number

    def test_sensors_lie_where_clients_look_for_them(self) -> None:
        found = AllSensors.unpack(bytes(range(103)))
        words = {at: at + 256 * (at + 1) for at in range(102)}
        assert found.acceleration == (words[0], words[2], words[4])
        assert found.gyro == (words[18], words[20], words[22])
        assert found.temperature == 36
        assert found.proximity == tuple(words[at] for at in range(37, 53, 2))
        assert found.ambient == tuple(words[at] for at in range(53, 69, 2))
        assert found.distance == words[69]
        assert found.volumes == (words[71], words[73], words[75], words[77])
        assert found.steps == (words[79], words[81])
        assert found.battery == words[83]
        assert (found.card, found.remote, found.selector) == (85, (86, 87, 88), 89)
        assert found.ground == (words[90], words[92], words[94])
        assert found.ground_ambient == (words[96], words[98], words[100])
        assert found.last == 102

    @pytest.mark.parametrize("size", [0, 18, 20, 102, 104])
    def test_of_another_size_are_refused(self, size: int) -> None:
        for packet in (Actuators, AllSensors):
            with pytest.raises(PacketError, match="bytes, not"):
                packet.unpack(bytes(size))

    def test_numbers_that_do_not_fit_are_refused(self) -> None:
        with pytest.raises(PacketError):
            Actuators(wheels=(40_000, 0)).pack()


class TestWifi:
    def test_a_request_is_21_bytes(self) -> None:
        asked = WifiRequest(pictures=True, sensors=False, actuators=Actuators(wheels=(5, -5)))
        data = asked.pack()
        assert data[:7] == b"\x80\x01\x00\x05\x00\xfb\xff"
        assert len(data) == 21
        assert WifiRequest.unpack(data) == asked

    def test_what_is_none_is_refused(self) -> None:
        for data in (b"", b"\x80", b"\x81" + bytes(20)):
            with pytest.raises(PacketError):
                WifiRequest.unpack(data)

    @settings(max_examples=40)
    @given(st.lists(st.integers(1, 50)), st.binary(max_size=5).filter(lambda b: b"\x80" not in b))
    def test_requests_come_in_any_pieces(self, sizes: list[int], rubbish: bytes) -> None:
        wanted = [WifiRequest(actuators=Actuators(wheels=(k, -k))) for k in range(4)]
        data = bytearray(rubbish + b"".join(each.pack() for each in wanted))
        splitter = WifiSplitter()
        found = []
        for size in [*sizes, len(data)]:
            piece = data[:size]
            del data[:size]
            while piece:
                count = splitter.end(piece, len(piece)) or len(piece)
                found.append(splitter.take(bytes(piece[:count])))
                del piece[:count]
        assert [each for each in found if each] == wanted

    def test_packets_of_a_robot_are_told_apart(self) -> None:
        reader = WifiReader()
        picture, sensors = b"\x01" + bytes(38400), b"\x02" + bytes(104)
        data = sensors + picture + b"\x03" + sensors
        packets = reader.feed(data[:50]) + reader.feed(data[50:])
        assert [head for head, _ in packets] == [SENSORS, PICTURE, EMPTY, SENSORS]
        assert [len(body) for _, body in packets] == [104, 38400, 0, 104]
        with pytest.raises(PacketError, match="0x07"):
            reader.feed(b"\x07")
