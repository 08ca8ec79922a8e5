"""Map files: whole or not at all, and refused with a sentence when they are no use."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planning import square

from macor_hil.brain import Brain, Settings
from macor_hil.errors import MapError
from macor_hil.map_file import load_map, save_map, write_atomically


def a_brain() -> Brain:
    brain = Brain(Settings(nodes=7, vigilance=0.85))
    rng = np.random.default_rng(3)
    for _ in range(20):
        brain.art.present(rng.uniform(size=brain.fields.size))
    for _ in range(200):
        brain.map.learn(*rng.integers(brain.map.size, size=2).tolist(), float(rng.uniform()))
    seen = rng.uniform(size=(50, 36))
    brain.tune(seen, rng)
    brain.experience(seen[0], 1, seen[1], collided=False)
    return brain


def test_a_map_comes_back_as_it_was(tmp_path: Path) -> None:
    brain = a_brain()
    save_map(tmp_path / "a.npz", brain, {"place": "here"})
    again, training = load_map(tmp_path / "a.npz")
    assert training == {"place": "here"}
    assert again.settings == brain.settings
    assert again.fields == brain.fields
    assert (again.art.weights == brain.art.weights).all()
    assert (square(again.map, "z") == square(brain.map, "z")).all()
    assert (square(again.map, "w_r") == square(brain.map, "w_r")).all()
    assert (again.prototypes.centres == brain.prototypes.centres).all()
    assert again.prototypes.width == brain.prototypes.width
    for name in ("led_to", "tried", "earned"):
        assert (getattr(again.graded, name) == getattr(brain.graded, name)).all()
    x = np.full(36, 0.3)
    assert again.art.present(x, learn=False) == brain.art.present(x, learn=False)


def test_the_same_brain_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        save_map(tmp_path / name, a_brain(), {})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def change_meta(path: Path, **changes: object) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    meta = json.loads(str(arrays["meta"])) | changes
    np.savez(path.open("wb"), **{**arrays, "meta": np.array(json.dumps(meta))})


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"version": 99}, "version 99"),
        ({"format": "cake"}, "not a map file"),
        ({"settings": {"nodes": "many"}}, "damaged"),
        ({"fields": {}}, "damaged"),
    ],
)
def test_other_contents_are_refused(tmp_path: Path, changes: dict[str, object], says: str) -> None:
    path = tmp_path / "a.npz"
    save_map(path, a_brain(), {})
    change_meta(path, **changes)
    with pytest.raises(MapError, match=says):
        load_map(path)


def test_a_missing_map_says_how_to_get_one(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="macor-hil train --map"):
        load_map(tmp_path / "none.npz")


@given(cut=st.integers(0, 4000), junk=st.binary(max_size=40))
@settings(max_examples=60, deadline=None)
def test_damaged_files_are_refused(
    tmp_path_factory: pytest.TempPathFactory, cut: int, junk: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    save_map(path, a_brain(), {})
    whole = path.read_bytes()
    path.write_bytes(whole[: cut % len(whole)] + junk)
    with pytest.raises(MapError):
        load_map(path)


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(MapError, match="cannot write"):
        write_atomically(tmp_path / "folder", b"new")
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]
