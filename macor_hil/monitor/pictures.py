"""Pictures in the form of the paper's figures; needs the extra 'pictures' (Matplotlib)."""

from collections.abc import Mapping, Sequence
from math import cos, degrees, sin
from pathlib import Path
from typing import Any, Final

from khepera_protocol import palette
from khepera_protocol.extras import how_to_install
from khepera_protocol.palette import drawing_style
from khepera_protocol.zenoh.payloads import Outline

from macor_hil.arrays import Image
from macor_hil.errors import MacorError
from macor_hil.mind.eyes.opponent import CHANNELS
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.runs.trials import MAX_COMMANDS, Trial

_TALL: Final = 4.2
"""Greatest height of a way's picture, in inches."""
_NARROWEST: Final = 2.5
_WIDEST: Final = 4.4
_AROUND: Final = 0.12
"""Metres shown around what the robot drove over: the nearest walls of a corridor."""


def draw_trials(path: Path, trials: Mapping[str, tuple[Outline, Trial]]) -> None:
    """Draw one trial of each planner: the path in the arena, the reinforcement below (figure 3).

    Args:
        path: where the PNG goes.
        trials: an arena and a trial in it by the name to print above it.

    Raises:
        MacorError: Matplotlib is not installed.
    """
    figure = trials_figure(trials)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def trials_figure(trials: Mapping[str, tuple[Outline, Trial]]) -> Any:
    """Return ways side by side in one scale, the reinforcement of every command below each.

    Raises:
        MacorError: Matplotlib is not installed.
    """
    figure_type = _figure()
    windows = way_windows(list(trials.values()))
    (x0, x1), (y0, y1) = windows[0]
    width = min(max(_TALL * (x1 - x0) / (y1 - y0), _NARROWEST), _WIDEST)
    most = max(MAX_COMMANDS, *(trial.length for _, trial in trials.values()))
    with drawing_style():
        figure = figure_type(
            figsize=(width * len(trials) + 0.8, min(width * (y1 - y0) / (x1 - x0), _TALL) + 2.6),
            layout="constrained",
        )
        axes = figure.subplots(2, len(trials), squeeze=False, height_ratios=[4, 1], sharey=False)
        for column, (name, (outline, trial)) in enumerate(trials.items()):
            above, below = axes[0][column], axes[1][column]
            draw_way(above, outline, trial, windows[column])
            end = "collision" if trial.collided else "no collision"
            above.set_title(f"{name}\n{trial.length} commands, {end}")
            above.set_xlabel("x in m")
            below.bar(range(1, trial.length + 1), trial.reinforcement, width=0.8)
            below.set(xlabel="command", ylim=(0.0, 1.0), xlim=(0.0, most + 1.0))
            if column == 0:
                above.set_ylabel("y in m")
                below.set_ylabel("earned")
    return figure


def draw_ahead(path: Path, image: Image) -> None:
    """Draw what a camera that looks ahead sees, enlarged.

    Args:
        path: where the PNG goes.
        image: a picture.

    Raises:
        MacorError: Matplotlib is not installed.
    """
    figure_type = _figure()
    with drawing_style():
        figure = figure_type(figsize=(5.0, 4.0), layout="constrained")
        axes = figure.subplots()
        axes.imshow(image[..., ::-1])
        axes.set_title("the robot's own camera")
        axes.axis("off")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def draw_view(path: Path, eyes: PanoramaEyes, image: Image) -> None:
    """Draw the robot's view and the features of its receptive fields.

    Args:
        path: where the PNG goes.
        eyes: to look with; their fields may be tuned or not.
        image: a mirror image.

    Raises:
        MacorError: Matplotlib is not installed.
        CameraError: the image does not fit the mirror's geometry.
    """
    figure_type = _figure()
    panorama = eyes.unwrap(image)
    features = eyes.fields(panorama).reshape(-1, len(CHANNELS)).T
    with drawing_style():
        figure = figure_type(figsize=(9.0, 5.0), layout="constrained")
        shape = [["mirror", "panorama"], ["mirror", "fields"]]
        axes = figure.subplot_mosaic(shape, width_ratios=[1, 1.6], height_ratios=[1.2, 1])
        axes["mirror"].imshow(image[..., ::-1])
        axes["mirror"].set_title("mirror image\nstraight ahead is up")
        axes["mirror"].axis("off")
        elevations = degrees(eyes.mirror.low), degrees(eyes.mirror.high)
        axes["panorama"].imshow(
            panorama[..., ::-1], extent=(180.0, -180.0, *elevations), aspect="auto"
        )
        axes["panorama"].set_title("panorama")
        axes["panorama"].set_ylabel("elevation")
        shown = axes["fields"].imshow(
            features,
            extent=(180.0, -180.0, 2.5, -0.5),
            aspect="auto",
            vmin=0.0,
            vmax=1.0,
            cmap="gray",
        )
        axes["fields"].set_title("receptive fields")
        axes["fields"].set_yticks(range(len(CHANNELS)), CHANNELS)
        figure.colorbar(shown, ax=axes["fields"])
        for name in ("panorama", "fields"):
            axes[name].set_xticks(range(180, -181, -90))
            axes[name].set_xlabel("azimuth in degrees, left positive")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


Window = tuple[tuple[float, float], tuple[float, float]]
"""Least and greatest x, least and greatest y, in metres."""


def way_windows(shown: Sequence[tuple[Outline, Trial]]) -> list[Window]:
    """Return the part of the arena that each picture shows: what is driven, and what is near.

    Trials in the same arena show the same part of it, and all parts are of one size, so that
    pictures side by side have one scale.
    """
    boxes = []
    for outline, _ in shown:
        together = [trial for other, trial in shown if other == outline]
        places = [(pose.x, pose.y) for trial in together for pose in trial.path]
        margin = outline.robot_radius + _AROUND
        boxes.append([(min(v) - margin, max(v) + margin) for v in zip(*places, strict=True)])
    width, height = (max(high - low for low, high in sides) for sides in zip(*boxes, strict=True))
    return [(_widened(x, width), _widened(y, height)) for x, y in boxes]


def _widened(side: tuple[float, float], size: float) -> tuple[float, float]:
    more = (size - (side[1] - side[0])) / 2
    return side[0] - more, side[1] + more


def draw_way(axes: Any, outline: Outline, trial: Trial, window: Window) -> None:
    """Draw a part of the arena and the robot after every command.

    The start is filled; the last circle is crossed out after a collision.
    """
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.patches import Circle, Polygon
    from matplotlib.ticker import MaxNLocator

    axes.set_facecolor(outline.floor)
    for solid in outline.solids:
        axes.add_patch(Polygon(solid.corners, facecolor=solid.colour, edgecolor="none"))
    radius = outline.robot_radius
    colours = [palette.WHITE] * len(trial.path)
    widths = [1.0] * len(trial.path)
    if trial.collided:
        colours[-1], widths[-1] = palette.VERMILION, 2.0
        end = trial.path[-1]
        axes.plot(end.x, end.y, "x", color=palette.VERMILION, markersize=12, markeredgewidth=3.0)
    bodies = [Circle((pose.x, pose.y), radius) for pose in trial.path]
    faces = [palette.SKY, *["none"] * (len(bodies) - 1)]
    noses = [
        [
            (pose.x, pose.y),
            (pose.x + radius * cos(pose.heading), pose.y + radius * sin(pose.heading)),
        ]
        for pose in trial.path
    ]
    # as collections, which are drawn faster than hundreds of circles and lines
    look: dict[str, Any] = {"edgecolors": colours, "linewidths": widths}
    axes.add_collection(PatchCollection(bodies, facecolors=faces, **look))
    axes.add_collection(LineCollection(noses, zorder=2, **look))
    axes.set_aspect("equal")
    axes.set(xlim=window[0], ylim=window[1])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))


def _figure() -> Any:
    try:
        # the Figure class alone: no window system, no global state
        from matplotlib.figure import Figure
    except ImportError:
        raise MacorError(
            "drawing needs Matplotlib, which is not installed; install the extra 'pictures' with:"
            f" {how_to_install('pictures')}"
        ) from None
    return Figure
