"""SVG and HTML as text: elements, whose colours are classes of the page's style sheet."""

from collections.abc import Iterable
from html import escape
from typing import Final

from khepera_protocol.text import printable

_LONGEST: Final = 200
"""Characters of a text."""

_EMPTY: Final = frozenset({"circle", "line", "path", "polygon", "polyline", "rect"})
"""Elements of SVG, which may end at once."""


def element(name: str, *children: str, **attributes: object) -> str:
    """Return an element; underscores in attributes stand for hyphens, None leaves one out."""
    text = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if not children and name in _EMPTY:
        return f"<{name}{text}/>"
    return f"<{name}{text}>{''.join(children)}</{name}>"


def tip(text: str) -> str:
    """Return a title of the element around it, shown when pointed at."""
    return element("title", clean(text))


def clean(text: str) -> str:
    """Return text from elsewhere as the content of an element."""
    return escape(printable(text, _LONGEST))


def points(places: Iterable[tuple[float, float]]) -> str:
    """Return the `points` of a polyline or polygon, from metres in the arena's frame.

    Drawings are in millimetres, with y down.
    """
    return " ".join(f"{1000 * x:.0f},{-1000 * y:.0f}" for x, y in places)


def rgb(colour: tuple[float, float, float]) -> str:
    """Return a colour of shares from 0 to 1."""
    return "#" + "".join(f"{round(255 * min(max(share, 0.0), 1.0)):02x}" for share in colour)


def _value(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    text = str(value)
    return escape(text if text.isprintable() else printable(text))
