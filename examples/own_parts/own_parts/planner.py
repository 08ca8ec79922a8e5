"""A wary planner: the command whose worst outcome was best, looking one command ahead."""

from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Hypothesis, Plan, best_command, ranked


class Wary:
    """Judge a command by the least that it ever earned in the present situation.

    Args:
        trials: commands that were tried less often are not judged.
    """

    memory = "transitions"

    def __init__(self, trials: int = 1) -> None:
        self._trials = trials

    def plan(self, memory: SensorimotorMap, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present situation."""
        known, m = memory.transitions(), memory.commands
        here = known.past // m == now.neuron // m
        worst: list[float | None] = [None] * m
        ends: dict[int, int] = {}
        for a in range(m):
            led = here & (known.present % m == a)
            if known.z[led].sum() >= max(self._trials, 1):
                k = int(known.w_r[led].argmin())
                worst[a] = float(known.w_r[led][k])
                ends[a] = int(known.present[led][k])
        weighed = (
            Hypothesis((ends[a],), value) for a, value in enumerate(worst) if value is not None
        )
        hypotheses = ranked(weighed, m)
        sequence = hypotheses[0].neurons if hypotheses else ()
        return Plan(tuple(worst), best_command(tuple(worst)), sequence, 1, hypotheses)
