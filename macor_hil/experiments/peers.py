"""Peers in the same table: TD-FALCON of artlib beside the systems of table 1.

It learns from the same recorded drives: the same features, commands and reinforcement, and drives
the same trials. Its nodes, and with them the time of every presentation, grow as long as it
learns, so it gets the beginning of each drive; the other systems learn the same beginning, and the
whole drive besides. artlib is optional (the extra `peers`).
"""

from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from time import process_time
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from macor_hil.experiments.drives.course import (
    Course,
    System,
    on_course,
    trial_as_json,
)
from macor_hil.experiments.drives.falcon import MEMORY, PEER, Falcon, FalconPlanner, Parameters
from macor_hil.experiments.drives.systems import (
    ANTICIPATIVE,
    GRADED,
    REACTIVE,
    Learning,
    Q,
    learn_all,
)
from macor_hil.experiments.drives.training_drive import Drive, Recording, Recordings
from macor_hil.experiments.experiment import Courses, Experiment
from macor_hil.experiments.paper.criteria import (
    order_table,
    per_seed,
    reinforcement_a_step,
    rows,
    trials_of,
)
from macor_hil.experiments.report.drawing import draw_seeds
from macor_hil.experiments.report.elements import Element, Picture, Table, Text
from macor_hil.experiments.report.statistics import Order, estimate, mean, order
from macor_hil.experiments.results.store import TOOK, Result, Results

FALCON: Final = "TD-FALCON"
OWN: Final = (REACTIVE, ANTICIPATIVE, Q, GRADED)


@dataclass(frozen=True)
class Settings(Learning):
    """Settings of learning, and the parameters that TD-FALCON is tried with."""

    drive: Drive = field(default_factory=Drive)
    """The training drive."""
    first: int = 3_000
    """TD-FALCON learns from so many of its first commands."""
    candidates: tuple[Parameters, ...] = (
        Parameters(),
        Parameters(discount=0.5),
        Parameters(discount=0.0),
        Parameters(worth=0.9),
        Parameters(state=0.4),
        Parameters(state=0.7),
    )
    """All are driven; the one with the longest trials stands for TD-FALCON."""
    course: Course = field(default_factory=Course)
    """Trials."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """The arenas of the trials."""
        return (self.course.arena,)


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn all systems from the drive of a seed, and drive their trials."""
    whole = recordings[seed]
    first = whole.first(settings.first)
    systems: dict[str, System] = {}
    nodes: dict[str, int] = {}
    took: dict[str, float] = {}
    for label, part in (_first(settings), first), (_WHOLE, whole):
        since = process_time()
        learned = learn_all(settings, part)
        took[f"all systems of table 1, {label}"] = process_time() - since
        systems |= {f"{name}, {label}": learned[name] for name in OWN}
    for candidate in settings.candidates:
        since = process_time()
        name = _name(candidate)
        falcon = Falcon.of(candidate, first.brain.eyes.size)
        systems[name] = _learned(falcon, first, settings)
        nodes[name] = falcon.nodes
        took[name] = process_time() - since
    with on_course(settings.course, seed, settings.drive) as track:
        trials = {
            name: [trial_as_json(one) for one in track.drive(system, seed)]
            for name, system in systems.items()
        }
    return {PEER: version(PEER), "nodes": nodes, "trials": trials, TOOK: took}


def _learned(falcon: Falcon, recording: Recording, settings: Settings) -> System:
    """TD-FALCON with the eyes of all systems; it has its own situations and ignores the others."""
    brain = replace(
        recording.brain, memories={MEMORY: falcon}, reinforcement=settings.reinforcement
    )
    brain.relive(recording.seen(), situations=False)
    return System(brain, FalconPlanner())


_WHOLE: Final = "whole drive"


def _first(settings: Settings) -> str:
    return f"first {settings.first:,}"


def _name(candidate: Parameters) -> str:
    return f"{FALCON}, {candidate}"


def _lengths(results: Results, name: str) -> list[float]:
    """Mean length of trials of every seed."""
    return per_seed(results, name)["length"]


def best(settings: Settings, results: Results) -> str:
    """Return the candidate with the longest trials, the first one at a tie."""
    names = map(_name, settings.candidates)
    return max(names, key=lambda name: float(np.mean(_lengths(results, name))))


def draw(settings: Settings, results: Results) -> dict[str, Figure]:
    """Every seed: the best candidate, and the other systems on as much and on the whole drive."""
    shown = {f"{FALCON},\n{_first(settings)}": _lengths(results, best(settings, results))}
    for label in (_first(settings), _WHOLE):
        shown |= {f"{name},\n{label}": _lengths(results, f"{name}, {label}") for name in OWN}
    return {"lengths": draw_seeds(shown, "commands in a trial, mean of a seed's trials", {})}


def tell(settings: Settings, results: Results) -> list[Element]:
    """All systems in one table, the test of their order, and what it says and does not."""
    return [
        Text(_scope(settings, results)),
        _table(settings, results),
        order_table(
            f"Test of the ordering after {settings.first:,} commands",
            partial(_orders, settings, results),
        ),
        Text(_verdict(settings, results)),
        Picture("lengths", _caption(settings, results)),
        Text(_FAIRNESS),
    ]


def _scope(settings: Settings, results: Results) -> str:
    versions = sorted({result[PEER] for result in results.values()})
    return (
        f"{len(results)} training seeds, each another robot; {settings.course.trials} trials of at"
        f" most {settings.course.commands} commands of every system and seed. {FALCON} is that of"
        f" artlib {', '.join(versions)}; its vigilances are those of what is seen and of what a"
        f" command is worth. It learns the first {settings.first:,} commands of each"
        f" seed's drive, once and in their order; the systems of table 1 learn the same ones, and"
        f" the whole drive of {settings.drive.random + settings.drive.reactive:,}. What learning"
        " took, in seconds of a processor, is in the table of costs below."
    )


def _table(settings: Settings, results: Results) -> Table:
    rows = []
    for name in map(_name, settings.candidates):
        nodes = np.mean([result["nodes"][name] for result in results.values()])
        rows.append(_row(results, name, f"{nodes:.0f}"))
    for label in (_first(settings), _WHOLE):
        rows += [_row(results, f"{name}, {label}", str(settings.nodes)) for name in OWN]
    head = ("system", "nodes", "length", "r per trial", "r per step", "collided")
    return Table("Mean over seeds (95 % bootstrap interval)", head, tuple(rows))


def _row(results: Results, name: str, nodes: str) -> tuple[str, ...]:
    trials = [one for seed in trials_of(results, name) for one in seed]
    return (
        name,
        nodes,
        str(estimate(_lengths(results, name), mean)),
        str(estimate(per_seed(results, name)["r"], mean)),
        f"{reinforcement_a_step(trials):.2f}",
        f"{100 * np.mean([t.collided for t in trials]):.0f} %",
    )


def _pairs(settings: Settings, results: Results) -> list[tuple[str, str]]:
    """Return the tested pairs: `graded` and the peer, the peer and the paper's systems."""
    peer, label = best(settings, results), _first(settings)
    return [
        (f"{GRADED}, {label}", peer),
        *((peer, f"{name}, {label}") for name in (ANTICIPATIVE, Q, REACTIVE)),
    ]


def _orders(settings: Settings, results: Results, criterion: str) -> dict[str, Order]:
    """Return the tests of a criterion of `per_seed`, by their claims."""
    return {
        f"{_short(a)} over {_short(b)}": order(
            per_seed(results, a)[criterion], per_seed(results, b)[criterion]
        )
        for a, b in _pairs(settings, results)
    }


def _short(name: str) -> str:
    return name.partition(",")[0]


def _caption(settings: Settings, results: Results) -> str:
    names = [best(settings, results), *(f"{name}, {_first(settings)}" for name in OWN)]
    longest = max(names, key=lambda name: float(np.mean(_lengths(results, name))))
    return (
        f"Mean length of each seed's trials; {FALCON} with the parameters that drive longest. Of"
        f" all that learned the {_first(settings)} commands {_short(longest)} drives longest."
    )


def _verdict(settings: Settings, results: Results) -> str:
    chosen = best(settings, results)
    tests = _orders(settings, results, "length")
    held = [claim for claim, test in tests.items() if test.holds]
    shown = "; ".join(held) if held else "none"
    return (
        f"Of {len(settings.candidates)} sets of parameters {chosen} drives longest:"
        f" {estimate(_lengths(results, chosen), mean)} commands. It was chosen by these very"
        " trials, among parameters around the best of an earlier look; both favour it. Orderings"
        f" of length that these seeds show: {shown}."
    )


_FAIRNESS: Final = (
    "What is the same: the features of all frames, the three commands, what they earn, starts and"
    f" robots. What is not: {FALCON} keeps adding nodes, where the other systems have as many as"
    " the paper allows. It learns what a command is worth by SARSA, the only rule that artlib has;"
    " on a drive of random commands that is what random driving would go on to earn, and it"
    " takes the best command under this assumption. Q-learning assumes the best command from then"
    " on, and anticipation plans. Values are boxes that only widen, so what a node was first"
    " taught keeps counting. What commands earn is scaled by 1 - lambda, so that values stay"
    " between 0 and 1; a command that ends in a collision is worth what it earns. The system"
    f" {GRADED} knows more than the commands: that the robot is the same on both sides, and what"
    " it saw in the drive that tunes the receptive fields. Trials are greedy; nothing is learned in"
    " them. With other parameters, more passes or a drive of its own choice TD-FALCON may do"
    " better; that was not tried."
)

PEERS: Final = Experiment(
    "peers",
    "Peers: TD-FALCON in the same table",
    Settings(),
    trial,
    draw,
    tell,
    most_seeds=10,
    courses=Courses(
        lambda settings, _: {settings.course.place: settings.course},
        lambda settings, result: {settings.course.place: result["trials"]},
    ),
    peer=PEER,
    rows=rows,
)
