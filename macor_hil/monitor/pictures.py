"""Pictures in the form of the paper's figures; needs the extra 'pictures' (Matplotlib)."""

from collections.abc import Mapping
from math import cos, degrees, sin
from pathlib import Path
from typing import Any

from khepera_protocol.extras import how_to_install
from khepera_protocol.zenoh.payloads import Outline

from macor_hil.arrays import Image
from macor_hil.errors import MacorError
from macor_hil.mind.eyes.opponent import CHANNELS
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.runs.trials import Trial


def draw_trials(path: Path, outline: Outline, trials: Mapping[str, Trial]) -> None:
    """Draw one trial of each planner: the path in the arena, the reinforcement below (figure 3).

    Circles mark the robot after every command, the last one red after a collision.

    Args:
        path: where the PNG goes.
        outline: the arena.
        trials: a trial by the name to print above it.

    Raises:
        MacorError: Matplotlib is not installed.
    """
    figure_type = _figure()
    figure = figure_type(figsize=(4.2 * len(trials), 5.6), layout="constrained")
    axes = figure.subplots(2, len(trials), squeeze=False, height_ratios=[4, 1], sharey="row")
    for column, (name, trial) in enumerate(trials.items()):
        above, below = axes[0][column], axes[1][column]
        draw_way(above, outline, trial)
        end = "collision" if trial.collided else "no collision"
        above.set_title(f"{name}: {trial.length} commands, {end}", fontsize=10)
        steps = range(1, trial.length + 1)
        below.bar(steps, trial.reinforcement, width=0.8, color="tab:blue")
        below.set(xlabel="command", ylim=(0.0, 1.0), xlim=(0.0, 41.0))
        if column == 0:
            below.set_ylabel("reinforcement")
            above.set_ylabel("y in m")
        above.set_xlabel("x in m")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


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
    panorama = eyes.unwrap(image)
    features = eyes.fields(panorama).reshape(-1, len(CHANNELS)).T
    figure = _figure()(figsize=(9.0, 5.0), layout="constrained")
    shape = [["mirror", "panorama"], ["mirror", "fields"]]
    axes = figure.subplot_mosaic(shape, width_ratios=[1, 1.6], height_ratios=[1.2, 1])
    axes["mirror"].imshow(image[..., ::-1])
    axes["mirror"].set_title("mirror image, straight ahead is up", fontsize=10)
    axes["mirror"].axis("off")
    extent = (
        180.0,
        -180.0,
        degrees(eyes.mirror.low),
        degrees(eyes.mirror.high),
    )
    axes["panorama"].imshow(panorama[..., ::-1], extent=extent, aspect="auto")
    axes["panorama"].set_title("panorama", fontsize=10)
    axes["panorama"].set_ylabel("elevation")
    shown = axes["fields"].imshow(
        features, extent=(180.0, -180.0, 2.5, -0.5), aspect="auto", vmin=0.0, vmax=1.0, cmap="gray"
    )
    axes["fields"].set_title("receptive fields", fontsize=10)
    axes["fields"].set_yticks(range(len(CHANNELS)), CHANNELS)
    figure.colorbar(shown, ax=axes["fields"])
    for name in ("panorama", "fields"):
        axes[name].set_xticks(range(180, -181, -90))
        axes[name].set_xlabel("azimuth, left positive")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def draw_way(axes: Any, outline: Outline, trial: Trial, width: float = 1.0) -> None:
    """Draw the arena and the robot after every command; the last one red after a collision."""
    from matplotlib.patches import Circle, Polygon

    axes.set_facecolor(outline.floor)
    for solid in outline.solids:
        axes.add_patch(Polygon(solid.corners, facecolor=solid.colour, edgecolor="none"))
    radius = outline.robot_radius
    for number, pose in enumerate(trial.path):
        hit = trial.collided and number == len(trial.path) - 1
        colour = "red" if hit else "white"
        place = (pose.x, pose.y)
        axes.add_patch(Circle(place, radius, fill=False, edgecolor=colour, linewidth=width))
        nose = pose.x + radius * cos(pose.heading), pose.y + radius * sin(pose.heading)
        axes.plot([pose.x, nose[0]], [pose.y, nose[1]], color=colour, linewidth=width)
    axes.set_aspect("equal")
    axes.autoscale_view()


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
