"""Experiments from recording to report, with tiny settings."""

import ast
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from as_type import as_type
from made_once import made_once
from planning import square

from macor_hil.cli import scoring
from macor_hil.errors import MacorError
from macor_hil.experiments import catalogue
from macor_hil.experiments.catalogue import EXPERIMENTS, find
from macor_hil.experiments.drives import training_drive as recording_module
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.training_drive import (
    PUT_DOWN,
    Drive,
    Recording,
    Recordings,
    record,
)
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.paper.figure2 import FIGURE2
from macor_hil.experiments.paper.figure3 import FIGURE3
from macor_hil.experiments.paper.figure4 import FIGURE4
from macor_hil.experiments.paper.figure5 import FIGURE5
from macor_hil.experiments.paper.table1 import TABLE1, with_planners
from macor_hil.experiments.report.elements import Table
from macor_hil.experiments.results import code_digest as sources
from macor_hil.experiments.results.code_digest import bare_code, code_of, digest
from macor_hil.experiments.results.store import ResultsFile, only_one
from macor_hil.experiments.sweep.runner import COSTS, report, reproduce
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.catalogue import build_brain, whereabouts
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.clusterers.neural_gas import Breadth
from macor_hil.mind.memories.graded import GradedMemory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.training import Schedule, Session, Trainer

DRIVE = Drive(tuning=10, random=24, reactive=6, brain=MindSettings(nodes=8))
COURSE = Course(trials=2, commands=2)


def silent(*_: object) -> None:
    """Nobody watches."""


def tiny(experiment: Experiment, **changes: object) -> Experiment:
    settings = replace(experiment.settings, drive=DRIVE, nodes=8, course=COURSE, **changes)
    return replace(experiment, settings=settings, courses=None)


def untold(experiment: Experiment) -> Experiment:
    """The same trials without pictures and text."""
    return replace(experiment, draw=lambda *_: {}, tell=lambda *_: [])


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    folder = made_once(
        tmp_path_factory, "recordings", lambda folder: Recordings(folder, DRIVE).make(1)
    )
    return Recordings(folder, DRIVE)


@pytest.fixture(scope="module")
def recording(recordings: Recordings) -> Recording:
    return recordings[1]


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Table 1 and figure 5 of three seeds."""
    experiments = [tiny(TABLE1), tiny(FIGURE5)]
    return made_once(
        tmp_path_factory, "table1", lambda out: reproduce(experiments, 3, 1, out, silent)
    )


@pytest.fixture
def recorded(sweep: Path, tmp_path: Path) -> Path:
    """A folder in which only the recordings of these seeds are."""
    shutil.copytree(sweep / "recordings", tmp_path / "recordings")
    return tmp_path


def results_of(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (out / "results").iterdir()}


def test_a_recording_holds_every_command(recording: Recording) -> None:
    driven = recording.commands != PUT_DOWN
    assert driven.sum() == DRIVE.random + DRIVE.reactive
    assert recording.commands[0] == PUT_DOWN
    assert not recording.collided[~driven].any()
    assert recording.inputs.shape == (len(recording.commands), 36)
    assert recording.inputs.min() >= 0.0
    assert recording.inputs.max() <= 1.0
    assert recording.frames_of(1) == 2
    assert recording.frames_of(10_000) == len(driven)
    # a command of 2.1 cm takes well over half a second
    assert recording.robot_seconds > 0.5 * 40


def test_learning_from_a_recording_gives_the_map_of_a_live_training(recording: Recording) -> None:
    schedule = DRIVE.schedule(1)
    live = build_brain(DRIVE.brain)
    with open_hardware(DRIVE.port(1)) as hardware:
        driver = Driver(hardware.robot)
        trainer = Trainer(live, driver, hardware.camera, hardware.bench, schedule)
        for session in schedule.sessions():
            trainer.run(session, lambda _: None)
    again = build_brain(DRIVE.brain)
    again.eyes.load(live.eyes.state())
    as_type(GradedMemory, again.memories["graded"]).situations = as_type(
        GradedMemory, live.memories["graded"]
    ).situations
    again.relive(recording.seen())
    assert (
        as_type(FuzzyArt, again.clusterer).weights == as_type(FuzzyArt, live.clusterer).weights
    ).all()
    known = as_type(SensorimotorMap, live.memories["transitions"])
    learned = as_type(SensorimotorMap, again.memories["transitions"])
    assert (square(learned, "z") == square(known, "z")).all()
    assert (square(learned, "w_r") == square(known, "w_r")).all()
    assert square(learned, "w_c") == pytest.approx(square(known, "w_c"))
    for name, memory in again.memories.items():
        for what, array in memory.state().items():
            assert (array == live.memories[name].state()[what]).all(), (name, what)


def test_a_recording_is_kept(recordings: Recordings, recording: Recording) -> None:
    assert recordings.has(1)
    assert not recordings.has(2)
    again = recordings[1]
    assert (again.raw == recording.raw).all()
    assert again.robot_seconds == recording.robot_seconds
    other = Recordings(recordings.folder.parent, replace(DRIVE, random=25))
    assert not other.has(1)


@pytest.mark.parametrize("stop_at", [1, 2, 3, 4])
def test_an_interrupted_drive_goes_on_and_is_recorded_as_if_it_had_not_been(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop_at: int
) -> None:
    monkeypatch.setattr(recording_module, "_KEPT_EVERY", 2)
    monkeypatch.setattr(Drive, "schedule", in_many_sessions)
    whole, halved = (Recordings(tmp_path / name, DRIVE) for name in ("whole", "halved"))
    whole.make(1)
    driven: list[int] = []
    run = Trainer.run

    def interrupted(trainer: Trainer, session: Session, *rest: Any) -> None:
        if len(driven) == stop_at:
            driven.append(-1)
            raise KeyboardInterrupt
        driven.append(session.number)
        run(trainer, session, *rest)

    monkeypatch.setattr(Trainer, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        halved.make(1)
    halved.make(1)
    again = stop_at % 2  # what was driven since the last checkpoint
    assert len(driven) - 1 == len(DRIVE.schedule(1).sessions()) + again
    files = {path.name: path.read_bytes() for path in whole.folder.iterdir()}
    assert {path.name: path.read_bytes() for path in halved.folder.iterdir()} == files


def in_many_sessions(drive: Drive, seed: int) -> Schedule:
    return Schedule(drive.tuning, drive.random, drive.reactive, session=8, seed=seed)


@pytest.mark.long
def test_drives_with_a_common_beginning_are_those_driven_in_one_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = DRIVE.schedule(1).session
    longer = replace(DRIVE, random=session + 8, reactive=0)
    other = replace(DRIVE, random=session, reactive=8)
    whole = {drive: record(drive, 1) for drive in (longer, other)}
    monkeypatch.setattr(recording_module, "SHARED", session)
    assert Recordings(tmp_path, longer).beginnings is not None
    for drive, at_once in whole.items():
        recordings = Recordings(tmp_path, drive)
        pieced = recordings[1]
        for name in ("raw", "commands", "collided"):
            assert (getattr(pieced, name) == getattr(at_once, name)).all(), name
        assert (
            as_type(FuzzyArt, pieced.brain.clusterer).weights
            == as_type(FuzzyArt, at_once.brain.clusterer).weights
        ).all()
        for name, memory in pieced.brain.memories.items():
            for what, array in memory.state().items():
                assert (array == at_once.brain.memories[name].state()[what]).all(), (name, what)
        assert pieced.robot_seconds == pytest.approx(at_once.robot_seconds, abs=0.1)
        # the beginning was driven once, for both
        assert recordings.beginnings is not None
        assert recordings.beginnings.folder == tmp_path / recordings.beginnings.key
    assert len(list(tmp_path.iterdir())) == 3


def test_reinforcement_follows_what_commands_earn(recording: Recording) -> None:
    r = recording.reinforcement(Reinforcement(straight=3.0, turn=2.0, collision=-1.0))
    straight = (recording.commands == 2) & ~recording.collided
    assert (r[straight] == 3.0).all()
    assert (r[recording.collided] == -1.0).all()
    assert (r[recording.commands == PUT_DOWN] == 0.0).all()


OWN_PLANNER = '''
from macor_hil.mind.planners.reactive import Reactive


class Mine(Reactive):
    """A planner of somebody's own."""
'''


def test_a_planner_of_ones_own_gets_a_row_in_table_1(
    sweep: Path, recorded: Path, tmp_path: Path
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(OWN_PLANNER)
    mine = f"{file}:Mine"
    table = replace(with_planners(tiny(TABLE1), [mine]), draw=lambda *_: {})
    shutil.copytree(sweep / "results", recorded / "results")
    before = results_of(recorded)
    page = reproduce([table], 2, 1, recorded, silent).read_text()
    assert f"{mine}, here" in page
    assert f"{mine} over anticipative" in page
    # it drives as the reactive system does, and is kept apart from the table's own results
    after = results_of(recorded)
    assert {name: after[name] for name in before} == before
    (own,) = (data for name, data in after.items() if name.startswith("planner-"))
    (line, *_) = map(json.loads, own.splitlines()[1:])
    (table_line, *_) = map(json.loads, next(iter(before.values())).splitlines()[1:])
    assert line["result"]["trials"][mine] == table_line["result"]["trials"]["reactive"]
    file.write_text(OWN_PLANNER + "CHANGED = True\n")
    reproduce([table], 1, 1, recorded, silent)
    assert len(results_of(recorded)) == len(after) + 1


def test_a_planner_gets_a_row_in_no_other_table() -> None:
    with pytest.raises(MacorError, match="--planner adds rows to table1"):
        catalogue.with_planners([FIGURE2], ["graded"])
    with pytest.raises(MacorError, match="no planner 'bold'"):
        catalogue.with_planners([TABLE1], ["bold"])
    with pytest.raises(MacorError, match="reads the memory 'foresight', which the systems"):
        catalogue.with_planners([TABLE1], ["foresight"])


def test_results_are_json_lines_by_seed(sweep: Path) -> None:
    ((name, data),) = results_of(sweep).items()
    assert name.startswith("table1-")
    header, *lines = map(json.loads, data.splitlines())
    assert header["settings"]["nodes"] == 8
    assert [line["seed"] for line in lines] == [1, 2, 3]
    trials = lines[0]["result"]["trials"]
    assert [len(done) for done in trials.values()] == [2] * 6
    for done in trials.values():
        assert len(done[0]["path"]) == len(done[0]["r"]) + 1 <= 3


@pytest.mark.long
def test_any_number_of_workers_gives_the_same_bytes(sweep: Path, recorded: Path) -> None:
    # two are recorded by two processes, the third is there
    for path in (recorded / "recordings").glob("*/seed-000[12].frames.npz"):
        path.unlink()
    reproduce([untold(tiny(TABLE1))], 3, 2, recorded, silent)
    assert results_of(recorded) == results_of(sweep)


def test_a_broken_off_sweep_goes_on_and_does_nothing_twice(sweep: Path, recorded: Path) -> None:
    done: list[str] = []

    def stop(what: str, count: int, _: int) -> None:
        done.append(what)
        if (what, count) == ("table1", 2):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce([untold(tiny(TABLE1))], 3, 1, recorded, stop)
    (path,) = (recorded / "results").iterdir()
    assert len(path.read_bytes().splitlines()) == 3
    with path.open("ab") as file:
        file.write(b'{"seed": 3, "resu')  # a kill in mid-line
    again: list[tuple[str, int, int]] = []
    reproduce([untold(tiny(TABLE1))], 3, 1, recorded, lambda *said: again.append(said))
    told = [("report", 0, 1), ("report", 1, 1)]
    assert again == [("table1", 0, 1), ("table1", 1, 1), *told]
    assert results_of(recorded) == results_of(sweep)
    costs = [json.loads(line) for line in (recorded / COSTS).read_text().splitlines()]
    assert sorted((c["what"], c["seed"]) for c in costs) == [("table1", k) for k in (1, 2, 3)]


@pytest.mark.long
def test_more_seeds_are_added_to_those_that_are_there(sweep: Path, recorded: Path) -> None:
    reproduce([untold(tiny(TABLE1))], 2, 1, recorded, silent)
    reproduce([untold(tiny(TABLE1))], 3, 1, recorded, silent)
    assert results_of(recorded) == results_of(sweep)


def test_what_is_done_is_told_without_a_drive(sweep: Path, tmp_path: Path) -> None:
    shutil.copytree(sweep / "results", tmp_path / "results")
    with only_one(tmp_path):  # while another process goes on with it
        said: list[tuple[str, int, int]] = []
        page = report(
            [untold(FIGURE2), tiny(TABLE1)], 30, tmp_path, lambda *what: said.append(what)
        )
    assert said == [
        *(("reading", done, 2) for done in range(3)),
        *(("report", done, 1) for done in range(2)),
    ]
    text = page.with_name("report.md").read_text()
    assert "in 3 trainings of" in text
    assert FIGURE2.title not in text
    assert not (tmp_path / "recordings").exists()


def test_where_nothing_is_done_nothing_is_told(tmp_path: Path) -> None:
    with pytest.raises(MacorError, match="holds no result of table1 under these settings; leave"):
        report([untold(tiny(TABLE1))], 30, tmp_path, silent)
    assert not list(tmp_path.iterdir())


def test_other_settings_never_mix(sweep: Path, recorded: Path) -> None:
    shutil.copytree(sweep / "results", recorded / "results")
    reproduce([untold(tiny(TABLE1, gamma=0.5))], 1, 1, recorded, silent)
    before, after = results_of(sweep), results_of(recorded)
    assert len(after) == len(before) + 1
    assert before.items() <= after.items()


def test_results_of_something_else_are_refused(tmp_path: Path) -> None:
    file = ResultsFile(tmp_path, "table1", DRIVE, "code")
    file.write({1: {"a": 1}})
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes().replace(b'"code":"code"', b'"code":"other"'))
    with pytest.raises(MacorError, match="holds results of something else"):
        file.read()
    path.write_bytes(b"flour\n")
    with pytest.raises(MacorError, match="is damaged"):
        file.read()


def test_two_sweeps_never_write_to_one_folder(tmp_path: Path) -> None:
    with only_one(tmp_path), pytest.raises(MacorError, match="another sweep"):
        reproduce([untold(tiny(TABLE1))], 1, 1, tmp_path, silent)


def test_comments_and_docstrings_do_not_count_as_code() -> None:
    plain = bare_code("def f(x):\n    return x + 1\n")
    assert bare_code('def f(x):\n    """Adds."""\n    return (x + 1)  # one\n') == plain
    assert bare_code("def f(x):\n    return x + 2\n") != plain


def test_what_type_checkers_alone_see_does_not_count_as_code() -> None:
    plain = bare_code("import a\n")
    assert bare_code("import a\nif TYPE_CHECKING:\n    import b\n") == plain
    assert bare_code("import a\nif TESTING:\n    import b\n") != plain


def test_the_code_of_a_drive_is_without_what_starts_robots_for_tests() -> None:
    assert not any(".testing" in module or ".app" in module for module in code_of(record))


OURS = ("khepera_protocol", "khepera_emulator", "macor_hil")

REPORTS = {
    "khepera_protocol.palette",
    "macor_hil.experiments.experiment",
    "macor_hil.experiments.paper.avoidance",
    "macor_hil.experiments.report",
    "macor_hil.experiments.report.elements",
    "macor_hil.experiments.report.drawing",
    "macor_hil.experiments.report.rows",
    "macor_hil.experiments.report.statistics",
    "macor_hil.monitor",
    "macor_hil.monitor.pictures",
}
"""Modules that experiments draw and tell with."""


def loaded_by(program: str) -> set[str]:
    """Modules of this project that a program has imported at its end."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return {name for name in done.stdout.split() if name.partition(".")[0] in OURS}


def test_all_code_counts_that_a_drive_loads() -> None:
    loaded = loaded_by(
        "from macor_hil.hardware.devices import open_hardware; import macor_hil.runs.training\n"
        "with open_hardware('khepera://corridor') as h: h.camera.grab(), h.bench.truth()"
    )
    assert "khepera_emulator.world.world" in loaded
    assert loaded <= set(code_of(record))


@pytest.mark.parametrize("name", ["figure3", "sensitivity", "beyond", "peers"])
def test_all_code_counts_that_an_experiment_loads_but_its_report(name: str) -> None:
    (experiment,) = (each for each in EXPERIMENTS if each.name == name)
    loaded = loaded_by(f"import {experiment.trial.__module__}")
    assert "macor_hil.runs.training" in loaded
    counted = set(code_of(experiment.trial, whereabouts(experiment.settings.drive.brain)))
    table = {"macor_hil.experiments.paper", "macor_hil.experiments.paper.criteria"}
    assert loaded - counted <= REPORTS | table
    assert not counted & REPORTS


def test_arenas_count_as_code_does() -> None:
    assert digest(record, ["corridor"]) != digest(record, ["corridor-mirror"])
    with pytest.raises(MacorError, match="no arena 'moon'"):
        digest(record, ["moon"])


def extended(text: str) -> str:
    return f"{text}\nEXTENDED = 1\n"


def longer(name: str) -> Callable[[str], str]:
    """Puts a statement into a function."""
    return lambda text: re.sub(
        rf"(def {name}\(.*?\) -> .*?:\n)", r"\1    longer = 1\n", text, flags=re.DOTALL
    )


@pytest.mark.parametrize(
    ("file", "edit", "drives", "results"),
    [
        ("khepera_emulator/body/motors.py", extended, True, True),
        ("khepera_emulator/ports/protocol_khepera.py", extended, True, True),
        ("macor_hil/mind/brain.py", extended, True, True),
        ("macor_hil/runs/training.py", extended, True, True),
        ("macor_hil/experiments/drives/training_drive.py", longer("record"), True, True),
        ("macor_hil/experiments/drives/course.py", extended, False, True),
        ("macor_hil/experiments/drives/systems.py", longer("learn_all"), False, True),
        ("macor_hil/mind/planners/expected.py", extended, False, True),
        ("macor_hil/mind/memories/q_map.py", extended, False, True),
        ("macor_hil/experiments/paper/table1.py", longer("trial"), False, True),
        ("macor_hil/experiments/paper/table1.py", longer("draw"), False, False),
        ("macor_hil/experiments/paper/figure5.py", longer("tell"), False, False),
        ("macor_hil/experiments/paper/placing.py", extended, False, False),
        ("macor_hil/experiments/paper/table1.py", extended, False, False),
        ("macor_hil/experiments/report/drawing.py", extended, False, False),
        ("macor_hil/experiments/report/statistics.py", extended, False, False),
        ("macor_hil/experiments/sweep/pages.py", extended, False, False),
        ("macor_hil/experiments/paper/figure2.py", longer("trial"), False, False),
        ("macor_hil/mind/clusterers/neural_gas.py", extended, False, False),
        ("macor_hil/monitor/pictures.py", extended, False, False),
        ("macor_hil/telemetry/ros2/bridge.py", extended, False, False),
        ("macor_hil/telemetry/publisher.py", extended, False, False),
        ("macor_hil/monitor/terminal_view.py", extended, False, False),
        ("macor_hil/cli/learning.py", extended, False, False),
        ("khepera_emulator/app/cli/commands.py", extended, False, False),
        ("khepera_emulator/ports/tcp.py", extended, False, False),
        ("macor_hil/mind/brain.py", "# a comment\n{}".format, False, False),
    ],
)
def test_edits_lead_to_new_drives_and_results_where_they_decide_something(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    file: str,
    edit: Callable[[str], str],
    drives: bool,
    results: bool,
) -> None:
    def keys() -> tuple[str, str]:
        settings = TABLE1.settings
        uses = whereabouts(settings.drive.brain)
        return digest(record, ["corridor"], uses), digest(TABLE1.trial, ["corridor"], uses)

    before = keys()
    for package in OURS:
        source = sources._folder(package)
        shutil.copytree(source, tmp_path / package, ignore=shutil.ignore_patterns("*.pyc"))
    monkeypatch.setattr(sources, "_folder", lambda package: tmp_path / package)
    assert keys() == before
    path = tmp_path / file
    edited = edit(path.read_text())
    assert edited != path.read_text()
    path.write_text(edited)
    after = keys()
    assert (after[0] != before[0], after[1] != before[1]) == (drives, results)


def test_a_definition_brings_what_it_uses_and_nothing_else() -> None:
    text = """
import a, b
from c import d as e, f
if a: x = 1
LIMIT = 3
OTHER = f()
THIRD = [y for y in b]
class Base: pass
class Kind(Base):
    def go(self): return LIMIT
def wanted(y: Kind): return e(y)
def unwanted(): return wanted(OTHER) + b
"""
    reached = sources._reached(sources._statements(text), "wanted")
    shown = [ast.unparse(ast.fix_missing_locations(statement)) for statement in reached]
    assert [line.partition("\n")[0] for line in shown] == [
        "import a",
        "from c import d as e",
        "if a:",
        "LIMIT = 3",
        "class Base:",
        "class Kind(Base):",
        "def wanted(y: Kind):",
    ]


class Page(HTMLParser):
    """Collects the pictures and checks that all tags are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.pictures: list[str] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.pictures.append(dict(attrs)["src"] or "")
        elif tag not in ("meta", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_report_shows_every_picture_and_the_paper_s_numbers(sweep: Path) -> None:
    page = Page((sweep / "report" / "index.html").read_text())
    assert page.open == []
    assert page.pictures == ["table1-lengths.png", "figure5-trajectories.png"]
    for name in page.pictures:
        picture = cv2.imread(str(sweep / "report" / name))
        assert picture is not None
        assert np.ptp(picture) > 200
    for number in ("29.2", "14.2", "15.6", "8.6", "11.7"):
        assert number in page.text


def test_the_report_in_markdown_says_the_same(sweep: Path) -> None:
    page = Page((sweep / "report" / "index.html").read_text())
    text = (sweep / "report" / "report.md").read_text()
    assert re.findall(r"!\[[^]]*\]\(([^)]+)\)", text) == page.pictures
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert len(rows) > 20
    shown = page.text.replace("\N{NO-BREAK SPACE}", " ")
    for row in rows:
        for cell in row.strip("| ").split(" | "):
            assert cell in shown or cell == "---"


def test_numbers_in_cells_of_the_page_stay_with_their_units_and_intervals(sweep: Path) -> None:
    page = Page((sweep / "report" / "index.html").read_text())
    assert re.search(r"\d\N{NO-BREAK SPACE}%", page.text)
    assert re.search(r"\d \(-?[\d.]+\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}[\d.]+\)", page.text)


def test_figure2_measures_both_clusterers(recorded: Path) -> None:
    settings = replace(
        FIGURE2.settings,
        drive=DRIVE,
        inputs=30,
        nodes=4,
        presentations=3,
        annealed=2,
        breadth=Breadth((0.3, 0.6), (0.05,), (2.0,), (0.1,)),
        searched=2,
    )
    page = reproduce([replace(FIGURE2, settings=settings)], 2, 1, recorded, silent)
    (data,) = (v for k, v in results_of(recorded).items() if k.startswith("figure2-"))
    result = json.loads(data.splitlines()[1])["result"]
    assert result["situations"] <= 4
    assert [len(result["errors"][name]["mean"]) for name in ("Fuzzy ART", "Neural Gas")] == [3, 3]
    assert Page(page.read_text()).pictures == ["figure2-errors.png"]
    *_, found, _ = FIGURE2.tell(settings, {1: result})
    assert isinstance(found, Table)
    rate, *others = found.rows[0][1:5]
    assert rate in ("0.3", "0.6")
    assert others == ["0.05", "2.0", "0.1"]


def test_figures_3_and_4_drive_with_both_clusterers(recorded: Path) -> None:
    changes = {
        "gas_inputs": 30,
        "breadth": Breadth((0.3,), (0.05,), (2.0, 4.0), (0.1,)),
        "elsewhere": replace(COURSE, anywhere=True),
    }
    experiments = [tiny(FIGURE3, **changes), tiny(FIGURE4, **changes)]
    page = Page(reproduce(experiments, 1, 1, recorded, silent).read_text())
    assert page.pictures == ["figure3-trajectories.png", "figure4-trajectories.png"]
    assert "32.7" in page.text
    (data,) = (v for k, v in results_of(recorded).items() if k.startswith("figure3-"))
    result = json.loads(data.splitlines()[1])["result"]
    places = [trial["path"][0] for trial in result["anywhere"]["Fuzzy ART"]]
    assert places[0] != places[1]
    assert places == [trial["path"][0] for trial in result["anywhere"]["Neural Gas"]]
    # from the arena's start: within its spread of 1 cm to either side
    assert all(abs(trial["path"][0][1]) < 0.015 for trial in result["start"]["Neural Gas"])


def test_names_lead_to_experiments() -> None:
    assert find("all") == tuple(e for e in EXPERIMENTS if e.peer is None)
    assert find("figure5") == (FIGURE5,)
    with pytest.raises(MacorError, match="no experiment 'figure9'; give one of"):
        find("figure9")


def test_the_command_line_names_the_page(
    recorded: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(catalogue, "EXPERIMENTS", (untold(tiny(TABLE1)),))
    scoring.reproduce(name="all", seeds=1, workers=1, out=recorded)
    said = capsys.readouterr()
    assert said.out == f"{recorded / 'report' / 'index.html'}\n"
    assert "table1" in said.err
    page = Path(said.out.strip())
    before = page.read_bytes()
    page.unlink()
    scoring.reproduce(name="all", seeds=7, out=recorded, kept=True)
    assert page.read_bytes() == before
