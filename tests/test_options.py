"""Options declared once: the command line, a file, a URL, and what goes wrong with each."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import pytest
import typer
from khepera_protocol.options import Cli, OptionError, from_strings, takes, to_strings
from pydantic import BaseModel, Field, field_validator
from typer.testing import CliRunner


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Robot(BaseModel):
    name: Annotated[str, Cli(metavar="NAME")] = Field(default="khepera", description="Its name.")
    seed: int = Field(default=0, ge=0, description="Of all randomness.")
    speed: float = Field(default=1.0, ge=0.1, le=10.0, allow_inf_nan=False)
    fault: tuple[str, ...] = Field(default=(), description="Repeatable.")
    colour: Colour = Colour.RED
    dead_man: float | None = None
    expose: Annotated[bool, Cli(flags=("--expose",))] = False

    @field_validator("name")
    @classmethod
    def _plain(cls, name: str) -> str:
        if not name.isalnum():
            raise ValueError(f"{name!r} is not made of letters and digits")
        return name


class Where(BaseModel):
    file: Annotated[Path, Cli(argument=True)] = Field(description="What to write.")


def call(*arguments: str, environment: dict[str, str] | None = None) -> tuple[int, str, list[Any]]:
    app, made = typer.Typer(context_settings={"auto_envvar_prefix": "ROBOT"}), list[Any]()

    @app.command()
    @takes(Robot, Where)
    def run(robot: Robot, where: Where, loud: bool = False) -> None:
        """Run a robot."""
        made.extend([robot, where, loud])

    result = CliRunner().invoke(app, arguments, env=environment)
    return result.exit_code, result.output, made


def test_defaults_stand_in_the_model_alone() -> None:
    assert call("a.txt")[2] == [Robot(), Where(file=Path("a.txt")), False]


def test_every_kind_of_option_is_read() -> None:
    arguments = ("--name", "two", "--seed", "3", "--speed", "2", "--fault", "a", "--fault", "b")
    more = ("--colour", "blue", "--dead-man", "0.5", "--expose", "--loud", "b.txt")
    robot, where, loud = call(*arguments, *more)[2]
    assert robot == Robot(
        name="two", seed=3, speed=2, fault=("a", "b"), colour=Colour.BLUE, dead_man=0.5, expose=True
    )
    assert (where.file, loud) == (Path("b.txt"), True)


def test_help_tells_what_the_model_says() -> None:
    _, output, _ = call("--help", environment={"COLUMNS": "160", "TERM": "dumb"})
    for part in ("Of all randomness.", "0.1<=x<=10.0", "[default: khepera]", "NAME", "<red|blue>"):
        assert part in output
    assert "ROBOT_SEED" not in output


def test_a_file_stands_for_the_defaults_and_the_command_line_wins(tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('name = "three"\nseed = 4\nfault = ["a", "b"]\ndead-man = 1\nexpose = true\n')
    robot, *_ = call("--config", str(file), "--seed", "5", "a.txt")[2]
    assert robot == Robot(name="three", seed=5, fault=("a", "b"), dead_man=1, expose=True)
    robot, *_ = call("--config", str(file), "a.txt", environment={"ROBOT_SEED": "6"})[2]
    assert robot.seed == 6


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("sped = 1", "unknown option 'sped'; did you mean speed?"),
        ("speed = 99", "'--speed': Input should be less than or equal to 10"),
        ('seed = "many"', "'--seed': Input should be a valid integer"),
        ("[seed]\na = 1", "seed is a value, not a table"),
        ("seed =", "Invalid value"),
    ],
)
def test_a_file_that_cannot_be_used_is_told(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(text)
    code, output, made = call("--config", str(file), "a.txt", environment={"COLUMNS": "300"})
    assert (code, made) == (2, [])
    assert says in " ".join(output.replace("│", " ").split())


def test_a_missing_file_is_told() -> None:
    code, output, _ = call("--config", "none.toml", "a.txt", environment={"COLUMNS": "300"})
    assert code == 2
    assert "cannot read none.toml" in output


def test_values_as_text_and_back() -> None:
    pairs = [("name", "two"), ("fault", "a"), ("fault", "b"), ("dead-man", "0.5")]
    robot = from_strings(Robot, pairs)
    assert robot == Robot(name="two", fault=("a", "b"), dead_man=0.5)
    assert to_strings(robot) == pairs
    assert to_strings(Robot()) == []


@pytest.mark.parametrize(
    ("pair", "says"),
    [
        ([("sed", "1")], "unknown option 'sed'; did you mean seed?"),
        ([("seed", "-1")], "seed should be greater than or equal to 0, not '-1'"),
        ([("seed", "9" * 5000)], "seed: "),
        ([("speed", "nan")], "speed should be a finite number, not 'nan'"),
        ([("name", "a b")], r"name: 'a b' is not made of letters and digits"),
        ([("seed", "1"), ("seed", "2")], "seed is given twice"),
    ],
)
def test_values_that_do_not_fit_are_told(pair: list[tuple[str, str]], says: str) -> None:
    with pytest.raises(OptionError, match=says) as caught:
        from_strings(Robot, pair)
    assert len(str(caught.value)) < 600
