"""The interface of all experiments."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.training_drive import Drive, Recordings
from macor_hil.experiments.report.elements import Element
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.results.store import Result, Results


class Settings(Protocol):
    """The settings of an experiment: a frozen dataclass."""

    @property
    def drive(self) -> Drive:
        """The training drive that its systems learn from."""
        ...

    @property
    def arenas(self) -> tuple[str, ...]:
        """Every arena that its trials are driven in."""
        ...


@dataclass(frozen=True, slots=True)
class Courses:
    """The courses of an experiment's trials, whose starts are looked at for what was possible.

    Attributes:
        of: courses by name, given settings and the folder of arena files.
        driven: trials of a seed, as they are kept, by course and by system.
    """

    of: Callable[[Any, Path], Mapping[str, Course]]
    driven: Callable[[Any, Result], Mapping[str, Mapping[str, Sequence[Any]]]]


@dataclass(frozen=True)
class Experiment:
    """An experiment: one file of this folder.

    Attributes:
        name: on the command line.
        title: in the report.
        settings: with the paper's values.
        trial: a pure function of settings and seed; recordings are an argument because they are
            kept, not because they could differ. What its parts took, in seconds by their names, may
            be under TOOK in a result, and is kept apart from it.
        draw: pictures of the results by name.
        tell: the report's text, the paper's numbers beside ours.
        results: name under which results are kept, for experiments that share trials.
        most_seeds: seeds beyond these are left out of it; None: all take part.
        also: experiments whose trials are shown beside its own.
        peer: another implementation that it compares with, of the extra `peers`; such an
            experiment runs when it is asked for by its name.
        quick: settings with which it takes minutes; None: there are none.
        rows: the results as tidy rows of a CSV file beside the report; None: there is no such file.
        drives: all training drives of a seed, where there are others than that of the settings;
            given settings and the folder of arena files.
        parts: settings of the parts whose results, lists by name, follow one another in a seed's
            result. Each part is a piece of work of its own and is kept by itself, so that runs with
            other settings share the parts that are the same; None: there is one, of all settings.
        courses: of its trials, which are then compared with what was possible from their starts;
            None: they are not, or the experiment does it by itself.
    """

    name: str
    title: str
    settings: Any
    trial: Callable[[Any, int, Recordings], Result]
    draw: Callable[[Any, Results], Mapping[str, Figure]]
    tell: Callable[[Any, Results], Sequence[Element]]
    results: str = ""
    most_seeds: int | None = None
    also: tuple["Experiment", ...] = ()
    peer: str | None = None
    quick: Any = None
    rows: Callable[[Any, Results], Iterable[Row]] | None = None
    drives: Callable[[Any, Path], Sequence[Drive]] | None = None
    parts: Callable[[Any], Sequence[Any]] | None = None
    courses: Courses | None = None

    @property
    def kept_as(self) -> str:
        """Name under which results are kept."""
        return self.results or self.name
