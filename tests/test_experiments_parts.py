"""Parts of an experiment: worked on and kept one by one, told as one."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from macor_hil.experiments.destinations import DESTINATIONS
from macor_hil.experiments.drives.training_drive import Drive, Recordings
from macor_hil.experiments.experiment import Experiment
from macor_hil.experiments.results.store import Result, Results
from macor_hil.experiments.suite.amounts import AMOUNTS
from macor_hil.experiments.suite.arenas import ARENAS
from macor_hil.experiments.sweep import part
from macor_hil.experiments.sweep.part import joined
from macor_hil.experiments.sweep.runner import reproduce

Said = tuple[str, int, int]


@dataclass(frozen=True)
class Letters:
    letters: str
    drive: Drive = field(default_factory=Drive)
    arenas: tuple[str, ...] = ()


def trial(settings: Letters, seed: int, _: Recordings) -> Result:
    return {"driven": [f"{letter}{seed}" for letter in settings.letters]}


def spell(letters: str, told: list[Results]) -> Experiment:
    def tell(_: Letters, results: Results) -> Sequence[Any]:
        told.append(results)
        return ()

    return Experiment(
        "letters",
        "Letters",
        Letters(letters),
        trial,
        draw=lambda *_: {},
        tell=tell,
        drives=lambda *_: (),
        parts=lambda settings: [replace(settings, letters=one) for one in settings.letters],
    )


@pytest.fixture
def _without_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """This file is no part of the code that results are kept under."""
    monkeypatch.setattr(part, "digest", lambda *_: "code")


@pytest.mark.usefixtures("_without_code")
def test_parts_are_told_as_one_and_shared_by_runs_that_have_them(tmp_path: Path) -> None:
    told: list[Results] = []
    said: list[Said] = []
    for letters, seeds in (("ab", 2), ("bca", 2)):
        reproduce([spell(letters, told)], seeds, 1, tmp_path, lambda *step: said.append(step))
    assert told == [
        {1: {"driven": ["a1", "b1"]}, 2: {"driven": ["a2", "b2"]}},
        {1: {"driven": ["b1", "c1", "a1"]}, 2: {"driven": ["b2", "c2", "a2"]}},
    ]
    assert [of for what, done, of in said if what == "letters" and done == 0] == [4, 2]


@pytest.mark.usefixtures("_without_code")
def test_a_stop_loses_no_part_that_is_done(tmp_path: Path) -> None:
    said: list[Said] = []

    def stop(*step: Any) -> None:
        said.append(step)
        if step[1] == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce([spell("abcd", [])], 1, 1, tmp_path, stop)
    reproduce([spell("abcd", [])], 1, 1, tmp_path, lambda *step: said.append(step))
    assert said[-4:] == [(what, done, 1) for what in ("letters", "report") for done in (0, 1)]


def test_results_of_parts_follow_one_another() -> None:
    assert joined([{"a": [1]}]) == {"a": [1]}
    assert joined([{"a": [1]}, {"a": []}, {"a": [2, 3]}]) == {"a": [1, 2, 3]}


FEW = replace(
    ARENAS,
    settings=replace(ARENAS.settings, homes=ARENAS.settings.homes[:4], mixture=(100,), unseen=(0,)),
)


@pytest.mark.parametrize("experiment", [FEW, AMOUNTS, DESTINATIONS], ids=lambda one: one.name)
def test_parts_have_all_drives_and_nothing_of_each_other(
    experiment: Experiment, tmp_path: Path
) -> None:
    drives, parts, settings = experiment.drives, experiment.parts, experiment.settings
    assert drives is not None
    assert parts is not None
    found = [drives(each, tmp_path) for each in parts(settings)]
    assert [drive for each in found for drive in each] == list(drives(settings, tmp_path))
    assert len({repr(each) for each in parts(settings)}) == len(found) > 1
