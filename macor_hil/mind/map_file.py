"""Map files: a brain on disk, atomically written, with a version inside.

A NumPy archive: `meta` is a JSON text (format, version, settings, how it was trained), the other
entries are the states of the brain's parts, such as `clusterer/weights` and
`memories/graded/led_to`. The same brain gives the same bytes. Maps of version 3 are read, too.
"""

import io
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from khepera_protocol.text import printable
from pydantic import TypeAdapter
from pydantic_core import from_json

from macor_hil.arrays import State
from macor_hil.errors import MacorError, MapError
from macor_hil.files import MIB, checked, read_arrays, read_bounded, write_atomically
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.settings import MindSettings

FORMAT: Final = "macor map"
VERSION: Final = 4
_OLDER: Final = 3

_MOST_BYTES: Final = 64 * MIB
"""Bytes of a map's file, and of all that is in it when it is expanded."""


@dataclass(frozen=True, slots=True)
class _Meta:
    """Contents of a map's JSON text."""

    settings: MindSettings
    training: dict[str, Any]


_META: Final = TypeAdapter(_Meta)
_SETTINGS: Final = TypeAdapter(MindSettings)


def save_map(path: Path, brain: Brain, training: dict[str, Any]) -> None:
    """Write a map; whoever reads the path sees the old map or the new one, whole.

    Args:
        path: where to.
        brain: what has been learned.
        training: JSON-able facts about the training, kept for readers (and to resume).

    Raises:
        MapError: the file cannot be written.
    """
    if brain.settings is None:
        raise MapError("a brain that was not built from settings cannot be saved")
    meta = {
        "format": FORMAT,
        "version": VERSION,
        "settings": _SETTINGS.dump_python(brain.settings, mode="json"),
        "training": training,
    }
    arrays: State = {
        f"{where}/{name}": value
        for where, part in _parts(brain).items()
        for name, value in part.state().items()
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, meta=np.array(json.dumps(meta)), **arrays)  # type: ignore[arg-type]
    write_atomically(path, buffer.getvalue(), MapError)


def load_map(path: Path, allowed: Collection[str] = ()) -> tuple[Brain, dict[str, Any]]:
    """Read a map.

    Args:
        path: of its file.
        allowed: parts named as `file.py:Class` or `module:Class` that it may use: code that runs.

    Returns:
        The brain, and the facts about its training.

    Raises:
        MapError: no such file, no map, a map of another version, or one that is damaged.
    """
    try:
        arrays = read_arrays(read_bounded(path, _MOST_BYTES), _MOST_BYTES)
        meta = from_json(str(arrays.pop("meta")).encode())
    except FileNotFoundError:
        raise MapError(
            f"there is no map {path}; train one with: macor-hil train --map {path}"
        ) from None
    except (ValueError, KeyError) as error:  # an InputError, no meta, no text, no JSON
        raise MapError(f"{path} is not a map file: {error}") from None
    if not isinstance(meta, dict) or meta.pop("format", None) != FORMAT:
        raise MapError(f"{path} is not a map file: it does not say that it is one")
    version = meta.pop("version", None)
    if version not in (_OLDER, VERSION):
        raise MapError(
            f"{path} is a map of version {printable(str(version), 20)}, this program reads version"
            f" {VERSION}, and {_OLDER}; train a new one with: macor-hil train --map {path}"
        )
    try:
        if version == _OLDER:
            meta, arrays = _updated(meta, arrays)
        facts = checked(_META, meta)
        return _restore(facts.settings, arrays, allowed), facts.training
    except KeyError as error:
        raise MapError(f"the map {path} is damaged: it has no {error}") from None
    except (ValueError, TypeError, AttributeError) as error:
        raise MapError(f"the map {path} is damaged: {error}") from None
    except MapError:
        raise
    except MacorError as error:
        raise MapError(f"the map {path} cannot be used: {error}") from None


def _parts(brain: Brain) -> dict[str, Any]:
    """Name everything in a brain that has a state."""
    memories = {f"memories/{name}": memory for name, memory in brain.memories.items()}
    return {"eyes": brain.eyes, "clusterer": brain.clusterer, **memories}


def _restore(settings: MindSettings, arrays: Mapping[str, Any], allowed: Collection[str]) -> Brain:
    """Make the brain of a map; each part looks at every number of its own.

    Raises:
        ValueError: a number is not possible, or arrays do not fit each other.
        KeyError: an array is missing.
        MacorError: a part is not there, may not be used, or does not take its settings.
    """
    brain = build_brain(settings, allowed)
    for where, part in _parts(brain).items():
        prefix = f"{where}/"
        part.load(
            {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
        )
    return brain


def _updated(meta: dict[str, Any], arrays: Mapping[str, Any]) -> tuple[dict[str, Any], State]:
    """Turn a map of version 3, which had one clusterer and two memories, into one of today."""
    old = meta["settings"]
    settings = {
        "nodes": old["nodes"],
        "eyes": _part("receptive-fields", old, "sectors", "panorama"),
        "clusterer": _part("fuzzy-art", old, "vigilance", "alpha"),
        "memories": {
            "transitions": _part("transitions", old, "competence"),
            "graded": _part("graded", old, "width"),
        },
        "reinforcement": old["reinforcement"],
        "mirror": old["mirror"],
    }
    renamed = {"clusterer/weights": arrays["weights"]}
    for name in ("low", "high"):
        renamed[f"eyes/{name}"] = np.array(meta["fields"][name], dtype=float)
    for memory, names in (
        ("transitions", ("past", "present", "z", "w_r")),
        ("graded", ("prototypes", "led_to", "tried", "earned")),
    ):
        renamed |= {f"memories/{memory}/{name}": arrays[name] for name in names}
    return {"settings": settings, "training": meta["training"]}, renamed


def _part(use: str, old: dict[str, Any], *names: str) -> dict[str, Any]:
    return {"use": use, "settings": {name: old[name] for name in names}}
