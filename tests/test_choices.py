"""Switches of the firmware and tools of the ROM, as names and texts."""

from pathlib import Path

import pytest

from khepera_emulator.errors import EmulatorError
from khepera_emulator.robot.khepera.choices import Choices, option_names, parse_choices
from khepera_emulator.robot.khepera.tools import LOADER_DONE, LOADER_ERROR, load_record


def test_no_switch_is_the_default() -> None:
    assert parse_choices([]) == Choices()


def test_switches_and_values() -> None:
    items = [
        "reject-beyond",
        "reached-within=2",
        "bios=4.02",
        "rom-date=March 1, 2002",
        "bios=4.03",
    ]
    expected = Choices(reject_beyond=True, reached_within=2, bios="4.03", rom_date="March 1, 2002")
    assert parse_choices(items) == expected


@pytest.mark.parametrize(
    ("item", "reason"),
    [
        ("fast", "unknown firmware option 'fast'; there are error-prefix"),
        ("reject_beyond", "unknown"),
        ("reject-beyond=1", "takes no value"),
        ("reached-within=x", "give 0 to 99"),
        ("reached-within", "give 0 to 99"),
        ("bios=5", "looks like 5.01"),
        ("rom-name=", "printable"),
        ("rom-name=K\n", "printable"),
    ],
)
def test_wrong_switch(item: str, reason: str) -> None:
    with pytest.raises(EmulatorError, match=reason):
        parse_choices([item])


def test_every_switch_has_a_name() -> None:
    assert len(option_names()) == 14


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b"S00600004844521B", ""),
        (b"S9030000FC", LOADER_DONE),
        (b"S804000000FB", LOADER_DONE),
        (b"S9030000FD", LOADER_ERROR),
        (b"S9040000FC", LOADER_ERROR),
        (b"S9", None),
        (b"S900", LOADER_ERROR),
        (b"S90", None),
        (b"s9030000FC", None),
        (b"H", None),
        (b"", None),
    ],
)
def test_the_loader_reads_records(line: bytes, said: str | None) -> None:
    assert load_record(line) == said


def test_the_page_of_choices_is_complete() -> None:
    page = (Path(__file__).parents[1] / "docs" / "khepera-choices.md").read_text()
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    numbers = sorted(int(number) for number in rows if number.isdecimal())
    assert numbers == list(range(1, 23))
    assert all(f"`{name}" in page for name in option_names())
