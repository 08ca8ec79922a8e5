"""A part of an experiment: its trials of all seeds, those that were done and those to be done."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from macor_hil.experiments.drives.training_drive import Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.results.code_digest import digest
from macor_hil.experiments.results.store import Result, ResultsFile
from macor_hil.mind.catalogue import whereabouts


@dataclass(frozen=True, slots=True)
class Work:
    """A trial with all but its seed given; can be sent to another process."""

    trial: Callable[[Any, int, Recordings], Result]
    settings: Any
    recordings: Recordings

    def __call__(self, seed: int) -> Result:
        """Do the trial of a seed."""
        return self.trial(self.settings, seed, self.recordings)


class Part:
    """A part of an experiment.

    Args:
        experiment: the experiment.
        settings: those of the part.
        out: folder of recordings and results.

    Raises:
        MacorError: the file of its results is there and holds something else.
    """

    def __init__(self, experiment: Experiment, settings: Any, out: Path) -> None:
        recordings = Recordings(out / "recordings", settings.drive)
        drive, planners = settings.drive, getattr(settings, "planners", ())
        uses = (*drive.uses, *whereabouts(drive.brain, planners))
        code = digest(experiment.trial, {settings.drive.arena, *settings.arenas}, uses)
        self._drives = experiment.drives
        self._file = ResultsFile(out / "results", experiment.kept_as, settings, code)
        self.work = Work(experiment.trial, settings, recordings)
        self.results = self._file.read()

    def unrecorded(self, seed: int) -> list[Recordings]:
        """Return the recordings that have no drive of a seed."""
        found = [self.work.recordings]
        if self._drives is not None:
            drives = self._drives(self.work.settings, found[0].arenas)
            found = [found[0].of(drive) for drive in dict.fromkeys(drives)]
        return [each for each in found if not each.has(seed)]

    def add(self, seed: int, result: Result) -> None:
        """Keep a result, durably."""
        self._file.append(seed, result)
        self.results[seed] = result

    def put_in_order(self) -> None:
        """Write all results by their seeds, without what a kill may have left: half a line."""
        self._file.write(self.results)


def parts_of(experiment: Experiment, out: Path) -> list[Part]:
    """Return the parts of an experiment.

    Raises:
        MacorError: a file of results is there and holds something else.
    """
    settings = experiment.settings
    parts = [settings] if experiment.parts is None else experiment.parts(settings)
    return [Part(experiment, each, out) for each in parts]


def joined(results: Sequence[Result]) -> Result:
    """Return the results of all parts of a seed as one; lists follow one another."""
    first, *others = results
    whole = dict(first)
    for other in others:
        for name, values in other.items():
            whole[name] = [*whole[name], *values]
    return whole
