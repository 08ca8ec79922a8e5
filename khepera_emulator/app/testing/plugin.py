"""Plugin of pytest: emulated robots as fixtures, for tests of programs that drive a Khepera.

* `khepera`: a robot in a process of its own, on a pseudo-terminal; see `khepera_emulator.start`.
* `khepera_url`: a pySerial URL of a robot in the test's process, in virtual time.
* `@pytest.mark.khepera(arena="s-curve", seed=3, fault=["drop:p=0.01"])`: options of both, by the
  names of `khepera-emulator run`. Of several marks the one nearest to the test counts.
* `--khepera-arena`, `--khepera-model`: options of tests that do not say.

pytest imports this file at its start in every project: nothing else is imported before a test asks
for a robot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

    from khepera_emulator import EmulatorError
    from khepera_emulator.app.testing.started import StartedRobot

_ROBOT: Final = pytest.StashKey["StartedRobot"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the command line."""
    group = parser.getgroup("khepera", "emulated Khepera robots")
    group.addoption(
        "--khepera-arena",
        metavar="ARENA",
        help="arena of robots whose test names none: a name (khepera-emulator arenas), or a file",
    )
    group.addoption(
        "--khepera-model",
        metavar="MODEL",
        help="model of robots whose test names none, such as khepera2",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Describe the mark."""
    config.addinivalue_line(
        "markers",
        "khepera(arena=..., seed=..., fault=[...], ...): options of the fixtures khepera and"
        " khepera_url, by the names of `khepera-emulator run`",
    )


@pytest.fixture
def khepera(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[StartedRobot]:
    """Switch on a robot in a process of its own; its `port` is a pseudo-terminal.

    A report of a failed test shows what has passed on its line.
    """
    from khepera_emulator import EmulatorError, start

    try:
        robot = start(folder=tmp_path_factory.mktemp("khepera"), **_options(request))
    except EmulatorError as error:
        raise _refusal(error) from None
    with robot:
        request.node.stash[_ROBOT] = robot
        yield robot


@pytest.fixture
def khepera_url(request: pytest.FixtureRequest) -> str:
    """Return the pySerial URL of a robot in this process; its time is virtual."""
    from khepera_protocol.options import to_strings

    from khepera_emulator import EmulatorError
    from khepera_emulator.app.testing.started import options_of
    from khepera_emulator.robot.options import RobotOptions, robot_url

    values = _options(request)
    values.pop("speed", None)  # it is as fast as the processor
    try:
        options = options_of(RobotOptions, values)
    except EmulatorError as error:
        raise _refusal(error) from None
    pairs = [pair for pair in to_strings(options) if pair[0] != "arena"]
    return robot_url(options.arena, pairs)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the wire log of a test's robot to the report, if it has failed."""
    report = yield
    if report.failed and _ROBOT in item.stash:
        section = _section(item.stash[_ROBOT])
        # JUnit's XML shows sections of a failure's text, and no others
        add = getattr(report.longrepr, "addsection", None)
        if add is not None:
            add(*section)
        else:
            report.sections.append(section)
    return report


def _section(robot: StartedRobot) -> tuple[str, str]:
    """Return title and text of a robot's wire log."""
    from khepera_emulator import EmulatorError
    from khepera_emulator.app.testing.report import report

    try:
        text = report(robot.wire_log)
    except EmulatorError as error:
        text = str(error)
    return "Khepera's line", f"{text}\n({robot.log_file})"


def _refusal(error: EmulatorError) -> BaseException:
    """Return the failure of a test for which there is no robot: a sentence, no traceback."""
    return pytest.fail.Exception(f"there is no robot: {error}", pytrace=False)


def _options(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Return the options of a test's robots: of the command line, then of marks, nearest last."""
    given = {name: request.config.getoption(f"khepera_{name}") for name in ("arena", "model")}
    values = {name: value for name, value in given.items() if value is not None}
    for mark in reversed(list(request.node.iter_markers("khepera"))):
        if mark.args:
            pytest.fail(
                "the mark khepera takes options by their names: khepera(arena=...)", pytrace=False
            )
        values |= mark.kwargs
    return values
