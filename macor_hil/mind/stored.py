"""Checks of arrays that come from a file: shape, kind, and every number within its bounds."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from macor_hil.arrays import Array, Indices

MOST_COUNTED: Final = 2**31 - 1
"""Greatest number of times that a transition can have been adapted, or a command tried."""

MOST_EARNED: Final = 1000.0
"""Greatest reinforcement, either way."""

_LONGEST: Final = 1_000_000


def numbers(
    state: Mapping[str, NDArray[Any]],
    name: str,
    shape: tuple[int | None, ...],
    low: float,
    high: float,
) -> Array:
    """Return an array of floats of a shape (None: any length), all between two bounds.

    Raises:
        ValueError, KeyError: it is another, or not there.
    """
    array = _shaped(state[name], name, "f", shape)
    # no comparison holds for NaN
    if not ((array >= low) & (array <= high)).all():
        raise ValueError(f"{name} holds a number that is not between {low:g} and {high:g}")
    return array.astype(np.float64)


def whole(state: Mapping[str, NDArray[Any]], name: str, low: int, high: int) -> Indices:
    """Return a row of integers, all between two bounds.

    Raises:
        ValueError, KeyError: it is another, or not there.
    """
    array = _shaped(state[name], name, "i", (None,))
    if len(array) > _LONGEST:
        raise ValueError(f"{name} has {len(array):,} numbers, and {_LONGEST:,} are read")
    if not ((array >= low) & (array <= high)).all():
        raise ValueError(f"{name} holds a number that is not between {low} and {high}")
    return array.astype(np.int64)


def _shaped(
    array: NDArray[Any], name: str, kind: str, shape: tuple[int | None, ...]
) -> NDArray[Any]:
    fits = array.ndim == len(shape) and all(
        wanted in (None, side) for wanted, side in zip(shape, array.shape, strict=True)
    )
    if array.dtype.kind != kind or not fits:
        raise ValueError(f"{name} is of {array.dtype} and shape {array.shape}, not as settings say")
    return array
