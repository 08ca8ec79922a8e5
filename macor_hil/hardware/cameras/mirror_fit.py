"""Search for the mirror in a picture: its centre, its rim, the rim of the camera in its middle.

The mirror is taken to be the largest bright disc before something darker, with a dark disc (the
camera's own reflection, or its hole) in its middle. Both rims are found on rays from the middle
outwards and fitted as circles, without the points that do not lie on one.
"""

from dataclasses import replace
from math import pi
from typing import Final

import cv2
import numpy as np
from khepera_protocol.mirror import Mirror
from numpy.typing import NDArray

from macor_hil.arrays import Image
from macor_hil.errors import CameraError

_RAYS: Final = 360
_ROUNDS: Final = 12
_WORST: Final = 0.03
"""Share of the radius by which rim points may lie beside their circle, median."""

_SMALLEST: Final = 0.15
"""Share of the picture's smaller side that the rim's radius has at least."""

Array = NDArray[np.float64]


def find_mirror(image: Image, shape: Mirror = Mirror()) -> Mirror:  # noqa: B008 - a value
    """Find the mirror in a picture.

    Args:
        image: a picture of the mirror, colour, of any size.
        shape: what a picture cannot tell: the lowest and the highest elevation.

    Raises:
        CameraError: no mirror is found.
    """
    bright = _bright(image)
    centre, outer = _rim(bright, _middle(bright), outwards=False)
    centre, outer = _rim(bright, centre, outwards=False)
    inner_centre, inner = _rim(bright, centre, outwards=True)
    height, width = image.shape[:2]
    if outer < _SMALLEST * min(width, height) or not 0.0 < inner < 0.8 * outer:
        raise CameraError(
            f"no mirror is found in the picture: its rims would have radii of {inner:.0f} and"
            f" {outer:.0f} pixels; light the room, or give --centre, --inner and --outer"
        )
    if np.hypot(*(inner_centre - centre)) > 0.1 * outer:
        inner = float(np.median(_crossings(bright, centre, outwards=True)[1]))
    # the rims' pixels still belong to the mirror: half a pixel to either side
    return replace(
        shape,
        width=width,
        height=height,
        centre_x=round(float(centre[0]), 2),
        centre_y=round(float(centre[1]), 2),
        inner=round(inner + 0.5, 2),
        outer=round(outer - 0.5, 2),
    )


def draw_mirror(image: Image, mirror: Mirror) -> Image:
    """Draw centre, both rims and straight ahead into the picture, three times as large."""
    scale = 3
    drawn = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)

    def place(x: float, y: float) -> tuple[int, int]:
        return round((x + 0.5) * scale), round((y + 0.5) * scale)

    middle = place(mirror.centre_x, mirror.centre_y)
    for radius in (mirror.inner, mirror.outer):
        cv2.circle(drawn, middle, round(radius * scale), (0, 255, 255), 1, cv2.LINE_AA)
    ahead = place(mirror.centre_x, mirror.centre_y - mirror.outer)
    cv2.arrowedLine(drawn, middle, ahead, (0, 255, 255), 1, cv2.LINE_AA, tipLength=0.1)
    cv2.drawMarker(drawn, middle, (0, 255, 255), cv2.MARKER_CROSS, 8 * scale)
    return np.asarray(drawn, dtype=np.uint8)


def _bright(image: Image) -> NDArray[np.bool_]:
    """Return what is brighter than its surroundings, specks removed."""
    grey = cv2.medianBlur(np.ascontiguousarray(image.max(axis=-1)), 3)
    level, _ = cv2.threshold(grey, 0, 1, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    # Otsu's level may lie amid what the mirror shows: between what is darkest of all and the bright
    dark, bright = float(np.percentile(grey, 3)), float(grey[grey >= level].mean())
    _, mask = cv2.threshold(grey, dark + 0.25 * (bright - dark), 1, cv2.THRESH_BINARY)
    return np.asarray(mask, dtype=bool)


def _middle(bright: NDArray[np.bool_]) -> Array:
    """Middle of the largest bright region."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(bright.astype(np.uint8))
    if count < 2:
        raise CameraError("no mirror is found in the picture: all of it is equally bright")
    largest = 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax())
    y, x = np.nonzero(labels == largest)
    return np.array([(x.min() + x.max()) / 2, (y.min() + y.max()) / 2])


def _rim(bright: NDArray[np.bool_], centre: Array, *, outwards: bool) -> tuple[Array, float]:
    """Circle through the first (outwards) or last bright pixel on every ray from a centre."""
    points, _ = _crossings(bright, centre, outwards=outwards)
    for _ in range(_ROUNDS):
        if len(points) < _RAYS // 8:
            break
        fitted, radius = _circle(points)
        apart = np.abs(np.hypot(*(points - fitted).T) - radius)
        if np.median(apart) <= _WORST * radius and apart.max() <= max(1.5, 0.05 * radius):
            return fitted, radius
        points = points[apart <= max(1.0, float(np.percentile(apart, 85)))]
    side = "inner" if outwards else "outer"
    raise CameraError(
        f"no mirror is found in the picture: its {side} rim is no circle; light the room, or give"
        " --centre, --inner and --outer"
    )


def _crossings(bright: NDArray[np.bool_], centre: Array, *, outwards: bool) -> tuple[Array, Array]:
    """Points (N, 2) and radii (N,) of the first or last bright pixel on the rays that have one."""
    height, width = bright.shape
    azimuth = np.arange(_RAYS) * 2 * pi / _RAYS
    radius = np.arange(0.0, float(np.hypot(width, height)), 0.25)
    x = centre[0] + radius * np.cos(azimuth)[:, None]
    y = centre[1] + radius * np.sin(azimuth)[:, None]
    columns, rows = np.rint(x).astype(int), np.rint(y).astype(int)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    lit = bright[rows.clip(0, height - 1), columns.clip(0, width - 1)] & inside
    has = lit.any(axis=1)
    first = lit.argmax(axis=1) if outwards else lit.shape[1] - 1 - lit[:, ::-1].argmax(axis=1)
    ray = np.nonzero(has)[0]
    found = first[ray]
    points = np.stack([x[ray, found], y[ray, found]], axis=1)
    # a rim at the picture's edge is where the picture ends, not the mirror
    edge = (points.min(axis=1) < 1.0) | (points[:, 0] > width - 2) | (points[:, 1] > height - 2)
    return points[~edge], radius[found][~edge]


def _circle(points: Array) -> tuple[Array, float]:
    """Least-squares circle through points (N, 2)."""
    system = np.column_stack([2 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    centre = solution[:2]
    return centre, float(np.sqrt(solution[2] + centre @ centre))
