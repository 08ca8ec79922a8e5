"""Pictures: colours that the colour blind tell apart, ways cropped, one scale side by side."""

import re
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest
from khepera_protocol import palette
from khepera_protocol.palette import drawing_style
from khepera_protocol.zenoh.payloads import Outline, Pose, Solid

from macor_hil.arrays import Array
from macor_hil.monitor.pictures import trials_figure, way_windows
from macor_hil.runs.trials import Trial

ROOT = Path(__file__).parent.parent

MACHADO = {
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "trichromacy": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Linear RGB as seen, severity 1. Source: G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, "A
Physiologically-based Model for Simulation of Color Vision Deficiency", 2009, table 1."""

TOLD_APART = 10.0
"""Distance in CIELAB; 2.3 is just noticeable side by side."""


def linear(colour: str) -> Array:
    srgb = np.array([int(colour[at : at + 2], 16) for at in (1, 3, 5)]) / 255.0
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def lab(colour: str, seen_by: str) -> Array:
    """CIELAB of a colour for somebody's eyes."""
    seen = np.clip(np.array(MACHADO[seen_by]) @ linear(colour), 0.0, 1.0)
    pixel = seen.astype(np.float32).reshape(1, 1, 3)
    return np.asarray(cv2.cvtColor(pixel, cv2.COLOR_LRGB2Lab), dtype=float).ravel()


def distance(one: str, other: str, seen_by: str) -> float:
    return float(np.linalg.norm(lab(one, seen_by) - lab(other, seen_by)))


def test_the_simulation_is_that_of_the_eyes() -> None:
    # red and green of one lightness are the example that everyone knows
    assert distance("#BE3C3C", "#6E7800", "trichromacy") > 50.0
    assert distance("#BE3C3C", "#6E7800", "deuteranopia") < 25.0
    assert lab("#FFFFFF", "protanopia") == pytest.approx([100.0, 0.0, 0.0], abs=0.5)


def of_the_page(scheme: int) -> tuple[str, ...]:
    """Colours of the dashboard's page that are compared: light ones (0) or dark ones (1)."""
    style = (ROOT / "macor_hil/monitor/dashboard/page/page.css").read_text("utf-8")
    names = "best|other|good|bad|ink|faint"
    found = re.findall(rf"--(?:{names}): light-dark\((#\w{{6}}), (#\w{{6}})\)", style)
    assert len(found) == 6
    return tuple(pair[scheme] for pair in found)


COMPARED = {
    "curves": palette.SERIES,
    "ways": (palette.WHITE, palette.VERMILION, palette.SKY),
    "light dashboard": of_the_page(0),
    "dark dashboard": of_the_page(1),
}


@pytest.mark.parametrize("seen_by", MACHADO)
@pytest.mark.parametrize("what", COMPARED)
def test_colours_that_are_compared_are_told_apart(what: str, seen_by: str) -> None:
    near = {
        (one, other): distance(one, other, seen_by)
        for one, other in combinations(COMPARED[what], 2)
    }
    pair = min(near, key=near.__getitem__)
    assert near[pair] > TOLD_APART, (pair, near[pair])


@pytest.mark.parametrize("seen_by", MACHADO)
def test_curves_stand_out_from_paper(seen_by: str) -> None:
    for colour in palette.SERIES:
        assert distance(colour, "#FFFFFF", seen_by) > 3 * TOLD_APART, colour


def test_colours_of_pictures_are_those_of_the_palette() -> None:
    named = re.compile(
        r"""\b(?:color|colour|cmap|c)=["'](?!none|gray|white|black)|["'](?:tab:|C\d)"""
    )
    drawing = [
        path
        for folder in ("khepera_emulator", "macor_hil", "benchmarks", "docs")
        for path in (ROOT / folder).rglob("*.py")
        if "matplotlib" in path.read_text("utf-8")
    ]
    assert len(drawing) > 12
    for path in drawing:
        found = [line for line in path.read_text("utf-8").splitlines() if named.search(line)]
        assert not found, f"{path}: {found}"


def test_text_can_be_read_at_half_the_size() -> None:
    from matplotlib import rcParams
    from matplotlib.font_manager import FontProperties

    with drawing_style():
        for name in ("axes.titlesize", "axes.labelsize", "xtick.labelsize", "legend.fontsize"):
            points = FontProperties(size=rcParams[name]).get_size_in_points()
            assert points * rcParams["figure.dpi"] / 72 / 2 >= 9.0, name


def test_no_drawing_makes_its_text_smaller() -> None:
    smaller = re.compile(r"(?<!_)fontsize=[0-9]|labelsize=[0-9]|savefig\(.*dpi=")
    for folder in ("khepera_emulator", "macor_hil", "benchmarks"):
        for path in (ROOT / folder).rglob("*.py"):
            assert not smaller.search(path.read_text("utf-8")), path


def outline(width: float = 4.0) -> Outline:
    corners = [(0.0, 0.0), (width, 0.0), (width, 0.01), (0.0, 0.01)]
    wall = Solid(corners=corners, colour=(0.8, 0.7, 0.2))
    start = Pose(x=0.5, y=0.5, heading=0.0)
    return Outline(
        title="a wall", floor=(0.35,) * 3, solids=[wall], start=start, robot_radius=0.0275
    )


def driven(*places: tuple[float, float], collided: bool = False) -> Trial:
    poses = tuple(Pose(x=x, y=y, heading=0.0) for x, y in places)
    return Trial((0.62,) * (len(poses) - 1), collided, collided, poses)


def test_pictures_show_what_is_driven_and_not_the_whole_arena() -> None:
    here = outline()
    short, long = driven((0.5, 0.5), (0.6, 0.5)), driven((0.5, 0.5), (1.1, 0.5))
    ((x0, x1), (y0, y1)), same = way_windows([(here, short), (here, long)])
    assert ((x0, x1), (y0, y1)) == same
    assert x0 < 0.5 - 0.0275 < 1.1 + 0.0275 < x1
    assert x1 - x0 < 1.0
    assert y1 - y0 < 0.4


def test_pictures_of_several_arenas_have_one_scale() -> None:
    near = outline(), driven((0.5, 0.5), (0.6, 0.5))
    far = outline(3.0), driven((2.0, 0.5), (3.0, 1.5))
    windows = way_windows([near, far])
    sizes = {(round(x1 - x0, 9), round(y1 - y0, 9)) for (x0, x1), (y0, y1) in windows}
    assert len(sizes) == 1


def test_reinforcement_and_commands_begin_at_nothing_in_every_picture() -> None:
    one = outline(), driven((0.5, 0.5), (0.6, 0.5), collided=True)
    figure = trials_figure({"reactive": one, "graded": one})
    upper, lower = figure.axes[:2], figure.axes[2:]
    assert {axes.get_ylim() for axes in lower} == {(0.0, 1.0)}
    assert len({axes.get_xlim() for axes in lower}) == 1
    assert all(axes.get_xlim()[0] == 0.0 for axes in lower)
    assert len({axes.get_xlim() for axes in upper}) == 1
    crosses = [line for line in upper[0].lines if line.get_marker() == "x"]
    assert [line.get_color() for line in crosses] == [palette.VERMILION]
