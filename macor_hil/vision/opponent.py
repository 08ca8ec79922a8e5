"""Opponent colours: black-white, red-green and blue-yellow.

The paper transforms the camera's picture into a physiological colour space (its reference:
Pomierski and Gross 1996) without printing the transformation. Chosen here: the three axes of
opponent-process theory as plain differences of the camera's channels, each in [0, 1] with 0.5 for
"neither". Differences cancel white light, so red-green and blue-yellow hardly move with exposure.
"""

import numpy as np
from numpy.typing import NDArray

from macor_hil.vision.unwrap import Image

CHANNELS = ("black-white", "red-green", "blue-yellow")

# rows: the three axes; columns: blue, green, red as OpenCV orders them
_AXES = np.array(
    [[1 / 3, 1 / 3, 1 / 3], [0.0, -0.5, 0.5], [-0.5, 0.25, 0.25]], dtype=np.float32
) / np.float32(255)
_NEUTRAL = np.array([0.0, 0.5, 0.5], dtype=np.float32)


def opponent_colours(image: Image) -> NDArray[np.float32]:
    """The three opponent channels of a picture, shape (height, width, 3), each in [0, 1]."""
    colours: NDArray[np.float32] = image.astype(np.float32) @ _AXES.T + _NEUTRAL
    return colours
