"""Colours and type of all pictures: told apart by the colour blind, read at half their size.

Source of the colours: M. Okabe and K. Ito, "Color Universal Design", 2008. Curves also differ in
their markers, so that nothing is told by colour alone.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

BLUE: Final = "#0072B2"
VERMILION: Final = "#D55E00"
GREEN: Final = "#009E73"
ORANGE: Final = "#E69F00"
SKY: Final = "#56B4E9"
PURPLE: Final = "#CC79A7"
BLACK: Final = "#000000"
WHITE: Final = "#FFFFFF"
GREY: Final = "#707070"

SERIES: Final = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, SKY, BLACK)
"""Colours of what is compared, in this order."""

MARKERS: Final = ("o", "s", "^", "D", "v", "P", "X")
"""Markers of what is compared, one for each colour."""

SCALE: Final = "cividis"
"""Colour map of values: brighter is more, the same to everyone."""

_DPI: Final = 110
_STYLE: Final[dict[Any, Any]] = {
    "figure.dpi": _DPI,
    "font.size": 12.0,
    "axes.titlesize": 12.0,
    "legend.fontsize": 12.0,
    "axes.formatter.use_mathtext": False,
    "image.cmap": SCALE,
    "grid.alpha": 0.3,
    "lines.linewidth": 2.0,
}


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the project's style while this context is open.

    Raises:
        ImportError: Matplotlib is not installed.
    """
    # the extra 'pictures': no need of it where nothing is drawn
    from cycler import cycler
    from matplotlib import rc_context

    with rc_context({**_STYLE, "axes.prop_cycle": cycler(color=SERIES)}):
        yield
