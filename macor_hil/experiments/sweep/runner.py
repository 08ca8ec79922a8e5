"""Sweeps: an experiment over seeds and worker processes; whatever is done stays done."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

import joblib

from macor_hil.errors import MacorError
from macor_hil.experiments.drives.training_drive import Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.results.store import (
    TOOK,
    Result,
    Results,
    append_line,
    only_one,
    read_lines,
)
from macor_hil.experiments.sweep.engine import engine
from macor_hil.experiments.sweep.pages import Chapter, write_report
from macor_hil.experiments.sweep.part import Part, Work, joined, parts_of
from macor_hil.experiments.sweep.possible import compared, starts_of
from macor_hil.experiments.sweep.watch import Watch
from macor_hil.safety.interruption import unbroken

ALL: Final = -1
"""As many workers as this machine has processors, or the cluster has workers."""

_T = TypeVar("_T")
_Given = TypeVar("_Given")

COSTS: Final = "costs.jsonl"
"""Times of each piece of work; kept apart from results, which are the same on every run."""


def reproduce(
    experiments: Sequence[Experiment],
    seeds: int,
    workers: int,
    out: Path,
    watch: Watch,
    cluster: str | None = None,
) -> Path:
    """Run experiments over the seeds 1 to `seeds` and write the report page.

    A sweep that was killed goes on where it was: recordings and results that are there are not
    made again. Results do not depend on the number of workers.

    Args:
        experiments: what to run.
        seeds: training seeds.
        workers: worker processes on this machine, or ALL.
        out: folder for recordings, results and report.
        watch: hears of the progress.
        cluster: address of a dask scheduler, whose workers do the work instead; they share `out`.

    Returns:
        The report page.

    Raises:
        MacorError: the emulator fails, or the folder cannot be used.
    """
    numbers = range(1, seeds + 1)
    if cluster is not None:
        workers = ALL
    with only_one(out), engine(cluster):
        chapters = []
        for experiment in experiments:
            these = numbers[: experiment.most_seeds]
            done = partial(_sweep, seeds=these, workers=workers, out=out, watch=watch)
            results = _with_others(list(map(done, (experiment, *experiment.also))))
            chapters.append(_chapter(experiment, results, out, done))
        return write_report(out / "report", chapters, _costs(out / COSTS), watch)


def report(experiments: Sequence[Experiment], seeds: int, out: Path, watch: Watch) -> Path:
    """Write the report page of what has been done so far, also while others go on with it.

    Args:
        experiments: what to tell of; one without a result is left out.
        seeds: training seeds; those that are done everywhere count.
        out: folder of recordings, results and report.
        watch: hears of the progress.

    Returns:
        The report page.

    Raises:
        MacorError: there is no result of any, or the folder cannot be used.
    """
    chapters = []
    for number, experiment in enumerate(experiments):
        watch("reading", number, len(experiments))
        parts = [parts_of(each, out) for each in (experiment, *experiment.also)]
        done = [
            seed
            for seed in range(1, seeds + 1)[: experiment.most_seeds]
            if all(seed in part.results for of in parts for part in of)
        ]
        if done:
            results = _with_others([_whole(of, done) for of in parts])
            chapters.append(_chapter(experiment, results, out, partial(_kept, out=out)))
    watch("reading", len(experiments), len(experiments))
    if not chapters:
        names = ", ".join(each.name for each in experiments)
        raise MacorError(
            f"{out} holds no result of {names} under these settings; leave out --kept to drive"
        )
    return write_report(out / "report", chapters, _costs(out / COSTS), watch)


def _chapter(
    experiment: Experiment, results: Results, out: Path, done: Callable[[Experiment], Results]
) -> Chapter:
    """Return a chapter, beside its results what was possible, if `done` has that for all seeds."""
    starts = starts_of(experiment, out)
    more = () if starts is None else compared(experiment, results, starts, done(starts))
    return Chapter(experiment, results, more)


def _kept(experiment: Experiment, out: Path) -> Results:
    (part,) = parts_of(experiment, out)
    return part.results


def _sweep(
    experiment: Experiment, seeds: Sequence[int], workers: int, out: Path, watch: Watch
) -> Results:
    """Results of an experiment; those that are missing are made now."""
    parts = parts_of(experiment, out)
    missing = [(part, seed) for seed in seeds for part in parts if seed not in part.results]
    changed = list(dict.fromkeys(part for part, _ in missing))
    for part in changed:
        part.put_in_order()
    drives = {(r.key, seed): (r, seed) for part, seed in missing for r in part.unrecorded(seed)}
    driving = f"driving for {experiment.name}"
    for (_, seed), _, seconds in _parallel(_record, list(drives.values()), workers, driving, watch):
        append_line(out / COSTS, _cost("recording", seed, seconds))
    todo = [(parts.index(part), part.work, seed) for part, seed in missing]
    for (number, _, seed), result, seconds in _parallel(_do, todo, workers, experiment.name, watch):
        took = result.pop(TOOK, {})
        parts[number].add(seed, result)
        append_line(out / COSTS, _cost(experiment.kept_as, seed, seconds))
        for piece, spent in took.items():
            append_line(out / COSTS, _cost(f"{experiment.kept_as}: {piece}", seed, spent))
    for part in changed:
        part.put_in_order()
    return _whole(parts, seeds)


def _whole(parts: Sequence[Part], seeds: Sequence[int]) -> Results:
    return {seed: joined([part.results[seed] for part in parts]) for seed in seeds}


def _record(drive: tuple[Recordings, int]) -> None:
    recordings, seed = drive
    recordings.make(seed)


def _do(todo: tuple[int, Work, int]) -> Result:
    _, work, seed = todo
    return work(seed)


def _with_others(all_results: Sequence[Results]) -> Results:
    """Return the first results, with the trials of the others beside their own."""
    results, *others = all_results
    for other in others:
        results = {
            seed: {**result, "trials": {**result["trials"], **other[seed]["trials"]}}
            for seed, result in results.items()
        }
    return results


def _parallel(
    work: Callable[[_Given], _T], todo: Sequence[_Given], workers: int, what: str, watch: Watch
) -> Iterator[tuple[_Given, _T, float]]:
    """Work on everything: given, outcome and seconds of each, in the order that they are done."""
    calls = [joblib.delayed(_timed)(work, given) for given in todo]
    if not calls:
        return
    watch(what, 0, len(calls))
    with ExitStack() as pools:
        with unbroken():  # half-made, workers leave a folder that is warned of at the end
            pool = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")
            pools.enter_context(pool)
        for done, outcome in enumerate(pool(calls), 1):
            yield outcome
            watch(what, done, len(calls))


def _timed(work: Callable[[_Given], _T], given: _Given) -> tuple[_Given, _T, float]:
    start = time.perf_counter()
    value = work(given)
    return given, value, time.perf_counter() - start


def _costs(path: Path) -> list[dict[str, Any]]:
    """Lines that can be read of what each piece of work took."""
    return [
        line
        for line in read_lines(path)
        if line is not None
        and isinstance(line.get("what"), str)
        and isinstance(line.get("seconds"), float | int)
    ]


def _cost(what: str, seed: int, seconds: float) -> dict[str, Any]:
    return {"what": what, "seed": seed, "seconds": round(seconds, 2)}
