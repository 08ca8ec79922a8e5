"""Figure 3: reactive navigation by Fuzzy ART and by a Neural Gas, both fully trained (section 3.1).

Learning is sequential here: first the situations (Fuzzy ART from 9,000 inputs presented once, the
Neural Gas from 13,100 presented five times), then, with the situations fixed, the transitions of
the whole drive. 30 nodes, vigilance 0.8, reactive behaviour.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import Course, on_course, trial_as_json, trial_from_json
from macor_hil.experiments.drives.training_drive import (
    QUICK_DRIVE,
    SECTION_31,
    Drive,
    Recordings,
)
from macor_hil.experiments.experiment import Courses, Experiment
from macor_hil.experiments.paper.avoidance import (
    HALF,
    Behaviour,
    Claim,
    behaviour,
    figure3_claim,
)
from macor_hil.experiments.paper.both_clusterers import (
    ART,
    GAS,
    reactive_system,
    trained_art,
    trained_gas,
)
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row, trial_rows
from macor_hil.experiments.report.statistics import estimate, order
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.clusterers.clusterer import Clusterer
from macor_hil.mind.clusterers.clusterer_error import clusterer_errors
from macor_hil.mind.clusterers.neural_gas import Breadth
from macor_hil.mind.memories.transitions import Competence
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.monitor.pictures import trials_figure
from macor_hil.runs.trials import Trial


@dataclass(frozen=True)
class Settings:
    """Section 3.1, with the paper's values for figure 3."""

    drive: Drive = SECTION_31
    """About 11,000 random and 2,000 reactive commands."""
    nodes: int = 30
    """n of both clusterers."""
    vigilance: float = 0.8
    """rho of Fuzzy ART."""
    alpha: float = 0.001
    """Its choice parameter, not printed."""
    art_inputs: int = 9_000
    """Inputs that Fuzzy ART is given, once."""
    gas_inputs: int = 13_100
    """Inputs of one presentation to the Neural Gas."""
    gas_presentations: int = 5
    """Presentations to the Neural Gas."""
    breadth: Breadth = field(default_factory=Breadth)
    """The parameters of the Neural Gas that the search tries."""
    searched: int = 10
    """Every so many-th input is used in the search."""
    competence: Competence = field(default_factory=Competence)
    """Equation 1."""
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    """The reinforcement of commands."""
    course: Course = field(default_factory=Course)
    """Trials from the arena's start."""
    elsewhere: Course = field(default_factory=lambda: Course(anywhere=True))
    """Trials from anywhere in the arena."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return self.course.arena, self.elsewhere.arena


HOURS: Final = {ART: 4.5, GAS: 32.7}
"""Training times of figure 3 as printed."""


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn situations, then transitions, with both clusterers; drive both reactively."""
    recording = recordings[seed]
    inputs = recording.inputs
    clusterers: dict[str, Clusterer] = {
        ART: trained_art(
            inputs[: settings.art_inputs], settings.nodes, settings.vigilance, settings.alpha
        ),
        GAS: trained_gas(
            inputs[: settings.gas_inputs],
            settings.nodes,
            settings.breadth,
            settings.gas_presentations,
            settings.searched,
            seed,
        ),
    }
    systems = {
        name: reactive_system(
            recording, each, settings.nodes, settings.competence, settings.reinforcement
        )
        for name, each in clusterers.items()
    }
    result: Result = {
        "seconds_a_command": round(
            recording.robot_seconds / settings.drive.schedule(0).commands, 4
        ),
        "error": {
            name: round(float(clusterer_errors(each, inputs).mean()), 6)
            for name, each in clusterers.items()
        },
        "outlines": {},
    }
    for place, course in _courses(settings).items():
        with on_course(course, seed, settings.drive) as track:
            result["outlines"][place] = track.outline().model_dump(mode="json")
            result[place] = {
                name: [trial_as_json(t) for t in track.drive(system, seed)]
                for name, system in systems.items()
            }
    return result


def _courses(settings: Settings) -> dict[str, Course]:
    return {"start": settings.course, "anywhere": settings.elsewhere}


def _trials(results: Results, place: str, name: str) -> list[list[Trial]]:
    """Trials, one list a seed."""
    return [[trial_from_json(t) for t in result[place][name]] for result in results.values()]


def _lengths(results: Results, place: str, name: str) -> list[float]:
    """Mean length of trials of every seed."""
    return [float(np.mean([t.length for t in ts])) for ts in _trials(results, place, name)]


def draw(_: Settings, results: Results) -> dict[str, Figure]:
    """From the first seed: its first trial of each system from the start, and from anywhere."""
    result = next(iter(results.values()))
    shown = {
        f"{name}, {place}": (
            Outline.model_validate(result["outlines"][place]),
            trial_from_json(result[place][name][0]),
        )
        for place in ("start", "anywhere")
        for name in (ART, GAS)
    }
    return {"trajectories": trials_figure(shown)}


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report steps, hours and behaviour side by side, with the paper's claim."""
    art, gas = both_behaviours(settings, results)
    first = first_sentence("figure 3", figure3_claim(art, gas), settings, results)
    return [
        Text(first),
        *side_by_side(settings, results, HOURS),
        Text(_CLAIM),
        Text(differences(settings)),
    ]


def both_behaviours(settings: Settings, results: Results) -> tuple[Behaviour, Behaviour]:
    """Return the behaviour from anywhere of Fuzzy ART and of the Neural Gas."""
    turn = settings.reinforcement.turn
    art, gas = (behaviour(_trials(results, "anywhere", name), turn) for name in (ART, GAS))
    return art, gas


def first_sentence(figure: str, claim: Claim, settings: Settings, results: Results) -> str:
    """Return whether a figure's claim holds here, and under what conditions."""
    art, gas = both_behaviours(settings, results)
    reward = settings.reinforcement
    shares = " and ".join(
        f"{name} in {100 * each.share.value:.0f} % ({100 * each.share.low:.0f} to"
        f" {100 * each.share.high:.0f} %)"
        for name, each in ((ART, art), (GAS, gas))
    )
    return (
        f"The claim of {figure} {'holds' if claim.holds else 'does not hold'} here, that is, in the"
        f" {settings.elsewhere.arena} from anywhere, with {settings.nodes} nodes, vigilance"
        f" {settings.vigilance:g} and reinforcement {reward.straight:g}, {reward.turn:g} and"
        f" {reward.collision:g} for straight on, a turn and a collision: {claim.said}; of the"
        f" trials collide {shares}, and a system avoids collisions if that is shown to be below"
        f" {100 * HALF:.0f} %. The experiment `conditions` tests it under others."
    )


def side_by_side(settings: Settings, results: Results, hours: dict[str, float]) -> list[Element]:
    """Return what figures 3 and 4 have in common: the picture and both tables."""
    return [
        Text(
            f"{len(results)} training seeds, {settings.nodes} nodes, vigilance"
            f" {settings.vigilance:g}; {settings.course.trials} reactive trials of each system"
            f" from the arena's start and {settings.elsewhere.trials} from anywhere."
        ),
        Picture("trajectories", _caption(results)),
        _table(settings, results, hours),
        _comparison(results),
        Text(_verdict(results)),
    ]


def _table(settings: Settings, results: Results, hours: dict[str, float]) -> Table:
    steps = {ART: settings.art_inputs, GAS: settings.gas_inputs * settings.gas_presentations}
    seconds = np.mean([result["seconds_a_command"] for result in results.values()])
    rows: list[tuple[str, ...]] = [
        ("sensory training steps", *(f"{steps[name]}" for name in (ART, GAS))),
        ("the same in robot hours", *(f"{steps[n] * seconds / 3600:.1f}" for n in (ART, GAS))),
    ]
    if hours:
        rows.append(("robot hours, paper", *(f"{hours[name]:.1f}" for name in (ART, GAS))))
    errors = ([result["error"][n] for result in results.values()] for n in (ART, GAS))
    rows.append(("clusterer error", *(str(estimate(values)) for values in errors)))
    for place, label in (("start", "from the start"), ("anywhere", "from anywhere")):
        measured = [_behaviour(results, place, name) for name in (ART, GAS)]
        for k, what in enumerate(("length", "r per trial", "collided")):
            rows.append((f"{what}, {label}", *(each[k] for each in measured)))
    title = "Both clusterers, interquartile means over seeds (95 % intervals)"
    return Table(title, ("", ART, GAS), tuple(rows))


def _behaviour(results: Results, place: str, name: str) -> tuple[str, str, str]:
    seeds = _trials(results, place, name)
    totals = [float(np.mean([t.total for t in trials])) for trials in seeds]
    hit = float(np.mean([t.collided for trials in seeds for t in trials]))
    lengths = _lengths(results, place, name)
    return str(estimate(lengths)), str(estimate(totals)), f"{100 * hit:.0f} %"


def _comparison(results: Results) -> Table:
    rows = []
    for place in ("start", "anywhere"):
        test = order(_lengths(results, place, ART), _lengths(results, place, GAS))
        counts = f"{test.wins} / {test.ties} / {test.seeds - test.wins - test.ties}"
        said = "yes" if test.holds else "not shown"
        rows.append((place, str(test.difference), counts, f"{test.p:.4f}", said))
    head = ("starts", "mean difference of length", "better / equal / worse", "p", "holds")
    return Table("Fuzzy ART over Neural Gas, paired by seed", head, tuple(rows))


def _caption(results: Results) -> str:
    hit = [t.collided for n in (ART, GAS) for ts in _trials(results, "start", n) for t in ts]
    means = " and ".join(
        f"{float(np.mean(_lengths(results, 'anywhere', name))):.1f} ({name})" for name in (ART, GAS)
    )
    return (
        f"First trials of seed {next(iter(results))}; a cross marks a collision. From the start"
        f" {sum(hit)} of all {len(hit)} trials end in one; from anywhere they are {means} commands"
        " long in the mean."
    )


def _verdict(results: Results) -> str:
    test = order(_lengths(results, "anywhere", ART), _lengths(results, "anywhere", GAS))
    back = order(_lengths(results, "anywhere", GAS), _lengths(results, "anywhere", ART))
    hit = [t.collided for n in (ART, GAS) for ts in _trials(results, "start", n) for t in ts]
    said = "neither system is shown to drive longer than the other"
    if test.holds:
        said = "Fuzzy ART drives longer than the Neural Gas"
    elif back.holds:
        said = "the Neural Gas drives longer than Fuzzy ART"
    return (
        f"Here, from anywhere, {said} (mean difference {test.difference}). From the arena's start"
        f" {sum(hit)} of all {len(hit)} trials end in a collision."
    )


_CLAIM: Final = (
    "The paper: with full training both systems avoid collisions, Fuzzy ART with early turns; a"
    " trial there ended in a collision or at the other end of the scenario."
)


def differences(settings: Settings) -> str:
    """Return the differences from the paper."""
    return (
        "Differences from the paper: its scenario is not printed; in the corridor used here a"
        " wall must be avoided 10 cm ahead, which no reactive system can, so that trials from"
        " anywhere are shown too. The last"
        f" {settings.drive.reactive} commands of the drive were selected by the reactive system"
        " of table 1, not by the system that learns from them. Hours are commands times the mean"
        " time of a command on the robot's clock."
    )


def rows(_: Settings, results: Results) -> Iterator[Row]:
    """Yield one row for each trial."""
    for seed, result in results.items():
        for place in ("start", "anywhere"):
            for system, trials in result[place].items():
                where: Row = {"starts": place, "seed": seed, "system": system}
                yield from trial_rows(map(trial_from_json, trials), where)


def make(name: str, title: str, settings: Settings, tell: Any, quick: Settings) -> Experiment:
    """Return an experiment of this kind."""
    courses = Courses(
        lambda settings, _: _courses(settings),
        lambda settings, result: {place: result[place] for place in _courses(settings)},
    )
    return Experiment(
        name, title, settings, trial, draw, tell, quick=quick, rows=rows, courses=courses
    )


QUICK: Final = Settings(
    drive=QUICK_DRIVE,
    art_inputs=1_000,
    gas_inputs=1_500,
    course=Course(trials=2),
    elsewhere=Course(trials=2, anywhere=True),
)

FIGURE3 = make("figure3", "Figure 3: reactive navigation, fully trained", Settings(), tell, QUICK)
