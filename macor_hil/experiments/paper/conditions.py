"""Conditions of figures 3 and 4: under which of them the claims of section 3.1 hold.

In the corridor of all other experiments both clusterers drive alike, after 1,000 steps of sensory
training as after all. Here one thing at a time is made as the paper may have had it: the robot is
not put down anywhere, so that its first 1,000 frames are a path and not a sample; what stands in
its way can be avoided by reacting; what must be avoided is rarely seen; situations are coarser;
rewards lie nearer to each other; frames are presented in another order. Beyond the paper, the
reactive system also takes the mean of a command's outcomes instead of the best one.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from khepera_protocol.zenoh.payloads import Outline
from matplotlib.figure import Figure

from macor_hil.commands import COMMANDS, FIRST_COMMAND
from macor_hil.experiments.drives.course import (
    Course,
    System,
    on_course,
    trial_as_json,
    trial_from_json,
)
from macor_hil.experiments.drives.halls import LONG_CORRIDOR, WIDE_HALL, Hall
from macor_hil.experiments.drives.path_drive import PathDrive
from macor_hil.experiments.drives.training_drive import PUT_DOWN, Drive, Recording, Recordings
from macor_hil.experiments.experiment import Courses, Experiment
from macor_hil.experiments.paper.avoidance import (
    HALF,
    Behaviour,
    Claim,
    behaviour,
    figure3_claim,
    figure4_claim,
    longer,
)
from macor_hil.experiments.paper.both_clusterers import (
    ART,
    GAS,
    reactive_system,
    trained_art,
    trained_gas,
)
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.rows import Row
from macor_hil.experiments.results.store import Result, Results
from macor_hil.mind.catalogue import memory_for
from macor_hil.mind.clusterers.clusterer import Clusterer
from macor_hil.mind.clusterers.neural_gas import Breadth
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import Competence
from macor_hil.mind.planners.expected import Expected
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.monitor.pictures import trials_figure
from macor_hil.runs.trials import Trial

NEAR: Final = Reinforcement(0.62, 0.61)
"""Rewards so near to each other that two collisions in a hundred make straight on worth less."""


@dataclass(frozen=True)
class Condition:
    """A condition: all that differs from figures 3 and 4."""

    name: str
    """Its name in tables."""
    hall: Hall | None = None
    """Arena of drive and trials; None: the arena of the default drive."""
    path: bool = False
    """True: the robot drives back after a collision and is not put down anywhere."""
    nodes: int = 30
    """n of both clusterers."""
    vigilance: float = 0.8
    """rho of Fuzzy ART."""
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    """Reinforcement of commands."""
    shuffled: bool = False
    """True: frames are presented in random order."""
    means: bool = False
    """True: the reactive system takes the mean of a command's outcomes, not the best one."""


ALL_CONDITIONS: Final = (
    Condition("as figures 3 and 4"),
    Condition("(a) a path", path=True),
    Condition("(b) long corridor", LONG_CORRIDOR),
    Condition("(b, c) wide hall with posts", WIDE_HALL),
    Condition("(d) vigilance 0.7", vigilance=0.7),
    Condition("(d) vigilance 0.6", vigilance=0.6),
    Condition("(d) 10 nodes", nodes=10),
    Condition("(e) rewards 0.62, 0.61", reinforcement=NEAR),
    Condition("(f) shuffled", shuffled=True),
    Condition("(b, e) long corridor, near rewards", LONG_CORRIDOR, reinforcement=NEAR),
    Condition("mean outcomes, (e)", reinforcement=NEAR, means=True),
    Condition("mean outcomes, (b, e) long corridor", LONG_CORRIDOR, reinforcement=NEAR, means=True),
    Condition("mean outcomes, (b, c, e) wide hall", WIDE_HALL, reinforcement=NEAR, means=True),
)

SLOW: Final = ("(b, e) long corridor, near rewards", "mean outcomes, (b, c, e) wide hall")
"""Conditions that the quick form leaves out."""


@dataclass(frozen=True)
class Settings:
    """Conditions, and what is the same in all of them."""

    drive: Drive = field(default_factory=Drive)
    """The training drive in the corridor."""
    own: int = 4_000
    """Random commands of drives that no other experiment shares: of a path, or in a hall."""
    conditions: tuple[Condition, ...] = ALL_CONDITIONS
    """Conditions that are tested."""
    early: int = 1_000
    """Frames of the short sensory training (figure 4)."""
    art_inputs: int = 9_000
    """Inputs that Fuzzy ART is given at most, once."""
    gas_presentations: int = 5
    """Presentations of all inputs to the Neural Gas; of the first ones: one."""
    breadth: Breadth = field(
        default_factory=lambda: Breadth((0.3, 0.6), (0.02, 0.05), (5.0,), (0.1,))
    )
    """The parameters of the Neural Gas that the search tries: those that figure 2's finds most."""
    searched: int = 20
    """Every so many-th of all inputs is used in the search; all of the first ones."""
    alpha: float = 0.001
    """Fuzzy ART's choice parameter, not printed."""
    competence: Competence = field(default_factory=Competence)
    """Equation 1."""
    course: Course = field(default_factory=lambda: Course(anywhere=True))
    """Trials; their arena is that of the condition."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas that come as files; halls follow from code."""
        return (self.drive.arena,)


QUICK: Final = Settings(
    drive=Drive(random=2_000),
    own=1_200,
    conditions=tuple(each for each in ALL_CONDITIONS if each.name not in SLOW),
    searched=5,
    course=Course(anywhere=True, trials=6),
)

EARLY: Final = "early"
FULL: Final = "full"


class StraightOn:
    """Drives straight on, whatever is seen: what a system must surpass."""

    memory = "transitions"

    def plan(self, _memory: Any, _now: Moment) -> Plan:
        """Choose straight on."""
        return Plan((None,) * len(COMMANDS), FIRST_COMMAND)


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn and drive both clusterers in every condition."""
    result: Result = {"outlines": {}, "straight": {}, "driven": {}, "heeded": {}}
    for condition in settings.conditions:
        drive = _drive(settings, condition, recordings.arenas)
        recording = recordings.of(drive)[seed]
        systems = {
            (steps, name): system
            for steps in (EARLY, FULL)
            for name, system in _systems(settings, condition, steps, recording, seed).items()
        }
        shares: dict[str, dict[str, float]] = {EARLY: {}, FULL: {}}
        for (steps, name), system in systems.items():
            shares[steps][name] = round(heeded(system, recording), 4)
        result["heeded"][condition.name] = shares
        where = _where(settings, condition)
        with on_course(replace(settings.course, arena=drive.arena), seed, drive) as track:
            if where not in result["straight"]:
                result["outlines"][where] = track.outline().model_dump(mode="json")
                straight = System(systems[FULL, ART].brain, StraightOn())
                result["straight"][where] = [trial_as_json(t) for t in track.drive(straight, seed)]
            driven: dict[str, dict[str, Any]] = {EARLY: {}, FULL: {}}
            for (steps, name), system in systems.items():
                driven[steps][name] = [trial_as_json(t) for t in track.drive(system, seed)]
        result["driven"][condition.name] = driven
    return result


def drives(settings: Settings, files: Path) -> list[Drive]:
    """Return the training drives of a seed."""
    return [_drive(settings, condition, files) for condition in settings.conditions]


def _drive(settings: Settings, condition: Condition, files: Path) -> Drive:
    """Return the drive that a condition learns from."""
    drive = settings.drive
    if condition.hall is not None:
        drive = replace(drive, arena=condition.hall.file(files), random=settings.own)
    if condition.path:
        drive = PathDrive(**vars(replace(drive, random=settings.own, reactive=0)))
    return drive


def _where(settings: Settings, condition: Condition) -> str:
    return settings.drive.arena if condition.hall is None else condition.hall.name


def _systems(
    settings: Settings, condition: Condition, steps: str, recording: Recording, seed: int
) -> Mapping[str, System]:
    """Learn situations from the first frames or from all, and transitions from all."""
    inputs = recording.inputs
    if condition.shuffled:
        inputs = inputs[np.random.default_rng(seed).permutation(len(inputs))]
    times, every = settings.gas_presentations, settings.searched
    if steps == EARLY:
        inputs, times, every = inputs[: settings.early], 1, 1
    nodes = condition.nodes
    clusterers: dict[str, Clusterer] = {
        ART: trained_art(inputs[: settings.art_inputs], nodes, condition.vigilance, settings.alpha),
        GAS: trained_gas(inputs, nodes, settings.breadth, times, every, seed),
    }
    planner = Expected(gamma=0.0, max_steps=1) if condition.means else Reactive()
    return {
        name: reactive_system(
            recording, each, nodes, settings.competence, condition.reinforcement, planner
        )
        for name, each in clusterers.items()
    }


def heeded(system: System, recording: Recording) -> float:
    """Return the share of a drive's collisions straight ahead before which a system would turn."""
    hits = np.flatnonzero(recording.collided & (recording.commands == FIRST_COMMAND))
    memory = memory_for(system.brain, system.planner)
    turned = 0
    for before in hits - 1:
        led = int(recording.commands[before])
        led = FIRST_COMMAND if led == PUT_DOWN else led
        now = system.brain.perceive(recording.raw[before], led, learn=False)
        turned += system.planner.plan(memory, now).command not in (None, FIRST_COMMAND)
    return turned / max(1, len(hits))


def _trials(results: Results, condition: Condition, steps: str, name: str) -> list[list[Trial]]:
    """Trials, one list a seed."""
    return [
        [trial_from_json(one) for one in result["driven"][condition.name][steps][name]]
        for result in results.values()
    ]


@dataclass(frozen=True, slots=True)
class _Tested:
    """Behaviour under a condition: both systems after the first frames and after all."""

    condition: Condition
    straight: Behaviour
    early: tuple[Behaviour, Behaviour]
    full: tuple[Behaviour, Behaviour]

    @property
    def figure3(self) -> Claim:
        return figure3_claim(*self.full, self.straight)

    @property
    def figure4(self) -> Claim:
        return figure4_claim(*self.early, self.straight)


def _tested(settings: Settings, results: Results) -> list[_Tested]:
    def of(condition: Condition, steps: str) -> tuple[Behaviour, Behaviour]:
        turn = condition.reinforcement.turn
        art, gas = (behaviour(_trials(results, condition, steps, n), turn) for n in (ART, GAS))
        return art, gas

    def straight(condition: Condition) -> Behaviour:
        where = _where(settings, condition)
        trials = [[trial_from_json(t) for t in r["straight"][where]] for r in results.values()]
        return behaviour(trials, condition.reinforcement.turn)

    return [
        _Tested(each, straight(each), of(each, EARLY), of(each, FULL))
        for each in settings.conditions
    ]


def rows(settings: Settings, results: Results) -> Iterator[Row]:
    """Return one row for each trial."""
    for seed, result in results.items():
        for condition in settings.conditions:
            for steps in (EARLY, FULL):
                for name in (ART, GAS):
                    driven = result["driven"][condition.name][steps][name]
                    for number, one in enumerate(map(trial_from_json, driven)):
                        yield {
                            "condition": condition.name,
                            "arena": _where(settings, condition),
                            "sensory_training": settings.early if steps == EARLY else "all",
                            "seed": seed,
                            "clusterer": name,
                            "trial": number,
                            "commands": one.length,
                            "collided": int(one.collided),
                            "reinforcement": round(one.total, 3),
                        }


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Draw ways of both clusterers under the condition that separates them most."""
    condition, steps = _most_apart(_tested(settings, results))
    result = next(iter(results.values()))
    outline = Outline.model_validate(result["outlines"][_where(settings, condition)])
    driven = result["driven"][condition.name][steps]
    pairs = zip(*(map(trial_from_json, driven[name]) for name in (ART, GAS)), strict=True)
    number, _ = max(enumerate(pairs), key=lambda each: abs(each[1][0].length - each[1][1].length))
    shown = {name: (outline, trial_from_json(driven[name][number])) for name in (ART, GAS)}
    return {"trajectories": trials_figure(shown)}


def _most_apart(tested: list[_Tested]) -> tuple[Condition, str]:
    """Return the condition and the training of the greatest difference of length."""
    cases = [(one.condition, steps, pair) for one in tested for steps, pair in _both(one)]
    condition, steps, _ = max(cases, key=lambda case: abs(longer(*case[2]).difference.value))
    return condition, steps


def _both(one: _Tested) -> tuple[tuple[str, tuple[Behaviour, Behaviour]], ...]:
    return (EARLY, one.early), (FULL, one.full)


def tell(settings: Settings, results: Results) -> list[Element]:
    """Tell under which conditions the claims of figures 3 and 4 hold, and the numbers behind it."""
    tested = _tested(settings, results)
    condition, steps = _most_apart(tested)
    what = {EARLY: f"after {settings.early:,} frames", FULL: "after all frames"}
    return [
        Text(_first_sentence(tested)),
        Text(
            f"{len(results)} training seeds; {settings.drive.random:,} random commands in the"
            f" {settings.drive.arena}, {settings.own:,} as a path and in the halls;"
            f" {settings.course.trials} trials of at most {settings.course.commands} commands from"
            " anywhere. A system avoids collisions if the share of its trials that collide is"
            f" shown to be below {100 * HALF:.0f} % (95 % interval over seeds), and its trials to"
            " be longer than those of a robot that drives straight on from the same starts."
            " Figure 3 holds if both systems avoid collisions after all frames, Fuzzy ART with"
            " earlier first turns (paired by seed); figure 4 holds if after the first"
            f" {settings.early:,} frames Fuzzy ART does, the Neural Gas is not shown to, and Fuzzy"
            " ART drives longer (paired by seed)."
        ),
        Table(
            "The claims by condition",
            ("condition", "figure 3 holds", "figure 4 holds"),
            tuple((one.condition.name, _cell(one.figure3), _cell(one.figure4)) for one in tested),
        ),
        *(_numbers(f"Trials {what[k]} of sensory training", tested, k) for k in (EARLY, FULL)),
        _heeding(settings, results, what),
        Picture(
            "trajectories",
            f"Seed {next(iter(results))}, the trial of the greatest difference, under the condition"
            f" that separates both systems most: {condition.name}, {what[steps]}. A cross marks a"
            " collision.",
        ),
        Text(
            "Conditions differ from the first one in what they name; all drives are of random"
            " commands alone, and the search for the Neural Gas's parameters tries"
            f" {len(settings.breadth.annealings(1))} combinations."
        ),
    ]


def _first_sentence(tested: list[_Tested]) -> str:
    said = []
    for figure, claims in (
        ("figure 3", [one.figure3 for one in tested]),
        ("figure 4", [one.figure4 for one in tested]),
    ):
        held = [
            one.condition.name for one, claim in zip(tested, claims, strict=True) if claim.holds
        ]
        under = (
            f"holds under {len(held)} of {len(tested)} conditions ({'; '.join(held)})"
            if held
            else f"holds under none of {len(tested)} conditions"
        )
        said.append(f"the claim of {figure} {under}")
    return f"Here {' and '.join(said)}."


def _cell(claim: Claim) -> str:
    return f"{'yes' if claim.holds else 'no'}: {claim.said}"


def _numbers(title: str, tested: list[_Tested], steps: str) -> Table:
    """Return length, collisions and turns of both systems, and the paired test."""
    lines = []
    for one in tested:
        art, gas = dict(_both(one))[steps]
        test = longer(art, gas)
        cells = (f"{test.difference}", f"{test.p:.3f}")
        lines.append((one.condition.name, *map(_summary, (one.straight, art, gas)), *cells))
    head = ("condition", "straight on", ART, GAS, "Fuzzy ART longer by", "p")
    return Table(f"{title}: mean length; collided; turns", head, tuple(lines))


def _heeding(settings: Settings, results: Results, what: Mapping[str, str]) -> Table:
    """Return how often each system would have turned where the training drive did not."""

    def cell(condition: Condition, steps: str, name: str) -> str:
        values = [result["heeded"][condition.name][steps][name] for result in results.values()]
        return f"{100 * np.mean(values):.0f} %"

    columns = [(steps, name) for steps in (EARLY, FULL) for name in (ART, GAS)]
    return Table(
        "Share of the training drive's collisions straight ahead before which a system would turn",
        ("condition", *(f"{name}, {what[steps]}" for steps, name in columns)),
        tuple(
            (each.name, *(cell(each, *column) for column in columns))
            for each in settings.conditions
        ),
    )


def _summary(system: Behaviour) -> str:
    length, turns = np.mean(system.lengths), np.mean(system.turns)
    share = system.share
    return (
        f"{length:.1f}; {100 * share.value:.0f} % ({100 * share.low:.0f} to"
        f" {100 * share.high:.0f}); {100 * turns:.0f} %"
    )


def courses(settings: Settings, files: Path) -> dict[str, Course]:
    """Return the course of each arena."""
    return {
        _where(settings, each): replace(settings.course, arena=_drive(settings, each, files).arena)
        for each in settings.conditions
    }


def driven(settings: Settings, result: Result) -> dict[str, dict[str, Any]]:
    """Return the trials by arena, systems named by their conditions."""
    found = {where: {"straight on": trials} for where, trials in result["straight"].items()}
    for each in settings.conditions:
        of = found[_where(settings, each)]
        for steps, said in ((EARLY, f"{settings.early:,} frames"), (FULL, "all frames")):
            for name, trials in result["driven"][each.name][steps].items():
                of[f"{each.name}, {name}, {said}"] = trials
    return found


CONDITIONS: Final = Experiment(
    "conditions",
    "Conditions of figures 3 and 4",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    quick=QUICK,
    rows=rows,
    drives=drives,
    courses=Courses(courses, driven),
)
