"""Successor representation's choice of commands: the greatest value; see `memories.successor`."""

from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.successor import SuccessorMap
from macor_hil.mind.planners.planner import Plan, best_command


class Successor:
    """Takes the command whose expected successors earn most; nothing is simulated."""

    memory = "successor"

    def plan(self, memory: SuccessorMap, now: Moment) -> Plan:
        """Evaluate the commands that were tried in the present situation."""
        values, tried = memory.values(now.node)
        evaluations = tuple(
            float(value) if known else None for value, known in zip(values, tried, strict=True)
        )
        return Plan(evaluations, best_command(evaluations))
