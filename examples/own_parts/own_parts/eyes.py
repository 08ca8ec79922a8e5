"""Grey eyes: how bright it is all around, in as many sectors as are asked for."""

from typing import Annotated

import numpy as np
from khepera_protocol.mirror import Mirror
from pydantic import Field

from macor_hil.arrays import Array, Image, State
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper


class GreyEyes:
    """Mean brightness of sectors around the robot, stretched to the range of a first drive.

    Args:
        mirror: geometry of the camera's mirror.
        sectors: how many; must divide 120.
    """

    def __init__(self, mirror: Mirror, sectors: Annotated[int, Field(ge=1, le=120)] = 24) -> None:
        self._sectors = sectors
        self._low, self._high = 0.0, 255.0
        self.look_through(mirror)

    @property
    def size(self) -> int:
        """Number of features M."""
        return self._sectors

    @property
    def raw_size(self) -> int:
        """Number of untuned features R: one for each feature."""
        return self.size

    @property
    def mirror(self) -> Mirror:
        """Geometry of the camera's mirror."""
        return self._unwrap.mirror

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height that the mirror is described for."""
        return self.mirror.width, self.mirror.height

    def look_through(self, mirror: Mirror) -> None:
        """Use another mirror."""
        self._unwrap = Unwrapper(mirror, PanoramaSize())

    def look(self, image: Image) -> Array:
        """Return the mean grey level of each sector."""
        columns = self._unwrap(image).mean(axis=(0, 2))
        grey: Array = columns.reshape(self._sectors, -1).mean(axis=1)
        return grey

    def tuned(self, raw: Array) -> Array:
        """Stretch grey levels to the tuned range."""
        x: Array = np.clip((raw - self._low) / (self._high - self._low), 0.0, 1.0)
        return x

    def tune(self, raw: Array) -> None:
        """Take the range of what was seen."""
        self._low, self._high = float(raw.min()), float(raw.max()) + 1.0

    def mirrored(self, x: Array) -> Array:
        """Exchange left and right."""
        return x[..., ::-1]

    def state(self) -> State:
        """Return the tuned range."""
        return {"range": np.array([self._low, self._high])}

    def load(self, state: State) -> None:
        """Take over a tuned range."""
        low, high = np.asarray(state["range"], float).tolist()
        if not low < high:
            raise ValueError(f"{low} to {high} is not a range")
        self._low, self._high = low, high
