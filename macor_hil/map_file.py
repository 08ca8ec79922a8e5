"""Map files: a brain on disk, atomically written, with a version inside.

A NumPy archive: `meta` is a JSON text (format, version, settings, how it was trained), the other
entries are arrays. The same brain gives the same bytes.
"""

import io
import json
import os
import secrets
import zipfile
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter, ValidationError

from macor_hil.brain import Brain, Settings
from macor_hil.errors import MacorError, MapError

FORMAT: Final = "macor map"
VERSION: Final = 3

_SETTINGS = TypeAdapter(Settings)


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
    if meta.get("version") != VERSION:
        raise MapError(
            f"{path} is a map of version {meta.get('version')}, this program reads version"
            f" {VERSION}; train a new one with: macor-hil train --map {path}"
        )
    try:
        return _restore(meta, arrays), meta["training"]
    except (KeyError, TypeError, ValueError, IndexError, ValidationError) as error:
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


def _restore(meta: dict[str, Any], arrays: dict[str, Any]) -> Brain:
    brain = Brain(_SETTINGS.validate_python(meta["settings"]))
    fields = meta["fields"]
    brain.fields = replace(brain.fields, low=tuple(fields["low"]), high=tuple(fields["high"]))
    weights = arrays["weights"]
    if weights.shape[1] != 2 * brain.fields.size or len(weights) > brain.settings.nodes:
        raise ValueError(f"weights of shape {weights.shape} do not fit the settings")
    brain.art.load(weights)
    brain.map.load(*(arrays[name] for name in ("present", "past", "z", "w_r")))
    prototypes = arrays["prototypes"]
    if prototypes.shape != brain.prototypes.centres.shape:
        raise ValueError(f"prototypes of shape {prototypes.shape} do not fit the settings")
    brain.prototypes = replace(brain.prototypes, centres=prototypes)
    brain.graded.load(*(arrays[name] for name in ("led_to", "tried", "earned")))
    return brain
