"""Bytes to lines: every line end that clients of real robots send, in portions of any size."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies._internal.core import DataObject
from khepera_protocol.serial.framing import REQUEST_LIMIT, ReplySplitter, RequestSplitter


def portions(data: bytes, cuts: list[int]) -> list[bytes]:
    places = sorted({0, len(data), *(cut % (len(data) + 1) for cut in cuts)})
    return [data[a:b] for a, b in pairwise(places)]


@pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n"])
def test_every_line_end_makes_one_request(end: bytes) -> None:
    assert RequestSplitter().feed(b"H" + end + b"N" + end) == [b"H", b"N"]


def test_cr_lf_split_across_reads_ends_one_request() -> None:
    splitter = RequestSplitter()
    assert splitter.feed(b"D,5,5\r") == [b"D,5,5"]
    assert splitter.feed(b"\nH\r") == [b"H"]
    assert splitter.feed(b"\n") == []
    assert splitter.feed(b"\n") == []


@pytest.mark.parametrize("blank", [b"\r\n", b"\n\n\n", b"\r\r", b"\r\n\r\n", b"\n\r\n"])
def test_empty_lines_are_no_requests(blank: bytes) -> None:
    assert RequestSplitter().feed(blank) == []


def test_a_blank_is_a_request() -> None:
    assert RequestSplitter().feed(b" \n") == [b" "]


def test_the_longest_line_passes_and_a_longer_one_overflows() -> None:
    splitter = RequestSplitter()
    longest = b"x" * REQUEST_LIMIT
    assert splitter.feed(longest + b"\n") == [longest]
    assert splitter.feed(longest + b"y\nH\n") == [RequestSplitter.OVERFLOW, b"H"]
    assert splitter.feed(b"z" * 100_000) == []
    assert splitter.feed(b"\rH\r") == [RequestSplitter.OVERFLOW, b"H"]


@pytest.mark.parametrize(
    "data",
    [
        b"N\n\0H\n",  # a C string with its end, or a break between requests
        b"N\0\nH\0\n\0",
        b"\0\0N\r\0\nH\r\n",
        b"N\n" + bytes(1000) + b"H\n",
    ],
)
def test_nul_bytes_are_nothing(data: bytes) -> None:
    assert RequestSplitter().feed(data) == [b"N", b"H"]
    bytewise = RequestSplitter()
    assert [line for byte in data for line in bytewise.feed(bytes([byte]))] == [b"N", b"H"]


def test_a_line_of_nul_bytes_is_no_request() -> None:
    assert RequestSplitter().feed(b"\0\n\0\0\r\n") == []


def test_clear_forgets_half_a_line() -> None:
    splitter = RequestSplitter()
    splitter.feed(b"D,1")
    splitter.clear()
    assert splitter.feed(b"H\n") == [b"H"]


@given(st.binary(max_size=300) | st.text("H,\r\n", max_size=60).map(str.encode), st.data())
def test_portions_make_no_difference_to_requests(data: bytes, draws: DataObject) -> None:
    cuts = draws.draw(st.lists(st.integers(0, 400)))
    whole, pieces = RequestSplitter(), RequestSplitter()
    expected = whole.feed(data)
    assert [line for part in portions(data, cuts) for line in pieces.feed(part)] == expected
    assert all(0 < len(line) <= REQUEST_LIMIT and not {10, 13} & set(line) for line in expected)


@given(st.lists(st.text("dhn,0123456789-", min_size=1).map(str.encode)), st.lists(st.integers(0)))
def test_portions_make_no_difference_to_replies(lines: list[bytes], cuts: list[int]) -> None:
    data = b"".join(line + b"\r\n" for line in lines)
    splitter = ReplySplitter()
    assert [line for part in portions(data, cuts) for line in splitter.feed(part)] == lines
    assert splitter.pending == b""


def test_half_a_reply_is_pending_until_cleared() -> None:
    splitter = ReplySplitter()
    assert splitter.feed(b"\r\nd\r\nh,12") == [b"d"]
    assert splitter.pending == b"h,12"
    splitter.clear()
    assert splitter.feed(b",3\r\n") == [b",3"]
