"""Map files: a brain on disk, atomically written, with a version inside.

A NumPy archive: `meta` is a JSON text (format, version, settings, how it was trained), the other
entries are arrays. The same brain gives the same bytes.
"""

import io
import json
import os
import secrets
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, TypeAdapter
from pydantic_core import from_json

from macor_hil.brain import Brain, Settings
from macor_hil.errors import MacorError, MapError
from macor_hil.input_files import MIB, checked, read_arrays, read_bounded
from macor_hil.reinforcement import MOST
from protocol.text import printable

FORMAT: Final = "macor map"
VERSION: Final = 3

Array = NDArray[Any]

_MOST_BYTES: Final = 64 * MIB
"""Bytes of a map's file, and of all that is in it when it is expanded."""

_MOST_TRANSITIONS: Final = 1_000_000

_MOST_ADAPTED: Final = 2**31 - 1
"""How often a transition can have been adapted, or a command tried."""

_ROUNDING: Final = 1e-6
"""By which sums of shares may exceed what they are shares of."""

_Channel = Annotated[float, Field(ge=-10.0, le=10.0)]
_Channels = tuple[_Channel, _Channel, _Channel]


@dataclass(frozen=True, slots=True)
class _Ranges:
    """The range of each channel to which receptive fields were tuned."""

    low: _Channels
    high: _Channels


def _ascending(ranges: _Ranges) -> _Ranges:
    if any(high - low < 1e-3 for low, high in zip(ranges.low, ranges.high, strict=True)):
        raise ValueError("the range of a channel is empty")
    return ranges


@dataclass(frozen=True, slots=True)
class _Meta:
    """What is checked of a map's JSON text."""

    settings: Settings
    fields: Annotated[_Ranges, AfterValidator(_ascending)]
    training: dict[str, Any]


_META: Final = TypeAdapter(_Meta)


def save_map(path: Path, brain: Brain, training: dict[str, Any]) -> None:
    """Write a map; whoever reads the path sees the old map or the new one, whole.

    Args:
        path: where to.
        brain: what has been learned.
        training: JSON-able facts about the training, kept for readers (and to resume).

    Raises:
        MapError: the file cannot be written.
    """
    meta = {
        "format": FORMAT,
        "version": VERSION,
        "settings": asdict(brain.settings),
        "fields": {"low": brain.fields.low, "high": brain.fields.high},
        "training": training,
    }
    known = brain.map.transitions()
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        meta=np.array(json.dumps(meta, sort_keys=True)),
        weights=brain.art.weights,
        present=known.present.astype(np.int32),
        past=known.past.astype(np.int32),
        z=known.z,
        w_r=known.w_r,
        prototypes=brain.prototypes.centres,
        led_to=brain.graded.led_to,
        tried=brain.graded.tried,
        earned=brain.graded.earned,
    )
    write_atomically(path, buffer.getvalue())


def load_map(path: Path) -> tuple[Brain, dict[str, Any]]:
    """Read a map.

    Returns:
        The brain, and the facts about its training.

    Raises:
        MapError: no such file, no map, a map of another version, or one that is damaged.
    """
    try:
        arrays = read_arrays(read_bounded(path, _MOST_BYTES), _MOST_BYTES)
        meta = from_json(str(arrays.pop("meta")))
    except FileNotFoundError:
        raise MapError(
            f"there is no map {path}; train one with: macor-hil train --map {path}"
        ) from None
    except (ValueError, KeyError) as error:  # an InputError, no meta, no JSON
        raise MapError(f"{path} is not a map file: {error}") from None
    if not isinstance(meta, dict) or meta.pop("format", None) != FORMAT:
        raise MapError(f"{path} is not a map file: it does not say that it is one")
    version = meta.pop("version", None)
    if version != VERSION:
        raise MapError(
            f"{path} is a map of version {printable(str(version), 20)}, this program reads version"
            f" {VERSION}; train a new one with: macor-hil train --map {path}"
        )
    try:
        facts = checked(_META, meta)
        return _restore(facts, arrays), facts.training
    except KeyError as error:
        raise MapError(f"the map {path} is damaged: it has no {error}") from None
    except ValueError as error:
        raise MapError(f"the map {path} is damaged: {error}") from None


def write_atomically(path: Path, data: bytes, failure: type[MacorError] = MapError) -> None:
    """Replace a file by new contents, durably and in one step.

    Raises:
        MapError: the folder cannot be written to; or the other `failure` that was asked for.
    """
    # named before it is there, so that nothing that is raised in between leaves it behind
    new = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with new.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            new.replace(path)
        except BaseException:
            new.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise failure(f"cannot write {path}: {error.strerror}") from None


def _restore(meta: _Meta, arrays: dict[str, Array]) -> Brain:
    """Make the brain of a map, whose every number has been looked at.

    Raises:
        ValueError: a number is not possible, or arrays do not fit each other.
        KeyError: an array is missing.
    """
    brain = Brain(meta.settings)
    brain.fields = replace(brain.fields, low=meta.fields.low, high=meta.fields.high)
    n, m, features = brain.map.nodes, brain.map.commands, brain.fields.size

    weights = _numbers(arrays, "weights", (None, 2 * features), 0.0, 1.0)
    if len(weights) > n:
        raise ValueError(f"there are weights of {len(weights)} nodes, and {n} at most")
    brain.art.load(weights)

    present, past = (_whole(arrays, name, 0, n * m - 1) for name in ("present", "past"))
    z = _whole(arrays, "z", 1, _MOST_ADAPTED)
    w_r = _numbers(arrays, "w_r", (None,), -MOST, MOST)
    if not len(present) == len(past) == len(z) == len(w_r):
        raise ValueError("its transitions have ends, counts and evaluations of different number")
    if len(np.unique(past * (n * m) + present)) < len(past):
        raise ValueError("it has a transition twice")
    brain.map.load(present, past, z, w_r)

    # k-means in the single precision of OpenCV
    centres = _numbers(arrays, "prototypes", (n, features), -0.01, 1.01)
    brain.prototypes = replace(brain.prototypes, centres=centres)

    tried = _numbers(arrays, "tried", (n, m), 0.0, _MOST_ADAPTED)
    led_to = _numbers(arrays, "led_to", (n, m, n), 0.0, _MOST_ADAPTED)
    earned = _numbers(arrays, "earned", (n, m), -MOST * _MOST_ADAPTED, MOST * _MOST_ADAPTED)
    room = tried * (1.0 + _ROUNDING) + _ROUNDING
    if (led_to.sum(axis=2) > room).any() or (np.abs(earned) > MOST * room).any():
        raise ValueError("commands led to more, or earned more, than they were tried")
    brain.graded.load(led_to, tried, earned)
    return brain


def _numbers(
    arrays: dict[str, Array], name: str, shape: tuple[int | None, ...], low: float, high: float
) -> NDArray[np.float64]:
    """Return an array of floats of a shape (None: any length), all between two bounds."""
    array = _shaped(arrays[name], name, "f", shape)
    # no comparison holds for NaN
    if not ((array >= low) & (array <= high)).all():
        raise ValueError(f"{name} holds a number that is not between {low:g} and {high:g}")
    return array.astype(np.float64)


def _whole(arrays: dict[str, Array], name: str, low: int, high: int) -> NDArray[np.int64]:
    """Return a row of integers, all between two bounds."""
    array = _shaped(arrays[name], name, "i", (None,))
    if len(array) > _MOST_TRANSITIONS:
        raise ValueError(f"it has {len(array):,} transitions, and {_MOST_TRANSITIONS:,} are read")
    if not ((array >= low) & (array <= high)).all():
        raise ValueError(f"{name} holds a number that is not between {low} and {high}")
    return array.astype(np.int64)


def _shaped(array: Array, name: str, kind: str, shape: tuple[int | None, ...]) -> Array:
    fits = array.ndim == len(shape) and all(
        wanted in (None, side) for wanted, side in zip(shape, array.shape, strict=True)
    )
    if array.dtype.kind != kind or not fits:
        raise ValueError(f"{name} is of {array.dtype} and shape {array.shape}, not as settings say")
    return array
