"""Controllers composed on the command line: every system can be trained, driven by and scored."""

from pathlib import Path

import pytest
from made_once import made_once
from typer.testing import CliRunner, Result

from macor_hil.cli import program
from macor_hil.mind.catalogue import CLUSTERERS, PLANNERS
from macor_hil.mind.map_file import load_map
from macor_hil.mind.settings import Part

FREE = "khepera://open-box?seed=1"
UNWATCHED = ("--port", FREE, "--listen", "tcp/127.0.0.1:0", "--connect", "tcp/127.0.0.1:1")
SHORT = ("--port", FREE, "--tuning", "60", "--random", "60", "--nodes", "12")

OWN = '''
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.reactive import Reactive


class Coarse(FuzzyArt):
    """Fuzzy ART with another default."""

    def __init__(self, features: int, nodes: int, vigilance: float = 0.7) -> None:
        super().__init__(features, nodes, vigilance)


class Diary(SensorimotorMap):
    """Transitions under another name."""

    def __init__(self, nodes: int, commands: int) -> None:
        super().__init__(nodes, commands)


class Reader(Reactive):
    """A reactive planner that reads the diary."""

    def __init__(self, courage: float = 0.5) -> None:
        super().__init__()
        self.memory = "diary"
'''


def call(*arguments: str) -> Result:
    return CliRunner(env={"COLUMNS": "200"}).invoke(program.app, arguments)


def done(*arguments: str) -> str:
    result = call(*arguments)
    assert result.exit_code == 0, (result.output, result.exception)
    return result.output


def refused(*arguments: str) -> str:
    result = call(*arguments)
    assert result.exit_code != 0
    return f"{result.exception}{result.output}"


@pytest.fixture(scope="module", params=CLUSTERERS.builtin)
def clustered(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of a very short training with each clusterer, and what all planners read."""
    planners = [part for name in PLANNERS.builtin for part in ("--planner", name)]

    def train(folder: Path) -> None:
        path = str(folder / "map.npz")
        done("train", *SHORT, "--map", path, "--clusterer", request.param, *planners)

    path = made_once(tmp_path_factory, f"map-of-{request.param}", train) / "map.npz"
    assert load_map(path)[0].settings.clusterer == Part(request.param)  # type: ignore[union-attr]
    return path


@pytest.mark.parametrize("planner", PLANNERS.builtin)
def test_every_planner_drives_live_by_a_map_of_every_clusterer(
    clustered: Path, planner: str
) -> None:
    drive = ("run", "--map", str(clustered), "--planner", planner, "--commands", "2")
    assert "all commands driven: 2 commands" in done(*drive, *UNWATCHED)


def test_all_planners_are_scored_on_a_map_of_every_clusterer(clustered: Path) -> None:
    table = done("trials", "--map", str(clustered), "--port", FREE, "--trials", "1")
    scored = set(PLANNERS.builtin) - {"goal"}  # it drives to where a trial is over
    for planner in scored:
        assert f"\n {planner} " in table


def test_settings_of_parts_are_kept_in_the_map(tmp_path: Path) -> None:
    settings = ("clusterer.vigilance=0.8", "eyes.sectors=8", "q-learning.gamma=0.5")
    more = [word for each in settings for word in ("--set", each)]
    memories = ("--memory", "transitions", "--memory", "q-learning", "--memory", "mine=transitions")
    path = tmp_path / "a.npz"
    eyes = ("--eyes", "receptive-fields")
    done("train", *SHORT, "--map", str(path), *eyes, *more, *memories)
    kept = load_map(path)[0].settings
    assert kept is not None
    assert (kept.clusterer, kept.eyes) == (
        Part("fuzzy-art", {"vigilance": 0.8}),
        Part("receptive-fields", {"sectors": 8}),
    )
    assert kept.memories == {
        "transitions": Part("transitions"),
        "q-learning": Part("q-learning", {"gamma": 0.5}),
        "mine": Part("transitions"),
    }


def test_a_map_for_a_planner_learns_what_it_reads(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    done("train", *SHORT, "--map", str(path), "--planner", "weak-q-learning")
    brain, _ = load_map(path)
    assert list(brain.memories) == ["weak-q-learning"]
    assert brain.settings is not None
    assert brain.settings.memories["weak-q-learning"].settings == {"gamma": 0.0}
    table = done("trials", "--map", str(path), "--port", FREE, "--trials", "1")
    assert "weak-q-learning" in table
    assert "graded" not in table
    drive = ("run", "--map", str(path), "--planner", "graded", *UNWATCHED)
    assert "reads the memory 'graded', which the map does not hold" in refused(*drive)


def test_a_file_composes_a_controller(tmp_path: Path) -> None:
    config, path = tmp_path / "controller.toml", tmp_path / "a.npz"
    config.write_text(
        f'map = "{path}"\nport = "{FREE}"\ntuning = 20\nrandom = 20\nnodes = 9\n'
        'clusterer = "neural-gas"\nplanner = ["expected"]\nset = ["eyes.sectors=8"]\n'
    )
    done("train", "--config", str(config), "--nodes", "7")
    brain, training = load_map(path)
    assert brain.clusterer.size == 7
    assert list(brain.memories) == ["transitions"]
    assert training["schedule"]["random"] == 20
    assert brain.settings is not None
    assert brain.settings.eyes.settings == {"sectors": 8}


def test_parts_of_a_file_are_used_where_they_are_allowed(tmp_path: Path) -> None:
    file, path = tmp_path / "mine.py", tmp_path / "a.npz"
    file.write_text(OWN)
    own = ("--clusterer", f"{file}:Coarse", "--memory", f"diary={file}:Diary")
    done("train", *SHORT, "--map", str(path), *own, "--planner", f"{file}:Reader")
    assert list(load_map(path, [f"{file}:Coarse", f"{file}:Diary"])[0].memories) == ["diary"]
    drive: tuple[str, ...] = ("run", "--map", str(path), "--commands", "2", *UNWATCHED)
    drive = (*drive, "--planner", f"{file}:Reader", "--set", "planner.courage=0.1")
    assert "allow that with --allow" in refused(*drive)
    allow = ("--allow", f"{file}:Coarse", "--allow", f"{file}:Diary")
    assert "2 commands" in done(*drive, *allow)
    table = ("trials", "--map", str(path), "--port", FREE, "--trials", "1")
    assert "Reader" in done(*table, "--planner", f"{file}:Reader", *allow)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--clusterer", "fuzy-art"), "no clusterer 'fuzy-art'; did you mean fuzzy-art?"),
        (("--eyes", "mine.py:Eyes"), "there is no Python file"),
        (("--memory", "a.py:Mine"), "is not NAME=PART"),
        (("--memory", "diary"), "no memory 'diary'"),
        (("--planner", "bold"), "no planner 'bold'"),
        (("--planner", "\udcff"), r"no planner '\udcff'"),
        (("--set", "clusterer.vigilance=2"), "vigilance should be less than or equal to 1"),
        (("--set", "clusterer.vigilance=\udcff"), "vigilance should be a valid string"),
        (("--set", "clusterer.rho=0.5"), "settings of FuzzyArt: rho: Extra"),
        (("--set", "nose.size=1"), "--set nose: there is no such part here; there are eyes"),
        (("--set", "planner.gamma=1"), "--set planner: there is no such part here"),
        (("--set", "vigilance=0.5"), "'vigilance=0.5' is not PART.SETTING=VALUE"),
        (("--planner", "q-learning", "--reactive", "5"), "reads the memory 'transitions'"),
    ],
)
def test_what_cannot_be_composed_is_a_sentence(
    tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    assert says in refused("train", *SHORT, "--map", str(tmp_path / "a.npz"), *arguments)
    assert list(tmp_path.iterdir()) == []


def test_help_lists_the_parts() -> None:
    text = done("train", "--help")
    for name in (*CLUSTERERS.builtin, *PLANNERS.builtin):
        assert name in text.replace("\n", "")
