"""Tables of scripts, on the console and in the parts of documentation pages between two marks."""

import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = DOCS / "pictures"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write_part(page: Path, name: str, text: str) -> None:
    """Replace what stands between the marks of a name on a page.

    Raises:
        ValueError: the page has no such marks.
    """
    begin, end = f"<!-- begin {name} -->", f"<!-- end {name} -->"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    old = page.read_text("utf-8")
    if not pattern.search(old):
        raise ValueError(f"{page.name} has no part {name!r}")
    new = f"{begin}\n{text.strip()}\n{end}"
    page.write_text(pattern.sub(lambda _: new, old), "utf-8")


def table_of(page: Path, name: str) -> list[tuple[str, ...]]:
    """Return the rows of the table between the marks of a name on a page, its head first."""
    text = page.read_text("utf-8").partition(f"<!-- begin {name} -->")[2]
    lines = [line for line in text.partition("<!-- end")[0].splitlines() if line.startswith("| ")]
    rows = [tuple(line.strip("| ").split(" | ")) for line in lines]
    return [row for row in rows if set(row[0]) != {"-"}]


def report(
    title: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    part: tuple[Path, str],
    note: str = "",
) -> None:
    """Print a table; with `--write` among the program's arguments put it into the docs, too.

    Args:
        title: above the printed table.
        head: names of the columns.
        rows: of the table.
        part: page of the docs, and name of the part to replace.
        note: a line for the docs, above the table.
    """
    shown = Table(*head, title=title)
    for row in rows:
        shown.add_row(*row)
    Console().print(shown)
    if "--write" in sys.argv[1:]:
        write_part(*part, f"{note}\n\n{table(head, rows)}")
