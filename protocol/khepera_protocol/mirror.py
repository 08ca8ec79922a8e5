"""Geometry of the omnidirectional camera, as the controller needs it to unwrap an image.

The camera looks up into an equiangular mirror: the distance of a pixel from the mirror's centre
grows linearly with elevation. Seen from above, the robot's front is up and its left is left.
"""

from dataclasses import dataclass
from math import pi, radians
from typing import Annotated, Final

from pydantic import AfterValidator, Field

_Side = Annotated[int, Field(ge=8, le=4096)]
_Place = Annotated[float, Field(ge=-4096.0, le=8192.0)]
_Radius = Annotated[float, Field(ge=0.0, le=8192.0)]
_Elevation = Annotated[float, Field(ge=-pi / 2, le=pi / 2)]

_LOW: Final = radians(-60.0)
_HIGH: Final = radians(20.0)


@dataclass(frozen=True, slots=True)
class Mirror:
    """The place of the mirror in the image, and the elevations that it shows.

    Attributes:
        width, height: size of the image in pixels.
        centre_x, centre_y: the mirror's middle, in pixels from the upper left corner.
        inner, outer: radii in pixels of the lowest and the highest elevation.
        low, high: those elevations in radians, 0 on the horizon.
    """

    width: _Side = 160
    height: _Side = 160
    centre_x: _Place = 79.5
    centre_y: _Place = 79.5
    inner: _Radius = 16.0
    outer: _Radius = 78.0
    low: _Elevation = _LOW
    high: _Elevation = _HIGH


def _in_order(mirror: Mirror) -> Mirror:
    if not (mirror.inner < mirror.outer and mirror.low < mirror.high):
        raise ValueError("the inner rim must lie within the outer one, and low below high")
    return mirror


StoredMirror = Annotated[Mirror, AfterValidator(_in_order)]
"""A mirror in a file: its measures within their bounds and in their order."""
