"""All that is remembered of what commands led to."""

from dataclasses import dataclass

from macor_hil.graded_map import GradedMap
from macor_hil.sensorimotor_map import SensorimotorMap


@dataclass(frozen=True, slots=True)
class Memory:
    """What planners look into.

    Attributes:
        map: the paper's map, transitions between neurons.
        graded: the same experience between graded situations.
    """

    map: SensorimotorMap
    graded: GradedMap
