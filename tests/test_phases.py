"""Whatever phase a controller is in, the monitor shows it."""

from io import StringIO

import pytest
from controller_helpers import a_state
from khepera_protocol.zenoh.controller_payloads import Phase
from rich.console import Console

from macor_hil.monitor.robot_state import Controlled, RobotState
from macor_hil.monitor.terminal_view import render


@pytest.mark.parametrize("phase", list(Phase))
def test_the_monitor_shows_every_phase(phase: Phase) -> None:
    controlled = Controlled(alive=True, met=True, state=a_state(phase))
    watched = RobotState("khepera", controlled=controlled)
    said = StringIO()
    Console(file=said, width=100).print(render(watched, 0.0))
    assert phase.value in said.getvalue()
