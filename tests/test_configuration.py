"""One file of options for a program, what wins over what, and logs as text and JSON."""

import json
import logging
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from khepera_protocol.config_file import check_file, commands_of
from khepera_protocol.logs import LogFormat, LogLevel, LogOptions, logs_json, set_up_log
from khepera_protocol.options import OptionError
from typer.main import get_command
from typer.testing import CliRunner

from khepera_emulator.app.cli.commands import app as emulator
from macor_hil.cli import program
from macor_hil.cli.ending import Status
from macor_hil.cli.program import app as controller

APPS = {"khepera-emulator": emulator, "macor-hil": controller}
WIDE = {"COLUMNS": "300", "TERM": "dumb"}


def call(app: typer.Typer, *arguments: str, **environment: str) -> str:
    done = CliRunner().invoke(app, arguments, env={**WIDE, **environment})
    assert done.exit_code == 0, done.output
    return done.output


def written(folder: Path, text: str) -> str:
    (folder / "options.toml").write_text(text)
    return str(folder / "options.toml")


@pytest.mark.parametrize("name", APPS)
def test_what_is_printed_can_be_used(name: str, tmp_path: Path) -> None:
    text = call(APPS[name], "config", "--print")
    said = call(APPS[name], "config", "--check", written(tmp_path, text))
    tables = re.findall(r"^\[([\w-]+)\]$", text, re.MULTILINE)
    assert said == f"{tmp_path}/options.toml can be used by {', '.join(tables)}\n"
    assert call(APPS[name], "config", "--check", str(tmp_path / "options.toml"), "--print") == text


@pytest.mark.parametrize(
    ("text", "command"),
    [
        ("seed = 3", "run"),
        ('clusterer = "neural-gas"\nnodes = 30', "train"),
        ("host = '127.0.0.1'", "dashboard"),
    ],
)
def test_options_without_a_table_are_checked_as_those_of_a_command_that_has_them(
    tmp_path: Path, text: str, command: str
) -> None:
    file = written(tmp_path, text)
    assert call(controller, "config", "--check", file) == f"{file} can be used by {command}\n"


def test_a_file_without_options_says_so(tmp_path: Path) -> None:
    file = written(tmp_path, "# later\n")
    assert call(controller, "config", "--check", file) == f"{file} has no options\n"


def test_every_option_of_a_service_is_printed_with_what_it_is() -> None:
    text = call(controller, "config", "--print", "run")
    assert text.startswith("[run]\n")
    assert '\nport = "khepera://corridor?seed=5"\n' in text
    assert "\n# profile =\n" in text  # there is no default
    assert "\nwait = 0.0\n" in text
    assert "# Seconds to wait for port and camera to be there at the start" in text
    assert "{names}" not in text


def test_the_command_line_wins_over_the_environment_and_that_over_the_file(tmp_path: Path) -> None:
    file = written(tmp_path, "[run]\nseed = 1\nrobots = 2\nspeed = 3.0\n")
    text = call(
        emulator, "config", "run", "--check", file, "--print", KHEPERA_EMULATOR_RUN_ROBOTS="5"
    )
    assert {"seed = 1", "robots = 5", "speed = 3.0"} <= set(text.splitlines())


def test_a_command_takes_its_own_table_of_a_programs_file(tmp_path: Path) -> None:
    file = written(tmp_path, '[run]\nport = "x"\n\n[stop]\nrobot = "two"\n\n[camera]\nbaud = 9\n')
    command = get_command(controller)
    with command.make_context("macor-hil", ["stop", "--config", file]) as outer:
        name, found, rest = command.resolve_command(outer, ["stop", "--config", file])  # type: ignore[attr-defined]
        with found.make_context(name, rest, parent=outer) as context:
            assert context.params["robot"] == "two"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[run]\nprot = 1", r"\[run\] unknown option 'prot'; did you mean port\?"),
        ("[rum]\nport = 1", r"\[rum\] no command 'rum' takes .*; did you mean run\?"),
        ("[keys]\nport = 1", r"\[keys\] no command 'keys' takes"),
        ("commands = -1", r"\[run\] commands should be greater than or equal to 0, not -1"),
        ("[run]\nwait = nan", r"\[run\] wait should be greater than or equal to 0"),
        ('[run]\ngoal = "blu"', r"\[run\] goal: "),
        ('[run]\nplanner = "grated"', r"\[run\] .*no planner 'grated'; did you mean graded\?"),
        ('[train]\nplanner = ["grated"]', r"\[train\] .*no planner 'grated'"),
        ('[train]\nmemory = ["nosuch"]', r"\[train\] .*no memory 'nosuch'"),
        ('[train]\nmemory = ["mine=nosuch"]', r"\[train\] .*no memory 'nosuch'"),
        ('[train]\nmemory = ["a.py:Mine"]', r"\[train\] .*is not NAME=PART"),
        ('[reproduce]\nplanner = ["grated"]', r"\[reproduce\] .*no planner 'grated'"),
        ('[train]\nclusterer = "gas"', r"\[train\] .*no clusterer 'gas'"),
        ('[train]\neyes = "ears"', r"\[train\] .*'ears'"),
        ('[trials]\nplanner = ["grated"]', r"\[trials\] .*no planner 'grated'"),
        ("[run.port]\na = 1", r"\[run\] port is a value, not a table"),
        ("[run", "options.toml: "),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_sentence(
    tmp_path: Path, text: str, says: str
) -> None:
    command = get_command(controller)
    with command.make_context("macor-hil", ["config"]) as context, pytest.raises(OptionError) as no:
        check_file(Path(written(tmp_path, text)), commands_of(context), "run")
    assert re.search(says, str(no.value)), no.value
    assert "\n" not in str(no.value)


def test_options_that_are_taken_for_ever_can_be_said(tmp_path: Path) -> None:
    said = "wait = inf\nrecovery = inf\ncommands = 0\nafter-collision = 'back-off'\nlearn = true\n"
    text = call(controller, "config", "run", "--check", written(tmp_path, said), "--print")
    assert {*said.replace("'", '"').splitlines()} <= set(text.splitlines())


@pytest.fixture
def log() -> Iterator[logging.Logger]:
    """A logger; what is set up here is undone."""
    before, level = logging.root.handlers[:], logging.root.level
    yield logging.getLogger("robot")
    logging.root.handlers[:] = before
    logging.root.setLevel(level)


def test_a_line_of_text_has_time_and_level(
    log: logging.Logger, capsys: pytest.CaptureFixture[str]
) -> None:
    set_up_log(LogOptions(log_level=LogLevel.INFO))
    log.info("two\nlines and \x1b[31m")
    log.debug("not said")
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(
        r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z INFO robot: two\\nlines and \\x1b\[31m\n", said.err
    )
    assert not logs_json()


def test_a_line_of_json_is_an_object_whatever_is_said(
    log: logging.Logger, capsys: pytest.CaptureFixture[str]
) -> None:
    set_up_log(LogOptions(log_format=LogFormat.JSON))
    try:
        raise ValueError("a\nb")
    except ValueError:
        log.exception("%s \ud800 ü", "two\nlines")
    (line,) = capsys.readouterr().err.splitlines()
    entry = json.loads(line)
    assert (entry["level"], entry["logger"]) == ("error", "robot")
    assert entry["message"] == "two\nlines \ud800 ü"
    assert entry["exception"].endswith("ValueError: a\nb")
    assert entry["time"].endswith("Z")


def test_the_last_sentence_of_a_run_is_json_where_the_log_is(
    log: logging.Logger,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    arguments = ["run", "--map", str(tmp_path / "none"), "--log-format", "json"]
    monkeypatch.setattr("sys.argv", ["macor-hil", *arguments])
    assert program.run() == Status.FAILED
    (line,) = capfd.readouterr().err.splitlines()
    assert json.loads(line)["message"].startswith("there is no map")
    assert log.name == "robot"
