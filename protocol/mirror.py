"""Geometry of the omnidirectional camera, as the controller needs it to unwrap an image.

The camera looks up into an equiangular mirror: the distance of a pixel from the mirror's centre
grows linearly with elevation. Seen from above, the robot's front is up and its left is left.
"""

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True, slots=True)
class Mirror:
    """Where the mirror lies in the image, and what it shows.

    Attributes:
        width, height: size of the image in pixels.
        centre_x, centre_y: the mirror's middle, in pixels from the upper left corner.
        inner, outer: radii in pixels of the lowest and the highest elevation.
        low, high: those elevations in radians, 0 on the horizon.
    """

    width: int = 160
    height: int = 160
    centre_x: float = 79.5
    centre_y: float = 79.5
    inner: float = 16.0
    outer: float = 78.0
    low: float = radians(-60.0)
    high: float = radians(20.0)
