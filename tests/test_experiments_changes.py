"""Experiments with other settings than their own, and how `reproduce` takes them and ends."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest
from typer.testing import CliRunner

from macor_hil.cli import app, scoring
from macor_hil.errors import MacorError
from macor_hil.experiments.beyond import BEYOND
from macor_hil.experiments.catalogue import EXPERIMENTS, find
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.goals import GOALS
from macor_hil.experiments.paper.figure2 import FIGURE2
from macor_hil.experiments.paper.figure3 import FIGURE3
from macor_hil.experiments.paper.table1 import TABLE1
from macor_hil.experiments.peers import PEERS
from macor_hil.experiments.suite.arenas import ARENAS
from macor_hil.experiments.sweep.changes import in_arena, quick, with_settings


def test_every_experiment_without_a_peer_has_a_quick_form() -> None:
    for experiment in quick(find("all")):
        assert experiment.settings == experiment.quick
        assert type(experiment.quick) is type(experiment.settings)
        assert experiment.settings.drive.random <= 4_000 < Drive().random / 3
    with pytest.raises(MacorError, match="no quick form of peers"):
        quick([PEERS])


def test_settings_are_changed_by_their_names() -> None:
    (table,) = with_settings([TABLE1], ["nodes=30", "drive.random=2000", "course.light=dim"])
    assert table.settings == replace(
        TABLE1.settings,
        nodes=30,
        drive=Drive(random=2_000),
        course=replace(TABLE1.settings.course, light="dim"),
    )
    (suite,) = with_settings([ARENAS], ["lights=[]", 'homes=[{"arena": "maze"}]'])
    assert suite.settings.lights == ()
    assert suite.settings.arenas == ("maze",)
    (deep,) = with_settings([TABLE1], ["drive.brain.clusterer.settings.vigilance=0.7"])
    assert deep.settings.drive.brain.clusterer.settings == {"vigilance": 0.7}


def test_nothing_is_changed_by_what_a_setting_is_already() -> None:
    for experiment in EXPERIMENTS:
        same = f"drive.random={experiment.settings.drive.random}"
        (again,) = with_settings([experiment], [same])
        assert again == experiment


def test_several_experiments_take_those_settings_that_they_have() -> None:
    figure, table = with_settings([FIGURE2, TABLE1], ["gamma=0.5", "drive.tuning=300"])
    assert figure.settings == replace(
        FIGURE2.settings, drive=replace(FIGURE2.settings.drive, tuning=300)
    )
    assert table.settings.gamma == 0.5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "nodse=30",
            "--set nodse: there is no such setting; did you mean nodes? there are nodes, ",
        ),
        (
            "drive.randon=3",
            "did you mean drive.random? there are drive.arena, drive.drift, drive.model,",
        ),
        ("nodes.of=3", "--set nodes.of: there is no such setting; there are none below it"),
        ("nodes", "'nodes' is not NAME=VALUE"),
        ("nodes=many", "--set nodes: nodes should be a valid integer"),
        ("nodes=0", "--set nodes: nodes should be greater than or equal to 1"),
        ("drive.random=-1", "--set drive.random: drive.random should be greater than or equal"),
        ("course.trials=0", "--set course.trials: course.trials should be greater than or equal"),
        ("course.light=pink", "course.light: there is no light 'pink'"),
        ("=3", "'=3' is not NAME=VALUE"),
    ],
)
def test_wrong_settings_are_refused_in_a_sentence(text: str, message: str) -> None:
    with pytest.raises(MacorError) as refused:
        with_settings([TABLE1], [text])
    assert message in str(refused.value)


def test_another_arena_takes_the_place_of_the_training_s(tmp_path: Path) -> None:
    table, figure, goals = in_arena([TABLE1, FIGURE3, GOALS], "maze")
    for each in (table, figure, goals):
        assert each.settings.drive.arena == "maze"
        assert set(each.settings.arenas) == {"maze"}
    assert figure.settings.elsewhere.anywhere
    (beyond,) = in_arena([BEYOND], "corridor-mirror")
    places = [(course.arena, course.anywhere) for course in beyond.settings.courses]
    assert places[:2] == [("corridor-mirror", False), ("corridor-mirror", True)]
    assert len(places) == len(set(places)) == len(BEYOND.settings.courses) - 1
    file = tmp_path / "own.toml"
    file.write_bytes(_CORRIDOR.read_bytes())
    (own,) = in_arena([TABLE1], str(file))
    assert own.settings.arenas == (str(file),)


_CORRIDOR = Path(__file__).parent.parent / "khepera_emulator" / "arenas" / "corridor.toml"


def test_arenas_that_cannot_be_driven_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MacorError, match="did you mean maze"):
        in_arena([TABLE1], "maz")
    with pytest.raises(MacorError, match="arenas has arenas of its own; name others with --set"):
        in_arena([ARENAS], "maze")
    odd = tmp_path / "50%.toml"
    odd.write_bytes(_CORRIDOR.read_bytes())
    with pytest.raises(MacorError, match="a path without %"):
        in_arena([TABLE1], str(odd))
    # beside others the suite stays as it is
    table, suite = in_arena([TABLE1, ARENAS], "maze")
    assert (table.settings.arenas, suite) == (("maze",), ARENAS)


def test_the_command_line_refuses_what_it_cannot_do() -> None:
    for options, message in (
        (["peers", "--quick"], ""),
        (["table1", "--set", "nodse=3"], "did you mean nodes?"),
        (["table1", "--arena", "maz"], "did you mean maze?"),
    ):
        done = CliRunner().invoke(cast(Any, app), ["reproduce", *options])
        assert isinstance(done.exception, MacorError)
        assert message in str(done.exception)


SWEEP = ("reproduce", "table1", "--quick", "--seeds", "1", "--workers", "2", "--out")


def test_ctrl_c_in_mid_drive_tells_how_to_go_on(tmp_path: Path) -> None:
    out = tmp_path / "sweep"
    command = [sys.executable, "-m", "macor_hil.cli", *SWEEP, str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_for(lambda: (out / "results").exists())
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.endswith(
        f"macor-hil: interrupted; what is done is kept in {out}; go on with: macor-hil"
        f" {' '.join(SWEEP)} {out}\n"
    )


INTERRUPTED = """
import os, signal, sys
from joblib.externals.loky.backend import resource_tracker
from macor_hil.cli import main

register = resource_tracker.register

def interrupted(name, kind):
    register(name, kind)
    if kind == "folder":
        os.kill(os.getpid(), signal.SIGINT)

resource_tracker.register = interrupted
sys.argv[0] = "macor-hil"
sys.exit(main())
"""


def test_how_to_go_on_is_the_last_line_also_when_workers_were_just_being_started(
    tmp_path: Path,
) -> None:
    command = [sys.executable, "-c", INTERRUPTED, *SWEEP, str(tmp_path / "sweep")]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 130
    assert done.stderr.endswith(f"go on with: macor-hil {' '.join(SWEEP)} {tmp_path / 'sweep'}\n")


def wait_for(what: Any) -> None:
    until = time.monotonic() + 60
    while not what():
        assert time.monotonic() < until
        time.sleep(0.01)


def test_where_there_is_no_terminal_every_step_is_a_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as bars:
        watch = scoring._Watch(bars)
        for done in range(3):
            watch("driving for table1", done, 2)
    assert "driving for table1: 1 of 2" in capsys.readouterr().err
