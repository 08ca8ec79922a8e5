"""Options of the tests."""

import signal
from collections import Counter

import pytest
from hypothesis import HealthCheck, settings

# a busy machine is slow at times: no test is about that
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


# who is started in the background by a shell ignores Ctrl-C and Ctrl-\, and so would all programs
# under test
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGQUIT, signal.SIG_DFL)


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
