"""Learning while driving: what a live run learns is kept in the map that it drives by.

The map is written as a training writes it, in one step and with its version: whoever reads the
path sees the map before or after, whole. A map is written by one program at a time.
"""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from macor_hil.errors import MacorError, MapError
from macor_hil.mind.brain import Brain
from macor_hil.mind.map_file import save_map
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import undisturbed

_log = logging.getLogger(__name__)

LIVED: Final = "lived"
"""The fact of a map that counts the commands learned in live runs."""

_COSTLY: Final = {"places": "a chart of all places", "fitted-q": "a fit to all experiences"}
"""Memories of which planners read what takes seconds to make anew after every experience."""


class LearningOn:
    """Keeps what is learned while a robot is driven.

    Args:
        path: of the map.
        brain: that learns.
        training: facts about its training, kept in the map.
        every: commands from one writing to the next.

    Attributes:
        lived: commands learned in live runs, those before this one included.
    """

    def __init__(self, path: Path, brain: Brain, training: dict[str, Any], every: int) -> None:
        self.lived = _count(training.get(LIVED))
        self._path = path
        self._brain = brain
        self._training = training
        self._every = every
        self._unsaved = 0
        self._failing = False

    def count(self) -> None:
        """Count a command that was learned; now and then write the map.

        A map that cannot be written is told in the log, and tried again after the next command.
        """
        self.lived += 1
        self._unsaved += 1
        if self._unsaved < self._every:
            return
        try:
            self.save()
        except MapError as error:
            if not self._failing:
                _log.warning("%s; what is learned is kept in memory, and tried again", error)
            self._failing = True

    def save(self) -> None:
        """Write what is not yet written.

        Raises:
            MapError: it cannot be written.
        """
        if not self._unsaved:
            return
        save_map(self._path, self._brain, {**self._training, LIVED: self.lived})
        self._unsaved, self._failing = 0, False
        _log.info("%s: %d commands learned while driving are kept", self._path, self.lived)


@contextmanager
def learning_on(
    path: Path, brain: Brain, training: dict[str, Any], memory: str, every: int
) -> Iterator[LearningOn]:
    """Keep a map for one run that learns; what is left is written at the end, however it comes.

    Args:
        path: of the map.
        brain: that learns.
        training: facts about its training.
        memory: name of the memory that the planner reads.
        every: commands from one writing to the next.

    Raises:
        MacorError: another program writes the map, it cannot be written, or the planner cannot
            decide while it learns.
    """
    if what := _COSTLY.get(memory):
        raise MacorError(
            f"--learn: the planner reads {what}, which would take seconds at every decision; learn"
            " with another planner"
        )
    with claim(path):
        kept = LearningOn(path, brain, training, every)
        try:
            yield kept
        finally:
            with undisturbed():
                kept.save()


def _count(value: object) -> int:
    """Return a count as a file says it; anything else is none."""
    return value if isinstance(value, int) and value >= 0 else 0
