"""State of a robot's serial line of it, whoever drives."""

from khepera_protocol.zenoh.payloads import Wire, WireEntry

from macor_hil.monitor.line_state import LineState


def passed(*entries: tuple[str, str], first: int = 0, time: float = 1.0) -> Wire:
    return Wire(
        first=first,
        entries=[
            WireEntry(time=time + 0.01 * k, what=what, text=text)
            for k, (what, text) in enumerate(entries)
        ],
    )


def rows_of(line: LineState) -> list[tuple[str, str, int]]:
    return [(row.request, row.reply, row.count) for row in line.rows]


def test_replies_are_told_with_their_requests_and_the_time_they_took() -> None:
    line = LineState()
    line.take(passed(("request", "D,5,5\n"), ("reply", "d\r\n")), 10.0)
    (row,) = line.rows
    assert (row.request, row.reply) == ("D,5,5", "d")
    assert row.taken is not None
    assert abs(row.taken - 0.01) < 1e-9


def test_lines_that_came_in_pieces_are_one_and_half_lines_wait() -> None:
    line = LineState()
    line.take(passed(("request", "B"), ("request", "\n"), ("reply", "b,5."), ("reply", "01")), 1.0)
    assert rows_of(line) == [("B", "", 1)]
    line.take(passed(("reply", ",5.01\r\nh,"), first=4), 2.0)
    assert rows_of(line) == [("B", "b,5.01,5.01", 1)]


def test_polls_between_two_commands_are_one_row_with_their_number() -> None:
    line = LineState()
    poll = [("request", "N\n"), ("reply", "n,1,2,3,4,5,6,7,8\r\n"), ("request", "K\n")]
    polls = [*poll, ("reply", "k,0,0,0,0,0,0\r\n")]
    line.take(passed(*polls * 3, ("request", "D,1,1\n"), ("reply", "d\r\n"), *polls), 1.0)
    assert rows_of(line) == [
        ("N", "n,1,2,3,4,5,6,7,8", 3),
        ("K", "k,0,0,0,0,0,0", 3),
        ("D,1,1", "d", 1),
        ("N", "n,1,2,3,4,5,6,7,8", 1),
        ("K", "k,0,0,0,0,0,0", 1),
    ]


def test_readings_counters_speeds_and_lamps_are_known_from_the_line() -> None:
    line = LineState()
    line.take(
        passed(
            *(("request", "N\n"), ("reply", "n,1,2,3,4,5,6,7,8\r\n")),
            *(("request", "O\n"), ("reply", "o,500,2,3,4,5,6,7,8\r\n")),
            *(("request", "H\n"), ("reply", "h,262,-263\r\n")),
            *(("request", "E\n"), ("reply", "e,4,5\r\n")),
            *(("request", "D,4,5\n"), ("reply", "d\r\n")),
            *(("request", "L,0,1\n"), ("reply", "l\r\n")),
            *(("request", "L,1,2\n"), ("reply", "l\r\n")),
        ),
        7.0,
    )
    assert line.proximity == ((1, 2, 3, 4, 5, 6, 7, 8), 7.0)
    assert line.ambient is not None
    assert line.ambient.values[0] == 500
    assert (line.counters, line.speed, line.wanted) == ((262, -263), (4, 5), (4, 5))
    # a toggle of a lamp of which nothing is known tells nothing
    assert line.lamps == {"lateral": True}
    assert (line.asked, line.driven) == (7.0, 7.0)
    # another way of driving: the speeds are no more those that D has set
    line.take(passed(("request", "C,100,100\n"), ("reply", "c\r\n"), first=14), 8.0)
    assert line.wanted is None


def test_a_refused_request_teaches_nothing() -> None:
    line = LineState()
    line.take(passed(("request", "L,0,7\n"), ("reply", "z,Protocol error\r\n")), 1.0)
    assert rows_of(line) == [("L,0,7", "z,Protocol error", 1)]
    assert line.lamps == {}


def test_a_request_without_an_answer_does_not_take_the_next_ones() -> None:
    line = LineState()
    line.take(passed(("request", "D,1,1\n"), ("request", "H\n"), ("reply", "h,1,2\r\n")), 1.0)
    assert rows_of(line) == [("D,1,1", "", 1), ("H", "h,1,2", 1)]


def test_what_is_no_exchange_stands_by_itself_and_controls_nothing() -> None:
    line = LineState()
    line.take(passed(("close", ""), ("fault", "cut\x1b[2J"), ("reply", "v,\x07\r\n")), 1.0)
    assert rows_of(line) == [("", "close", 1), ("", r"fault cut\x1b[2J", 1), ("", r"v,\x07", 1)]


def test_what_was_told_before_is_left_out_and_a_gap_is_told() -> None:
    line = LineState()
    line.take(passed(("request", "H\n"), ("reply", "h,1,2\r\n")), 1.0)
    line.take(passed(("reply", "h,1,2\r\n"), ("request", "D,1"), first=1), 1.0)
    assert rows_of(line) == [("H", "h,1,2", 1)]
    line.take(passed(("request", ",1\n"), first=9), 1.0)
    assert rows_of(line)[1:] == [("", "6 events did not come here", 1), (",1", "", 1)]
    assert line.driven is None


def test_a_flood_is_kept_within_bounds() -> None:
    line = LineState()
    for k in range(300):
        line.take(passed(("request", f"D,{k},0\n"), first=k), 1.0)
    line.take(passed(("request", "x" * 4000), first=300), 1.0)
    assert len(line.rows) == 60
