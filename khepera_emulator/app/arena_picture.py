"""An arena drawn from above into a file, with its starts and where random starts lie."""

from itertools import pairwise
from math import atan2, cos, degrees, hypot, sin
from pathlib import Path
from textwrap import fill
from typing import Any, Final

from khepera_protocol import palette
from khepera_protocol.extras import how_to_install
from khepera_protocol.palette import drawing_style
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import Arena, Point
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA, Model
from khepera_emulator.ports.paths import check_output
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import pose_of
from khepera_emulator.world.outline import outline

FORMATS: Final = (".png", ".jpg", ".jpeg", ".svg", ".pdf")
"""Suffixes of pictures' names."""

_WIDTH = 4.8
"""Inches of the picture's longer side."""

_LETTERS = 9.0
"""Letters of a title in an inch."""

_MARGIN = 0.05
"""Metres of floor around everything."""

_LAMP_GLOW = (0.015, 0.03)
"""Radii in metres of the rings that stand for a lamp's light."""


def draw_arena(arena: Arena, path: Path, model: Model = KHEPERA) -> None:
    """Draw an arena from above.

    Args:
        arena: what to draw.
        path: file to write, its form as its name ends; see `FORMATS`.
        model: the robot that is drawn at each start.

    Raises:
        EmulatorError: Matplotlib is not installed, or the file cannot be written.
    """
    check_output(path, FORMATS)
    figure_type = _figure()
    with drawing_style():
        figure = _drawn(figure_type, arena, model)
    try:
        figure.savefig(path, format=path.suffix.lower().removeprefix("."))
    except OSError as error:
        raise EmulatorError(f"cannot write {path}: {error.strerror}") from None


def _drawn(figure_type: Any, arena: Arena, model: Model) -> Any:
    figure, axes = _canvas(figure_type, arena)
    drawing = outline(arena, model)
    _draw_free_strip(axes, arena)
    for lamp in arena.lamp:
        _draw_lamp(axes, lamp.centre, lamp.power)
    for solid in drawing.solids:
        axes.fill(*zip(*solid.corners, strict=True), color=solid.colour, linewidth=0, zorder=3)
    for number, start in enumerate([arena.start, *arena.starts], 1):
        _draw_robot(axes, pose_of(start), model.radius)
        if arena.starts:
            axes.annotate(
                str(number), (start.x, start.y), ha="right", va="top", zorder=8, color="white"
            )
    # long titles wrap where the drawing is narrow
    letters = max(int(figure.get_figwidth() * _LETTERS), 1)
    axes.set_title(fill(arena.title, letters), parse_math=False)
    return figure


def _figure() -> Any:
    try:
        # the Figure class alone: no window system, no global state
        from matplotlib.figure import Figure
    except ImportError:
        raise EmulatorError(
            "drawing needs Matplotlib, which is not installed; install the extra 'pictures' with:"
            f" {how_to_install('pictures')}"
        ) from None
    return Figure


def _canvas(figure_type: Any, arena: Arena) -> tuple[Any, Any]:
    from matplotlib.ticker import MaxNLocator

    (x0, y0), (x1, y1) = _bounds(arena)
    width, height = x1 - x0 + 2 * _MARGIN, y1 - y0 + 2 * _MARGIN
    scale = _WIDTH / max(width, height)
    # room for the title and the numbers at the axes
    figure = figure_type(figsize=(max(width * scale, 3.0) + 0.8, height * scale + 1.0))
    figure.set_layout_engine("constrained")
    axes = figure.add_subplot()
    axes.set_facecolor(arena.floor)
    axes.set_aspect("equal")
    axes.set_xlim(x0 - _MARGIN, x1 + _MARGIN)
    axes.set_ylim(y0 - _MARGIN, y1 + _MARGIN)
    axes.set(xlabel="x in m", ylabel="y in m")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(5))
    return figure, axes


def _bounds(arena: Arena) -> tuple[Point, Point]:
    """Lower left and upper right corner of all that is drawn, in metres."""
    corners = list(FloorPlan(arena).bounds()) if arena.wall or arena.cylinder else []
    corners += [(start.x, start.y) for start in (arena.start, *arena.starts)]
    corners += [lamp.centre for lamp in arena.lamp] + [thing.centre for thing in arena.object]
    xs, ys = zip(*corners, strict=True)
    return (min(xs), min(ys)), (max(xs), max(ys))


def _draw_free_strip(axes: Any, arena: Arena) -> None:
    from matplotlib.patches import Rectangle

    # one even colour, also where two stretches overlap
    lighter = [0.85 * share + 0.15 for share in arena.floor]
    for (x0, y0), (x1, y1) in pairwise(arena.free.points):
        length, half = hypot(x1 - x0, y1 - y0), arena.free.half_width
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        axes.add_patch(
            Rectangle(
                (x0 + half * uy, y0 - half * ux),
                length,
                2 * half,
                angle=degrees(atan2(uy, ux)),
                color=lighter,
                linewidth=0,
                zorder=1,
            )
        )


def _draw_lamp(axes: Any, centre: tuple[float, float], power: float) -> None:
    from matplotlib.patches import Circle

    for radius in _LAMP_GLOW:
        axes.add_patch(
            Circle(
                centre, radius * power**0.5, color=palette.ORANGE, alpha=0.4, linewidth=0, zorder=2
            )
        )
    axes.plot(*centre, marker="*", color=palette.ORANGE, markersize=14, zorder=5)


def _draw_robot(axes: Any, pose: Pose, radius: float) -> None:
    from matplotlib.patches import Circle

    axes.add_patch(Circle((pose.x, pose.y), radius, facecolor="white", edgecolor="black", zorder=6))
    axes.plot(
        [pose.x, pose.x + 2 * radius * cos(pose.heading)],
        [pose.y, pose.y + 2 * radius * sin(pose.heading)],
        color=palette.VERMILION,
        linewidth=2.5,
        zorder=7,
    )
