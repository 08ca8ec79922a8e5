"""Map files: whole or not at all, and refused with a sentence when they are no use."""

import json
from pathlib import Path

import numpy as np
import pytest
from as_type import as_type
from hypothesis import given, settings
from hypothesis import strategies as st

from macor_hil.errors import MapError
from macor_hil.files import write_atomically
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.experience import Experience
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.settings import MindSettings, Part


def a_brain() -> Brain:
    art = Part("fuzzy-art", {"vigilance": 0.85})
    brain = build_brain(MindSettings(nodes=7, clusterer=art))
    rng = np.random.default_rng(3)
    for _ in range(20):
        brain.clusterer.present(rng.uniform(size=brain.eyes.size))
    known = as_type(SensorimotorMap, brain.memories["transitions"])
    for _ in range(200):
        past, present = rng.integers(known.size, size=2).tolist()
        known.adapt(past, present, float(rng.uniform()))
    seen = rng.uniform(size=(50, brain.eyes.size))
    seen = np.pad(seen, ((0, 0), (0, brain.eyes.raw_size - brain.eyes.size)), constant_values=0.5)
    brain.tune(seen, rng)
    before, after = (brain.perceive(raw, 1, learn=False) for raw in seen[:2])
    graded = brain.memories["graded"]
    graded.learn(Experience(before, 1, after, brain.earned(1, collided=False), False))
    return brain


def knows_the_same(again: Brain, brain: Brain) -> None:
    assert as_type(PanoramaEyes, again.eyes).fields == as_type(PanoramaEyes, brain.eyes).fields
    assert (
        as_type(FuzzyArt, again.clusterer).weights == as_type(FuzzyArt, brain.clusterer).weights
    ).all()
    for name, memory in again.memories.items():
        for what, array in memory.state().items():
            assert (array == brain.memories[name].state()[what]).all(), what
    x = np.full(36, 0.3)
    assert again.clusterer.present(x, learn=False) == brain.clusterer.present(x, learn=False)


def test_a_map_comes_back_as_it_was(tmp_path: Path) -> None:
    brain = a_brain()
    save_map(tmp_path / "a.npz", brain, {"place": "here"})
    again, training = load_map(tmp_path / "a.npz")
    assert training == {"place": "here"}
    assert again.settings == brain.settings
    assert list(again.memories) == list(brain.memories)
    knows_the_same(again, brain)


def test_a_map_of_the_version_before_is_read(tmp_path: Path) -> None:
    again, training = load_map(Path(__file__).with_name("maps") / "version-3.npz")
    assert training == {"place": "here"}
    assert list(again.memories) == ["transitions", "graded"]
    assert again.settings is not None
    assert again.settings.nodes == 7
    knows_the_same(again, a_brain())
    save_map(tmp_path / "a.npz", again, training)
    knows_the_same(load_map(tmp_path / "a.npz")[0], again)


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
        ({"settings": {"nodes": 5}}, "damaged"),
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
        write_atomically(tmp_path / "folder", b"new", MapError)
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]
