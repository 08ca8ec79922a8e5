"""Benchmarks that asv keeps for each commit: every ratio from what is measured, with its unit."""

import ast
import json
import math
from contextlib import ExitStack
from inspect import getmembers, isfunction
from pathlib import Path

import pytest
from planning_speed import Planning
from tracked.ratios import Medians, Ratios

FOLDER = Path(__file__).parent.parent / "benchmarks"

MEASURED: Medians = {
    "BareCalls": {"call": 1e-7},
    "Exchanges": {
        "robot chunk rate": 8_000.0,
        "bare chunk rate": 16_000.0,
        "robot cpu": 6e-5,
        "bare cpu": 1.2e-5,
    },
    "Simulation": {
        "away from walls": 1_000.0,
        "always in contact with a wall": 400.0,
        "at a wall, all eight sensors every 20 ms": 200.0,
        "a camera frame at 10 Hz": 100.0,
    },
    "Peer": {"own": 10_000.0, "other": 1_000.0},
    "TrainingCommand": {"command": 6e-3},
    "Presentations": {"learning": 2.6e-5, "pass": 1.3e-5, "peer": 2.6e-4},
    "Planning": {"15000": 2e-2},
}

EXPECTED = {
    "track_exchange": 2.0,
    "track_exchange_processor": 5.0,
    "track_step_away_from_walls": 200.0,
    "track_step_in_contact": 500.0,
    "track_step_with_sensors": 1_000.0,
    "track_camera_frame": 10_000.0,
    "track_step_beside_irsim": 0.1,
    "track_training_command": 60_000.0,
    "track_fuzzy_art": 2.0,
    "track_fuzzy_art_beside_artlib": 0.1,
    "track_plan": 200_000.0,
}


def tracked() -> dict[str, object]:
    return {n: f for n, f in getmembers(Ratios, isfunction) if n.startswith("track_")}


def test_each_ratio_is_a_time_over_a_floor_or_a_peer() -> None:
    found = {name: getattr(Ratios(), name)(MEASURED) for name in tracked()}
    assert found.keys() == EXPECTED.keys()
    for name, value in EXPECTED.items():
        assert math.isclose(found[name], value), name
    assert all(getattr(ratio, "unit", "") for ratio in tracked().values())


def test_a_peer_that_is_not_installed_gives_no_value() -> None:
    alone = {**MEASURED, "Peer": {"own": 1.0}, "Presentations": {"learning": 1.0, "pass": 1.0}}
    assert math.isnan(Ratios().track_step_beside_irsim(alone))
    assert math.isnan(Ratios().track_fuzzy_art_beside_artlib(alone))
    assert Ratios().track_fuzzy_art(alone) == 1.0


def test_what_asv_is_told_is_there() -> None:
    config = json.loads((FOLDER / "asv.conf.json").read_text("utf-8"))
    assert (FOLDER / config["benchmark_dir"] / "ratios.py").is_file()
    assert (FOLDER / config["repo"] / "pyproject.toml").is_file()
    assert all("/build/" in config[place] for place in ("env_dir", "results_dir", "html_dir"))
    # the same libraries for every commit
    assert "requirements.lock" in config["build_command"][0]


@pytest.mark.long
def test_the_greatest_map_of_the_benchmark_can_be_loaded() -> None:
    with ExitStack() as stack:
        found = Planning(stack).round()
    assert all(seconds > 0.0 for seconds in found.values())


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.py")))
def test_the_parts_that_are_timed_are_there(name: str) -> None:
    known = vars(pytest.importorskip(name))
    for node in ast.walk(ast.parse((FOLDER / f"{name}.py").read_text("utf-8"))):
        match node:
            case ast.Tuple(elts=[ast.Name(id=owner), ast.Constant(value=str(method))]):
                if isinstance(known.get(owner), type):
                    assert callable(getattr(known[owner], method, None)), f"{owner}.{method}"
