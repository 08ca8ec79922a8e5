"""Maps and checkpoints from outside: read, or refused in one sentence; never in mid-run."""

import io
import json
import os
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from as_type import not_none
from damage import damaged
from hostile_inputs import Hostile
from hypothesis import given, settings
from hypothesis import strategies as st
from test_map_file import a_brain

from macor_hil.errors import MapError
from macor_hil.hardware.driver import DriveSettings
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import PLANNERS, build_brain, make_planner
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.checkpoints import checkpoint_path, train_map
from macor_hil.runs.training import Schedule

MIB = 1 << 20
PEAK = 320 * MIB


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("maps") / "whole.npz"
    save_map(path, a_brain(), {"place": "here"})
    return path.read_bytes()


OLDER = Path(__file__).parents[1] / "maps" / "version-3.npz"


def members_of(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def archive_of(members: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def arrays_of(data: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(data)) as archive:
        return dict(archive)


def map_of(arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **cast(dict[str, Any], arrays))
    return buffer.getvalue()


def drive_by(brain: Brain) -> None:
    """Plan with all planners: what cannot be planned with should not have been read."""
    if not brain.clusterer.size:
        return
    now = brain.perceive(np.full(brain.eyes.raw_size, 0.3), 0, learn=False)
    for planner in map(make_planner, PLANNERS.builtin):
        if planner.memory in brain.memories:
            plan = planner.plan(brain.memories[planner.memory], now)
            assert all(value is None or np.isfinite(value) for value in plan.evaluations)


def one_sentence(error: MapError, path: Path) -> None:
    assert str(path) in str(error)
    assert str(error).isprintable()


def refused_or_good(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    try:
        brain, training = load_map(path)
    except MapError as error:
        one_sentence(error, path)
    else:
        assert isinstance(training, dict)
        drive_by(brain)


def test_damaged_copies_of_a_map(hostile: Hostile, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"

    @settings(max_examples=hostile.examples(150))
    @given(damaged(whole))
    def check(data: bytes) -> None:
        hostile.count("maps")
        refused_or_good(path, data)

    check()


def test_damaged_copies_of_a_map_of_the_version_before(hostile: Hostile, tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    members = members_of(OLDER.read_bytes())

    @settings(max_examples=hostile.examples(100))
    @given(
        st.one_of(
            damaged(OLDER.read_bytes()),
            st.sampled_from(sorted(members)).flatmap(
                lambda name: damaged(members[name]).map(
                    lambda data: archive_of({**members, name: data})
                )
            ),
        )
    )
    def check(data: bytes) -> None:
        hostile.count("maps")
        refused_or_good(path, data)

    check()


def test_maps_with_damage_behind_their_checksums(
    hostile: Hostile, whole: bytes, tmp_path: Path
) -> None:
    path, members = tmp_path / "map.npz", members_of(whole)

    @settings(max_examples=hostile.examples(150))
    @given(
        st.sampled_from(sorted(members)).flatmap(lambda n: st.tuples(st.just(n), _of(members, n)))
    )
    def check(damage: tuple[str, bytes]) -> None:
        hostile.count("maps")
        refused_or_good(path, archive_of({**members, damage[0]: damage[1]}))

    check()


def _of(members: dict[str, bytes], name: str) -> st.SearchStrategy[bytes]:
    return damaged(members[name])


def test_maps_whose_text_was_edited(hostile: Hostile, whole: bytes, tmp_path: Path) -> None:
    path, arrays = tmp_path / "map.npz", arrays_of(whole)
    meta = json.loads(str(arrays["meta"]))
    odd = st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=5),
        st.lists(st.floats(), max_size=4),
        st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
    )

    @settings(max_examples=hostile.examples(150))
    @given(st.sampled_from(sorted(_leaves(meta))), odd)
    def check(place: tuple[str, ...], value: Any) -> None:
        hostile.count("maps")
        changed = json.loads(json.dumps(meta))
        _put(changed, place, value)
        refused_or_good(path, map_of({**arrays, "meta": np.array(json.dumps(changed))}))

    check()


def test_a_map_whose_text_is_none(whole: bytes, tmp_path: Path) -> None:
    path, arrays = tmp_path / "map.npz", arrays_of(whole)
    text = str(arrays["meta"]).replace("here", "h\ud839re")
    path.write_bytes(map_of({**arrays, "meta": np.array(text)}))
    with pytest.raises(MapError, match="is not a map file"):
        load_map(path)


def _leaves(
    value: dict[str, Any] | float | str, place: tuple[str, ...] = ()
) -> Iterator[tuple[str, ...]]:
    if isinstance(value, dict):
        yield place
        for name, item in value.items():
            yield from _leaves(item, (*place, name))
    else:
        yield place


def _put(value: dict[str, Any], place: tuple[str, ...], item: Any) -> None:
    if not place:
        value.clear()
        value["settings"] = item
        return
    for name in place[:-1]:
        value = value[name]
    value[place[-1]] = item


NAN, INF = float("nan"), float("inf")
COMPETENCE = ("settings", "memories", "transitions", "settings")


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        (
            "clusterer/weights",
            lambda a: a * NAN,
            "weights holds a number that is not between 0 and 1",
        ),
        ("clusterer/weights", lambda a: a + 1.0, "weights holds a number"),
        ("clusterer/weights", lambda a: a[:, 1:], "weights is of float64 and shape"),
        ("clusterer/weights", lambda a: np.tile(a, (9, 1)), "63 nodes, and 7 at most"),
        ("clusterer/weights", lambda a: a.astype(int), "weights is of int64"),
        ("memories/graded/prototypes", lambda a: a * INF, "prototypes holds a number"),
        ("memories/graded/prototypes", lambda a: a.T, "prototypes is of"),
        ("memories/graded/tried", lambda a: -a - 1.0, "tried holds a number"),
        ("memories/graded/led_to", lambda a: a + 1e300, "led_to holds a number"),
        (
            "memories/graded/led_to",
            lambda a: a + 9.0,
            "led to more, or earned more, than they were tried",
        ),
        ("memories/graded/earned", lambda a: a - 1e5, "led to more, or earned more"),
        ("memories/transitions/w_r", lambda a: a * 1e300, "w_r holds a number"),
        ("memories/transitions/w_r", lambda a: a[1:], "not as many neurons as counts"),
        ("memories/transitions/z", lambda a: a * 0, "z holds a number that is not between 1 and"),
        ("memories/transitions/past", lambda a: a + 99, "past holds a number"),
        ("memories/transitions/present", lambda a: a - 99, "present holds a number"),
        ("memories/transitions/present", lambda a: a * 0, "a transition twice"),
        ("eyes/high", lambda a: a * 0, "the range of a channel is empty"),
        ("eyes/high", lambda a: a[1:], "high is of float64 and shape"),
        ("eyes/low", lambda a: a * NAN, "low holds a number"),
    ],
)
def test_impossible_numbers_are_refused_when_a_map_is_read(
    whole: bytes, tmp_path: Path, name: str, change: Callable[..., Any], says: str
) -> None:
    arrays = arrays_of(whole)
    path = tmp_path / "map.npz"
    path.write_bytes(map_of({**arrays, name: change(arrays[name])}))
    with pytest.raises(MapError, match=f"the map .* is damaged: .*{says}"):
        load_map(path)


@pytest.mark.parametrize(
    ("place", "value", "says"),
    [
        (COMPETENCE, {"competence": {"w_max": 2.0}}, r"w_max should be less than 1"),
        (COMPETENCE, {"competence": {"w_max": NAN}}, "w_max should be"),
        (COMPETENCE, {"competence": {"sigma": 0.0}}, "sigma should be"),
        (COMPETENCE, {"competance": {}}, "competance: Extra inputs are not permitted"),
        (("settings", "nodes"), 13_000, "nodes should be less than or equal to 1000"),
        (("settings", "nodes"), 0, "nodes should be"),
        (("settings", "clusterer", "settings"), {"vigilance": -1.0}, "vigilance should be"),
        (("settings", "memories", "graded", "settings"), {"width": 0.0}, "width should be"),
        (("settings", "eyes", "settings"), {"sectors": 10**9}, "sectors should be"),
        (
            ("settings", "eyes", "settings"),
            {"panorama": {"columns": 10**9}},
            "panorama.columns should be",
        ),
        (("settings", "eyes", "use"), "no-such-eyes", "there is no kind of eyes 'no-such-eyes'"),
        (("settings", "eyes", "use"), "os:system", "code of its own, os:system"),
        (("settings", "memories", "graded", "use"), "/tmp/x.py:X", "code of its own, /tmp/x.py:X"),
        (("settings", "mirror", "outer"), 3.0, "the inner rim must lie within the outer one"),
        (("settings", "mirror", "centre_x"), INF, "centre_x should be"),
        (("settings", "reinforcement", "turn"), INF, "turn should be"),
        (("settings", "colour"), 1, "colour: Unexpected keyword argument"),
        (("training",), [1], "training should be an object"),
    ],
)
def test_impossible_settings_are_refused_when_a_map_is_read(
    whole: bytes,
    tmp_path: Path,
    place: tuple[str, ...],
    value: dict[str, dict[str, float]],
    says: str,
) -> None:
    arrays = arrays_of(whole)
    meta = json.loads(str(arrays["meta"]))
    _put(meta, place, value)
    path = tmp_path / "map.npz"
    path.write_bytes(map_of({**arrays, "meta": np.array(json.dumps(meta))}))
    with pytest.raises(MapError, match=says):
        load_map(path)


def npy_of(shape: tuple[int, ...] | str, kind: str = "<f8", data: bytes = b"") -> bytes:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + data


def lying_archive(size: int, stated: int) -> bytes:
    """Zeros, as a member that says it has another size."""
    data = bytearray(archive_of({"weights.npy": npy_of((size,), "|u1", bytes(size))}))
    at = data.rindex(b"PK\x01\x02") + 24
    data[at : at + 4] = stated.to_bytes(4, "little")
    return bytes(data)


@pytest.mark.parametrize(
    "bomb",
    [
        lambda: archive_of({"meta.npy": bytes(80 * MIB)}),
        lambda: lying_archive(80 * MIB, 100),
        lambda: archive_of({f"{k}.npy": bytes(30 * MIB) for k in range(3)}),
        lambda: archive_of({"weights.npy": npy_of((1 << 20, 1 << 20))}),
        lambda: archive_of({"weights.npy": npy_of("9" * 5000)}),
        lambda: archive_of({"weights.npy": npy_of("(" * 5000)}),
        lambda: archive_of({"weights.npy": npy_of((4,), "|O", b"cos\nsystem\n.")}),
        lambda: archive_of({"meta.npy": b"x"}, zipfile.ZIP_LZMA),
        lambda: archive_of({"meta.npy": b"x"}, zipfile.ZIP_BZIP2),
        lambda: map_of({"meta": np.array("[" * 100_000)}),
        lambda: map_of({"meta": np.array('{"a":' + "9" * 5000 + "}")}),
        lambda: map_of({"meta": np.array("x" * 100)}),
        lambda: map_of({"meta": np.zeros(8 * MIB // 8)}),
    ],
)
def test_what_expands_without_end_is_refused_before_it_is_expanded(
    tmp_path: Path, bomb: Callable[..., Any]
) -> None:
    path = tmp_path / "bomb.npz"
    path.write_bytes(bomb())
    tracemalloc.start()
    try:
        with pytest.raises(MapError, match="is not a map file"):
            load_map(path)
        assert tracemalloc.get_traced_memory()[1] < PEAK
    finally:
        tracemalloc.stop()


def test_a_large_map_takes_no_more_than_its_bounds_allow(tmp_path: Path) -> None:
    brain = build_brain(MindSettings(nodes=1000))
    save_map(tmp_path / "large.npz", brain, {"seen": [[0.25] * 36] * 2000})
    tracemalloc.start()
    try:
        load_map(tmp_path / "large.npz")
        assert tracemalloc.get_traced_memory()[1] < PEAK
    finally:
        tracemalloc.stop()


def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(MapError, match=r"not a regular file|Is a directory"):
            load_map(path)


SCHEDULE = Schedule(tuning=20, random=30, session=10)
# nothing of it is ever used but the settings
HARDWARE: Any = (SimpleNamespace(settings=DriveSettings()), None, None)
FACTS = {"place": "here", "schedule": asdict(SCHEDULE), "drive": asdict(DriveSettings())}


@pytest.mark.parametrize(
    "facts",
    [
        {},
        {"sessions": -1},
        {"sessions": 5},
        {"sessions": "two"},
        {"sessions": 1.5},
        {"sessions": None},
        {"sessions": [1]},
        {"sessions": 10**30},
        {"sessions": 1, "done": -1},
        {"sessions": 1, "done": 10},
        {"sessions": 4, "done": 1},
        {"sessions": 1, "done": 2, "seen": [[0.5] * 36] * 2},
        {"sessions": 0, "done": 2},
        {"sessions": 0, "done": 2, "seen": [[0.5] * 36]},
        {"sessions": 0, "done": 2, "seen": [[0.5] * 35] * 2},
        {"sessions": 0, "done": 1, "seen": [[NAN] * 36]},
        {"sessions": 0, "done": 1, "seen": [["x"] * 36]},
        {"sessions": 0, "done": 1, "seen": 7},
        {"sessions": 1, "spam": 1},
    ],
)
def test_odd_checkpoints_are_refused_before_anything_is_driven(
    tmp_path: Path, facts: dict[str, int]
) -> None:
    path = tmp_path / "map.npz"
    brain = build_brain(MindSettings(nodes=7))
    known = json.loads(json.dumps(FACTS, default=str))
    save_map(checkpoint_path(path), brain, {**known, **facts})
    with pytest.raises(MapError, match="begin anew with --restart"):
        train_map(path, not_none(brain.settings), SCHEDULE, "here", HARDWARE, lambda _: None)
    assert not path.exists()


def test_a_checkpoint_with_other_settings_is_another_training(tmp_path: Path) -> None:
    path = tmp_path / "map.npz"
    brain = build_brain(MindSettings(nodes=7))
    save_map(checkpoint_path(path), brain, {**FACTS, "sessions": 0})
    other = replace(not_none(brain.settings), nodes=8)
    with pytest.raises(MapError, match="settings differ"):
        train_map(path, other, SCHEDULE, "here", HARDWARE, lambda _: None)
