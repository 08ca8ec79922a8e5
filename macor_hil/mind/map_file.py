"""Map files: a brain on disk, atomically written, with a version inside.

A NumPy archive: `meta` is a JSON text (format, version, settings, how it was trained), the other
entries are the states of the brain's parts, such as `clusterer/weights` and
`memories/graded/led_to`. The same brain gives the same bytes. Maps of version 3 are read, too.
"""

import io
import json
import os
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter, ValidationError

from macor_hil.arrays import Array, State
from macor_hil.errors import MacorError, MapError
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.settings import MindSettings, Part

FORMAT: Final = "macor map"
VERSION: Final = 4
_OLDER: Final = 3

_SETTINGS = TypeAdapter(MindSettings)


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
    arrays: dict[str, Any] = {
        f"{where}/{name}": value
        for where, part in _parts(brain).items()
        for name, value in part.state().items()
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, meta=np.array(json.dumps(meta)), **arrays)
    write_atomically(path, buffer.getvalue())


def load_map(path: Path) -> tuple[Brain, dict[str, Any]]:
    """Read a map.

    Returns:
        The brain, and the facts about its training.

    Raises:
        MapError: no such file, no map, or a map of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            meta = json.loads(str(archive["meta"]))
            arrays = {name: archive[name] for name in archive.files if name != "meta"}
    except FileNotFoundError:
        raise MapError(
            f"there is no map {path}; train one with: macor-hil train --map {path}"
        ) from None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise MapError(f"{path} is not a map file: {error}") from None
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        raise MapError(f"{path} is not a map file: it does not say that it is one")
    version = meta.get("version")
    if version not in (_OLDER, VERSION):
        raise MapError(
            f"{path} is a map of version {version}, this program reads version {VERSION},"
            f" and {_OLDER}; train a new one with: macor-hil train --map {path}"
        )
    try:
        if version == _OLDER:
            meta, arrays = _updated(meta, arrays)
        return _restore(meta["settings"], arrays), meta["training"]
    except (KeyError, TypeError, ValueError, IndexError, ValidationError) as error:
        raise MapError(f"the map {path} is damaged: {error}") from None


def write_atomically(path: Path, data: bytes, failure: type[MacorError] = MapError) -> None:
    """Replace a file by new contents, durably and in one step.

    Raises:
        MapError: the folder cannot be written to; or the other `failure` that was asked for.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise failure(f"cannot write {path}: {error.strerror}") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise failure(f"cannot write {path}: {error.strerror}") from None


def _parts(brain: Brain) -> dict[str, Any]:
    """Name everything in a brain that has a state."""
    memories = {f"memories/{name}": memory for name, memory in brain.memories.items()}
    return {"eyes": brain.eyes, "clusterer": brain.clusterer, **memories}


def _restore(settings: Any, arrays: Mapping[str, Array]) -> Brain:
    brain = build_brain(_SETTINGS.validate_python(settings))
    for where, part in _parts(brain).items():
        prefix = f"{where}/"
        part.load(
            {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
        )
    return brain


def _updated(meta: dict[str, Any], arrays: Mapping[str, Array]) -> tuple[dict[str, Any], State]:
    """Turn a map of version 3, which had one clusterer and two memories, into one of today."""
    old = meta["settings"]
    settings = MindSettings(
        nodes=old["nodes"],
        eyes=Part("receptive-fields", {"sectors": old["sectors"], "panorama": old["panorama"]}),
        clusterer=Part("fuzzy-art", {"vigilance": old["vigilance"], "alpha": old["alpha"]}),
        memories={
            "transitions": Part("transitions", {"competence": old["competence"]}),
            "graded": Part("graded", {"width": old["width"]}),
        },
    )
    renamed = {"clusterer/weights": arrays["weights"]}
    renamed |= {f"eyes/{name}": np.array(meta["fields"][name]) for name in ("low", "high")}
    for memory, names in (
        ("transitions", ("past", "present", "z", "w_r")),
        ("graded", ("prototypes", "led_to", "tried", "earned")),
    ):
        renamed |= {f"memories/{memory}/{name}": arrays[name] for name in names}
    updated = asdict(settings) | {
        "reinforcement": old["reinforcement"],
        "mirror": old["mirror"],
    }
    return {**meta, "settings": updated}, renamed
