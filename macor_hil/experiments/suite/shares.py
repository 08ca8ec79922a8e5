"""Systems on a course, beside what was possible there: driven, kept, compared and told.

A condition is a result of some systems in one arena, as `drive_all` returns it.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from macor_hil.experiments.drives.course import (
    Course,
    System,
    on_course,
    possible_as_json,
    trial_as_json,
    trial_from_json,
)
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.experiments.report.rows import Row, trial_rows
from macor_hil.experiments.report.statistics import Estimate, estimate, mean
from macor_hil.experiments.results.store import Result
from macor_hil.runs.possible import Possible, compare, share_of
from macor_hil.runs.trials import Trial

HOW_TO_READ: Final = (
    "A cell is the share of the commands that were possible from the same starts, and the share of"
    " trials that collided among those in which no collision was necessary; with more than one seed"
    " each is the mean over seeds, with its 95 % bootstrap interval."
)


def drive_all(systems: Mapping[str, System], course: Course, seed: int, drive: Drive) -> Result:
    """Drive the trials of all systems, from the same places, and tell what is possible from there.

    Raises:
        RobotError, CameraError, BenchError: the emulator cannot be used.
    """
    with on_course(course, seed, drive) as track:
        trials = {name: track.drive(system, seed) for name, system in systems.items()}
        possible = track.possible(seed)
        outline = track.outline().model_dump(mode="json")
    return {
        "commands": course.commands,
        "outline": outline,
        "possible": possible_as_json(possible),
        "trials": {name: [trial_as_json(one) for one in of] for name, of in trials.items()},
    }


def possible_in(condition: Result) -> list[Possible]:
    """Return what was possible from the start of each trial."""
    most = condition["commands"]
    return [Possible(length, most, exact) for length, exact in condition["possible"]]


def trials_of(condition: Result, system: str) -> list[Trial]:
    """Return the trials of a system, without their paths."""
    return [trial_from_json(one, way=False) for one in condition["trials"][system]]


def first_trial(condition: Result, system: str) -> Trial:
    """Return the first trial of a system, to be drawn."""
    return trial_from_json(condition["trials"][system][0])


def compared_rows(condition: Result, system: str, where: Row) -> Iterator[Row]:
    """Yield a row for each trial of a system, with what was possible.

    Args:
        condition: of the trials.
        system: its name there.
        where: columns that are the same in all rows.
    """
    trials, possible = trials_of(condition, system), possible_in(condition)
    for row, one, most in zip(trial_rows(trials, where), trials, possible, strict=True):
        share = share_of(one, most)
        yield {
            **row,
            "possible": most.length,
            "certain": int(most.exact),
            "share": "" if share is None else round(share, 4),
        }


def shares_by_seed(
    conditions: Sequence[tuple[int, Result]], system: str
) -> tuple[list[float], list[float]]:
    """Return, of every seed, the share of what was possible and the share of needless collisions.

    Args:
        conditions: each with its training seed.
        system: its name in all of them.

    Returns:
        Both lists; a seed in whose trials nothing was possible, or in all of whose trials a
        collision was necessary, is missing from the one or the other.
    """
    shares, needless = [], []
    for seed in dict.fromkeys(seed for seed, _ in conditions):
        of_seed = [one for number, one in conditions if number == seed]
        trials = [trial for one in of_seed for trial in trials_of(one, system)]
        found = compare(trials, [most for one in of_seed for most in possible_in(one)])
        if found.share is not None:
            shares.append(found.share)
        if found.free:
            needless.append(found.needless / found.free)
    return shares, needless


def cell(conditions: Sequence[tuple[int, Result]], system: str) -> str:
    """Return a cell of a table; see HOW_TO_READ."""
    shares, needless = shares_by_seed(conditions, system)
    return f"{_percent(shares, 1)}; {_percent(needless, 0)}"


def _percent(seeds: Sequence[float], digits: int) -> str:
    if not seeds:
        return "-"
    values = [100 * value for value in seeds]
    if len(values) == 1:
        return f"{values[0]:.{digits}f} %"
    found: Estimate = estimate(values, mean)
    interval = f"{found.low:.{digits}f} to {found.high:.{digits}f}"
    return f"{found.value:.{digits}f} % ({interval})"
