"""Fitted Q iteration's choice of commands: the greatest value; see `memories.fitted_q`."""

from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.fitted_q import FittedQMemory
from macor_hil.mind.planners.planner import Plan, best_command


class FittedQ:
    """Takes the command of the greatest fitted value; nothing is simulated."""

    memory = "fitted-q"

    def plan(self, memory: FittedQMemory, now: Moment) -> Plan:
        """Evaluate all commands at the present features."""
        evaluations = memory.evaluations(now.features)
        return Plan(evaluations, best_command(evaluations))
