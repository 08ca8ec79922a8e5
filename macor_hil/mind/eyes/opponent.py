"""Opponent colours: black-white, red-green and blue-yellow.

The paper transforms the camera's picture into a physiological colour space (its reference:
Pomierski and Gross 1996) without printing the transformation. Chosen here: the three axes of
opponent-process theory as plain differences of the camera's channels, each in [0, 1] with 0.5 for
"neither". Differences cancel white light, so red-green and blue-yellow hardly move with exposure.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

CHANNELS = ("black-white", "red-green", "blue-yellow")

# rows: the three axes; columns: blue, green, red as OpenCV orders them
_AXES = np.array([[1 / 3, 1 / 3, 1 / 3], [0.0, -0.5, 0.5], [-0.5, 0.25, 0.25]]) / 255
_NEUTRAL = np.array([0.0, 0.5, 0.5])


def opponent_colours(colours: NDArray[Any]) -> NDArray[np.float64]:
    """Return the three opponent channels of colours in OpenCV's order, 0 to 255.

    Args:
        colours: blue, green and red on the last axis, shape (..., 3).

    Returns:
        The channels on the last axis, same shape, each in [0, 1].
    """
    channels: NDArray[np.float64] = colours @ _AXES.T + _NEUTRAL
    return channels
