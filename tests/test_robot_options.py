"""Options of a robot: the same on the command line, in a URL, in a file and in a wire log."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from in_process import open_robot
from khepera_protocol.options import Cli, OptionError
from typer.testing import CliRunner

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.app import serving
from khepera_emulator.app.cli.commands import app
from khepera_emulator.app.options import LineOptions, ZenohOptions
from khepera_emulator.line.wire_log import WireLog, read_log
from khepera_emulator.robot.options import HIGHEST_SEED, RobotOptions, UrlOptions

EXAMPLES: dict[str, list[Any]] = {
    "arena": ["open-box", "runs/my arena#1?100%.toml"],
    "model": ["khepera2", "khepera,epuck2"],
    "seed": [1, HIGHEST_SEED],
    "drift": ["none", "scale=0.01,slip=0.05"],
    "physics": ["pybullet"],
    "baud": ["unpaced", "38400", "1"],
    "fault": [["drop:p=0.1"], ["stray:at=1,text=a&b=c#%\\r\\n", "reset:at=5"]],
    "turret": [["gripper", "k213"]],
    "firmware": [["reject-beyond", "rom-revision=4.02"]],
    "profile": ["btcom"],
    "dead_man": [0.5, 60.0],
    "robots": [2, 32],
}
EVERY = [(name, value) for name, values in EXAMPLES.items() for value in values]


def run(*arguments: str) -> tuple[RobotOptions, LineOptions, ZenohOptions]:
    """Options as `khepera-emulator run` hands them on."""
    made: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(serving, "serve", lambda *options: made.append(options))
        done = CliRunner().invoke(app, ["run", *arguments], env={"COLUMNS": "300"})
    assert done.exit_code == 0, done.output
    robot, line, zenoh, *_ = made[0]
    return robot, line, zenoh


def texts(value: Any) -> list[str]:
    return [str(each) for each in (value if isinstance(value, list) else [value])]


def logged(options: RobotOptions, folder: Path) -> UrlOptions:
    """Options that the header of a wire log gives back."""
    with WireLog(folder / "log", UrlOptions.of(options, 1).to_url()):
        pass
    return UrlOptions.from_url(read_log(folder / "log").url)


def same(one: RobotOptions, other: RobotOptions) -> bool:
    return one.model_dump() == {k: v for k, v in other.model_dump().items() if k != "robot"}


def test_every_option_has_an_example() -> None:
    assert list(EXAMPLES) == list(RobotOptions.model_fields)


@pytest.mark.parametrize(("name", "value"), EVERY)
def test_an_option_is_the_same_everywhere(name: str, value: Any, tmp_path: Path) -> None:
    options = RobotOptions.model_validate({name: value})
    assert not same(options, RobotOptions())
    outside = name.replace("_", "-")
    words = [word for text in texts(value) for word in (f"--{outside}", text)]
    assert run(*words)[0] == options
    file = tmp_path / "robot.toml"
    file.write_text(f"{outside} = {json.dumps(value)}\n")
    assert run("--config", str(file))[0] == options
    assert same(options, UrlOptions.from_url(UrlOptions.of(options, 1).to_url()))
    assert same(options, logged(options, tmp_path))


OPTIONS = st.builds(
    RobotOptions,
    **{
        name: st.sampled_from([tuple(v) if isinstance(v, list) else v for v in values])
        for name, values in EXAMPLES.items()
    }
    | {"arena": st.text(min_size=1)},
)


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(OPTIONS, st.integers(1, 2))
def test_a_url_gives_all_options_back(options: RobotOptions, robot: int) -> None:
    of_one = UrlOptions.of(options, robot)
    assert UrlOptions.from_url(of_one.to_url()) == of_one


def test_no_option_is_every_default() -> None:
    assert run() == (RobotOptions(), LineOptions(), ZenohOptions())
    assert UrlOptions.from_url("khepera://corridor") == UrlOptions()


def test_the_header_of_a_log_is_as_ever() -> None:
    alone = RobotOptions(seed=3, dead_man=60, fault=("drop:p=1",), turret=("k213",))
    assert UrlOptions.of(alone, 1, ["cut:at=2"]).to_url() == (
        "khepera://corridor?fault=drop%3Ap%3D1&fault=cut%3Aat%3D2&model=khepera&seed=3"
        "&drift=default&physics=auto&baud=auto&turret=k213&dead-man=60.0"
    )
    several = RobotOptions(robots=3)
    assert UrlOptions.of(several, 2).to_url() == (
        "khepera://corridor?model=khepera&seed=0&drift=default&physics=auto&baud=auto&robots=3&robot=2"
    )


@pytest.mark.parametrize("url", ["khepera://corridor?baud=9600", "khepera://corridor?seed=007"])
def test_urls_of_before_are_read(url: str) -> None:
    with open_robot(url, timeout=1) as port:
        port.write(b"B\n")
        assert port.readline() == b"b,5.01,5.00\r\n"


def test_a_path_that_is_no_text_goes_into_a_url_and_back() -> None:
    options = UrlOptions(arena="runs/\udcff.toml")
    assert UrlOptions.from_url(options.to_url()) == options
    assert options.to_url().isascii()


def test_a_file_sets_the_line_and_the_side_channel_too(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(
        'speed = 20\nbaud = 38400\nlink = "runs/a"\nrobot = "second"\nzenoh = false\n'
        'fault-script = "bad-day.txt"\n'
    )
    robot, line, zenoh = run("--config", str(file), "--speed", "10")
    assert robot == RobotOptions(baud="38400")
    assert line == LineOptions(speed=10, link=Path("runs/a"), fault_script=Path("bad-day.txt"))
    assert zenoh == ZenohOptions(robot="second", zenoh=False)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sead = 1", "unknown option 'sead'; did you mean seed?"),
        ("seed = -1", "'--seed'"),
        ("[turret]", "turret is a value, not a table"),
    ],
)
def test_a_file_with_a_mistake_is_told(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    done = CliRunner().invoke(app, ["run", "--config", str(file)], env={"COLUMNS": "300"})
    assert done.exit_code == 2
    assert says in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"robot": "two words"}, "--robot: 'two words': a name is made of letters"),
        ({"baud": "fast"}, "--baud: 'fast' is no rate"),
    ],
)
def test_a_wrong_value_is_told(options: dict[str, str], says: str) -> None:
    words = [word for name, value in options.items() for word in (f"--{name}", value)]
    done = CliRunner().invoke(app, ["run", *words])
    assert isinstance(done.exception, OptionError)
    assert says in str(done.exception)


def test_help_explains_every_word_that_an_option_offers() -> None:
    for name, info in RobotOptions.model_fields.items():
        offered = next((each.metavar or "" for each in info.metadata if isinstance(each, Cli)), "")
        words = [word for word in offered.split("|") if "|" in offered and word.islower()]
        assert all(word in str(info.description) for word in words), name
