"""Systems after their goal has changed: what the world does is kept, evaluations are learned anew.

Situations, competences and counts stay; evaluations count their experiences from the change on.
"""

from collections.abc import Iterable
from copy import deepcopy
from dataclasses import replace

import numpy as np

from macor_hil.experiments.drives.course import System
from macor_hil.experiments.drives.systems import Learning, graded_memory
from macor_hil.experiments.drives.training_drive import Recording
from macor_hil.mind.experience import Seen
from macor_hil.mind.memories.graded import GradedMemory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.reinforcement import Reinforcement


def relearned(
    learning: Learning,
    system: System,
    recording: Recording,
    since: Iterable[Seen],
    reinforcement: Reinforcement | None = None,
    *,
    before: float = 0.0,
) -> System:
    """Return a system that has learned evaluations for a new goal.

    Args:
        learning: settings of the system.
        system: as it was for the old goal.
        recording: the drive that it learned from.
        since: frames after the change, in their order.
        reinforcement: what commands earn where frames do not tell; None: as before.
        before: of graded situations, experiences that the mean reward before the change counts as.
    """
    name, brain = system.planner.memory, system.brain
    known = brain.memories[name]
    memory: GradedMemory | SensorimotorMap
    if isinstance(known, GradedMemory):
        memory = graded_memory(learning, recording, known.situations)
    else:
        assert isinstance(known, SensorimotorMap)
        memory = deepcopy(known)
        memory.begin_anew()
    learner = replace(
        brain,
        memories={name: memory},
        reinforcement=brain.reinforcement if reinforcement is None else reinforcement,
    )
    learner.relive(since, situations=False)
    if isinstance(memory, GradedMemory) and isinstance(known, GradedMemory):
        _keep_counts(known, memory, before)
    return System(learner, system.planner)


def _keep_counts(known: GradedMemory, memory: GradedMemory, before: float) -> None:
    """Give a memory the counts of the one before the change; its rewards stay its own."""
    old, new = known.counts, memory.counts
    was = np.divide(old.earned, old.tried, out=np.zeros_like(old.tried), where=old.tried > 0)
    tried = new.tried + before
    earned = new.earned + before * was
    r = np.divide(earned, tried, out=np.zeros_like(tried), where=tried > 0)
    new.load({"led_to": old.led_to, "tried": old.tried, "earned": old.tried * r})
