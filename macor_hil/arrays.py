"""Types of arrays; shapes are said where they are used."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]
Levels = NDArray[np.float32]
"""Grey levels that are counted with."""

Image = NDArray[np.uint8]
"""Picture of shape (height, width, 3), channels in OpenCV's order blue, green, red."""

State = dict[str, NDArray[Any]]
"""State of a part, as named arrays."""
