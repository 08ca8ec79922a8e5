"""Parts of documentation pages that scripts write: everything between two marks."""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURES = DOCS / "pictures"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
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
