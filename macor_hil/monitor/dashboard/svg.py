"""SVG as text: elements, and the colours that all drawings share."""

from collections.abc import Iterable
from html import escape
from typing import Final

from khepera_protocol.text import printable

_LONGEST: Final = 200
"""Characters of a text."""

INK: Final = "#e8eaf0"
FAINT: Final = "#8b93a7"
LINE: Final = "#3a4254"
BEST: Final = "#ffb02e"
OTHER: Final = "#5cc8ff"
GOOD: Final = "#5fd38d"
BAD: Final = "#ff6b6b"


def element(name: str, *children: str, **attributes: object) -> str:
    """Return an element; underscores in attributes stand for hyphens, None leaves one out."""
    text = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_value(value)}"'
        for key, value in attributes.items()
        if value is not None
    )
    return f"<{name}{text}>{''.join(children)}</{name}>" if children else f"<{name}{text}/>"


def drawing(width: float, height: float, *children: str, title: str, **attributes: object) -> str:
    """Return a whole drawing, which fills the width that it gets.

    Args:
        width: of its view, in units of its own.
        height: of its view.
        children: elements.
        title: what it shows, for those who do not see it.
        attributes: more of the outermost element, such as another `viewBox`.
    """
    attributes.setdefault("viewBox", f"0 0 {width:g} {height:g}")
    return element(
        "svg",
        tip(title),
        *children,
        xmlns="http://www.w3.org/2000/svg",
        role="img",
        style="display:block;width:100%;height:auto",
        **attributes,
    )


def label(x: float, y: float, text: str, *children: str, **attributes: object) -> str:
    """Return a text and the elements in it; size and colour have defaults."""
    attributes.setdefault("font_size", 11)
    attributes.setdefault("fill", FAINT)
    return element("text", _clean(text), *children, x=x, y=y, font_family="inherit", **attributes)


def tip(text: str) -> str:
    """Return a title of the element around it, shown when pointed at."""
    return element("title", _clean(text))


def _clean(text: str) -> str:
    """Return text from elsewhere as the content of an element."""
    return escape(printable(text, _LONGEST))


def points(places: Iterable[tuple[float, float]]) -> str:
    """Return the `points` of a polyline or polygon."""
    return " ".join(f"{x:.5g},{y:.5g}" for x, y in places)


def rgb(colour: tuple[float, float, float]) -> str:
    """Return a colour of shares from 0 to 1."""
    return _hexadecimal(255 * min(max(share, 0.0), 1.0) for share in colour)


def heat(share: float) -> str:
    """Return a colour from dark blue at 0 to bright yellow at 1."""
    t = min(max(share, 0.0), 1.0) * (len(_HEAT) - 1)
    low = min(int(t), len(_HEAT) - 2)
    mixed = (a + (t - low) * (b - a) for a, b in zip(_HEAT[low], _HEAT[low + 1], strict=True))
    return _hexadecimal(mixed)


# five stops of a scale that grows evenly in lightness and can be told apart by the colour blind
_HEAT: Final = ((27, 32, 46), (49, 78, 128), (38, 130, 142), (110, 190, 100), (250, 220, 80))


def _hexadecimal(parts: Iterable[float]) -> str:
    return "#" + "".join(f"{round(part):02x}" for part in parts)


def _value(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else escape(str(value))
