"""The interface of eyes."""

from typing import Protocol, runtime_checkable

from khepera_protocol.mirror import Mirror

from macor_hil.arrays import Array, Image, State


class Eyes(Protocol):
    """Turn pictures into features x in [0, 1]^M.

    A class of eyes is made with the keyword `mirror` if its constructor has it: the geometry of
    the camera's mirror. All its other parameters are settings, with defaults.
    """

    @property
    def size(self) -> int:
        """Number of features M."""
        ...

    @property
    def raw_size(self) -> int:
        """Number of untuned features R."""
        ...

    @property
    def mirror(self) -> Mirror | None:
        """Geometry of the mirror that they look into; None: they look into none."""
        ...

    @property
    def picture_size(self) -> tuple[int, int] | None:
        """Width and height of the pictures that they can look at; None: any."""
        ...

    def look(self, image: Image) -> Array:
        """Return the untuned features of a picture, shape (R,).

        Raises:
            CameraError: the picture does not fit these eyes.
        """
        ...

    def tuned(self, raw: Array) -> Array:
        """Return the features x in [0, 1], shape (..., M), of untuned ones, shape (..., R)."""
        ...

    def tune(self, raw: Array) -> None:
        """Fit the eyes to what a first drive showed: untuned features, shape (frames, R)."""
        ...

    def mirrored(self, x: Array) -> Array:
        """Return the features of the mirror image of the world, both of shape (..., M)."""
        ...

    def look_through(self, mirror: Mirror) -> None:
        """Use another mirror than the one they were tuned with; eyes without one change nothing."""
        ...

    def state(self) -> State:
        """Return what tuning has changed, as named arrays."""
        ...

    def load(self, state: State) -> None:
        """Take over a stored state.

        Raises:
            ValueError, KeyError: it does not fit these eyes.
        """
        ...


@runtime_checkable
class FloorSeeing(Protocol):
    """Eyes that also tell where the floor ends, in so many directions, and what stands there.

    Attributes:
        directions: evenly around the robot, the first one behind its left side, clockwise.
    """

    directions: int

    def floor(self, raw: Array) -> Array:
        """Return the inverse distance of the floor's end in each direction.

        Args:
            raw: untuned features, shape (..., R).

        Returns:
            Shape (..., directions), in units of the camera's inverse height above the floor.
        """
        ...

    def sights(self, raw: Array) -> Array:
        """Return what stands around the robot, see `eyes.sights`.

        Args:
            raw: untuned features, shape (..., R).

        Returns:
            Shape (..., 24, 5).
        """
        ...
