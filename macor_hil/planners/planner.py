"""What every planner takes and gives."""

from dataclasses import dataclass
from typing import Protocol

from macor_hil.sensorimotor_map import SensorimotorMap


@dataclass(frozen=True, slots=True)
class Plan:
    """The outcome of planning.

    Attributes:
        evaluations: value of each command, None for commands never tried here.
        command: index of the best one, or None when no command was ever tried here.
        sequence: neurons of the best hypothetical sequence, without the start.
        steps: wave steps that were run.
    """

    evaluations: tuple[float | None, ...]
    command: int | None
    sequence: tuple[int, ...] = ()
    steps: int = 0


class Planner(Protocol):
    """A way of choosing the next command."""

    def plan(self, memory: SensorimotorMap, start: int) -> Plan:
        """Evaluate the commands that can follow the neuron `start`."""
        ...


def best_command(evaluations: tuple[float | None, ...]) -> int | None:
    """The command of the greatest evaluation, the first one at a tie."""
    known = [(value, -a) for a, value in enumerate(evaluations) if value is not None]
    return -max(known)[1] if known else None
