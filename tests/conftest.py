"""Options of the tests."""

import signal

import pytest
from hypothesis import HealthCheck, settings

# a busy machine is slow at times: no test is about that
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


# who is started in the background by a shell ignores Ctrl-C, and so would all programs under test
signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="write the transcripts in tests/golden anew; look at the difference before committing",
    )
