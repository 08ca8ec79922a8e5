"""Q-learning's choice of commands: the best stored evaluation; see `memories.q_map`."""

from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Hypothesis, Plan, best_command, best_ends, ranked


class QLearning:
    """Takes the command of the best stored evaluation; nothing is simulated."""

    memory = "q-learning"

    def plan(self, memory: SensorimotorMap, now: Moment) -> Plan:
        """Evaluate the commands that can follow the present neuron."""
        commands, transitions = memory.commands, memory.transitions()
        own = transitions.after(now.neuron)
        weighed = zip(transitions.present[own].tolist(), transitions.w_r[own].tolist(), strict=True)
        best, ends = best_ends(weighed, commands)
        command = best_command(tuple(best))
        sequence = () if command is None else (ends[command],)
        known = ((end, value) for end, value in zip(ends, best, strict=True) if value is not None)
        hypotheses = ranked((Hypothesis((end,), value) for end, value in known), commands)
        return Plan(tuple(best), command, sequence, 0, hypotheses)


class WeakQLearning(QLearning):
    """The same on evaluations without a horizon, gamma = 0 (equation 2)."""

    memory = "weak-q-learning"
