"""The report, made from results alone: a page of HTML and one of Markdown, pictures beside them."""

import re
from collections.abc import Iterable, Sequence
from csv import DictWriter
from dataclasses import dataclass
from html import escape
from io import BytesIO, StringIO
from itertools import starmap
from pathlib import Path
from string import Template
from typing import Any, Final

from khepera_protocol.palette import drawing_style

from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.results.store import Results
from macor_hil.experiments.sweep.watch import Watch
from macor_hil.files import write_atomically

_TITLE: Final = "MACOR with Fuzzy ART, reproduced"
_SCOPE: Final = (
    'The experiments of "Integration of a Fuzzy ART Approach in a Biologically Inspired'
    ' Sensorimotor Architecture" on emulated robots, over their serial protocol and from'
    " the pictures of an omnidirectional camera. One training seed is one independent sample;"
    " intervals are 95 % bootstrap intervals over seeds."
)

_TOGETHER: Final = re.compile(r"(?<=\d) (?=%)|(?<=\d) (?=to \d)|(?<=\d to) (?=\d)")
"""Spaces at which a line of a table's cell never ends: `100 %`, `17.9 to 18.4`."""

_NO_BREAK: Final = "\N{NO-BREAK SPACE}"

_PAGE: Final = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>$title</title>
<style>
body { font: 16px/1.5 Georgia, serif; max-width: 64rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 0.85rem; }
caption { text-align: left; font-weight: bold; padding: 0.3rem 0; }
th, td { padding: 0.2rem 0.4rem; text-align: right; border-top: 1px solid #ccc; }
th:first-child { text-align: left; }
thead th { border-bottom: 2px solid #666; vertical-align: bottom; }
figure { margin: 1.5rem 0; overflow-x: auto; }
img { max-width: 100%; }
figcaption, nav, footer { font-size: 0.85rem; color: #444; }
div { overflow-x: auto; }
</style>
</head>
<body>
<h1>$title</h1>
<p>$scope</p>
<nav>$contents</nav>
$chapters
<footer>$costs</footer>
</body>
</html>
""")


@dataclass(frozen=True, slots=True)
class Chapter:
    """An experiment, its results, and what is told of them beside its own text."""

    experiment: Experiment
    results: Results
    more: Sequence[Element]


def write_report(
    folder: Path, chapters: Sequence[Chapter], costs: list[dict[str, Any]], watch: Watch
) -> Path:
    """Draw all pictures and write the page.

    Args:
        folder: where page and pictures go.
        chapters: experiments with their results.
        costs: what each piece of work took, in seconds, by its name.
        watch: hears of the progress.

    Returns:
        The page of HTML; `report.md` beside it says the same.

    Raises:
        MacorError: the folder cannot be written to.
    """
    told = []
    for number, chapter in enumerate(chapters):
        watch("report", number, len(chapters))
        experiment = chapter.experiment
        own = experiment.tell(experiment.settings, chapter.results)
        told.append((experiment, [*own, *chapter.more]))
        _draw(folder, chapter)
        _write_rows(folder, chapter)
    cost = _cost_table(costs)
    page = folder / "index.html"
    links = (f'<a href="#{e.name}">{escape(e.title)}</a>' for e, _ in told)
    text = _PAGE.substitute(
        title=_TITLE,
        scope=escape(_SCOPE, quote=False),
        contents="<br>".join(links),
        chapters="\n".join(starmap(_chapter, told)),
        costs=_html(cost, ""),
    )
    write_atomically(page, text.encode())
    parts = [f"# {_TITLE}", _SCOPE]
    for experiment, elements in told:
        parts.append(f"## {experiment.title}")
        parts += (_markdown(element, experiment.name) for element in elements)
    parts.append(_markdown(cost, ""))
    write_atomically(folder / "report.md", "\n\n".join([*parts, ""]).encode())
    watch("report", len(chapters), len(chapters))
    return page


def _draw(folder: Path, chapter: Chapter) -> None:
    experiment = chapter.experiment
    with drawing_style():
        figures = experiment.draw(experiment.settings, chapter.results)
    for name, figure in figures.items():
        buffer = BytesIO()
        figure.savefig(buffer, format="png")
        write_atomically(folder / _file(experiment.name, name), buffer.getvalue())


def _write_rows(folder: Path, chapter: Chapter) -> None:
    experiment = chapter.experiment
    if experiment.rows is None:
        return
    rows = list(experiment.rows(experiment.settings, chapter.results))
    text = StringIO()
    if rows:
        writer = DictWriter(text, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    write_atomically(folder / f"{experiment.name}.csv", text.getvalue().encode())


def _chapter(experiment: Experiment, elements: Sequence[Element]) -> str:
    body = "\n".join(_html(element, experiment.name) for element in elements)
    return f'<h2 id="{experiment.name}">{escape(experiment.title)}</h2>\n{body}'


def _markdown(element: Element, experiment: str) -> str:
    match element:
        case Text(text):
            return text
        case Picture(name, caption):
            return f"![{caption}]({_file(experiment, name)})\n\n{caption}"
        case Table(title, head, rows):
            lines = [head, ("---",) * len(head), *rows]
            return f"{title}:\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _html(element: Element, experiment: str) -> str:
    match element:
        case Text(text):
            return f"<p>{escape(text)}</p>"
        case Picture(name, caption):
            source, said = _file(experiment, name), escape(caption)
            return (
                f'<figure><img src="{source}" alt="{said}"><figcaption>{said}</figcaption></figure>'
            )
        case Table(title, head, rows):
            top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
            body = "\n".join(map(_row, rows))
            caption = f"<caption>{escape(title)}</caption>"
            return (
                f"<div><table>{caption}<thead><tr>{top}</tr></thead>"
                f"<tbody>{body}</tbody></table></div>"
            )


def _row(cells: Iterable[str]) -> str:
    first, *others = (_TOGETHER.sub(_NO_BREAK, escape(cell)) for cell in cells)
    return f'<tr><th scope="row">{first}</th>{"".join(f"<td>{c}</td>" for c in others)}</tr>'


def _file(experiment: str, picture: str) -> str:
    return f"{experiment}-{picture}.png"


def _cost_table(costs: list[dict[str, Any]]) -> Table:
    rows = []
    for what in dict.fromkeys(cost["what"] for cost in costs):
        seconds = [cost["seconds"] for cost in costs if cost["what"] == what]
        rows.append((what, str(len(seconds)), f"{sum(seconds) / len(seconds):.1f}"))
    head = ("work", "seeds", "seconds a seed, mean")
    return Table("What it cost on this machine", head, tuple(rows))
