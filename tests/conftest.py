"""Options of the tests."""

import os
import signal
from collections import Counter
from collections.abc import Generator

import pytest
from hypothesis import HealthCheck, settings
from khepera_protocol.system.compiled import NEVER, VARIABLE

from khepera_emulator.errors import EmulatorError
from khepera_emulator.world.bullet import load_physics

# a busy machine is slow at times: no test is about that
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


# who is started in the background by a shell ignores Ctrl-C and Ctrl-\, and so would all programs
# under test
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGQUIT, signal.SIG_DFL)


# making machine code takes longer than a test drives; tests of compiled forms ask for them
os.environ.setdefault(VARIABLE, NEVER)

MISSING = "for which PyBullet is missing"

try:
    load_physics("some tests are about it")
except EmulatorError:
    HAS_PHYSICS = False
    # all about PyBullet, or held against it
    collect_ignore = [
        *("test_camera.py", "test_chassis.py", "test_contact.py", "test_geometry.py"),
        *("test_fleet.py", "test_many_robots.py", "test_things.py", "test_arena.py"),
        *("hostile/test_queries.py",),
    ]
else:
    HAS_PHYSICS = True


def pytest_report_header() -> str | None:
    """Say it where PyBullet is missing, and tests that need it are left out."""
    return None if HAS_PHYSICS else f"PyBullet is missing; left out: {', '.join(collect_ignore)}"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip tests that cannot say themselves that they need PyBullet."""
    for item in items:
        if not HAS_PHYSICS and item.get_closest_marker("pybullet"):
            item.add_marker(pytest.mark.skip("PyBullet is missing"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Skip what turns out to need PyBullet where there is none."""
    report = yield
    if not HAS_PHYSICS and report.failed and MISSING in report.longreprtext:
        report.outcome = "skipped"
        report.longrepr = (str(item.path), item.location[1] or 0, "PyBullet is missing")
    return report


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="write the transcripts in tests/golden anew; look at the difference before committing",
    )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Show how many hostile inputs were tried; here, where a parallel run's end is heard."""
    tried: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            for name, value in getattr(report, "user_properties", ()):
                if name == "inputs tried":
                    edge, number = value
                    tried[edge] += number
    if tried:
        terminalreporter.section("hostile inputs")
        width = max(len("edge"), *map(len, tried))
        terminalreporter.write_line(f"{'edge':<{width}} | inputs tried")
        for edge, number in sorted(tried.items()):
            terminalreporter.write_line(f"{edge:<{width}} | {number:>12,}")
