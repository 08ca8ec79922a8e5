"""Trials at all points of the map, from one recorded drive.

Corridors of other measures are driven with what was learned in the usual one, and equation 1 does
not decide what is learned, so that neither needs a drive or a learning of its own.
"""

from dataclasses import asdict, replace
from functools import cache
from typing import Any, Final

from macor_hil.experiments.drives.course import Course, System, on_course
from macor_hil.experiments.drives.systems import ANTICIPATIVE, REACTIVE, Q, learn_all
from macor_hil.experiments.drives.training_drive import Recordings
from macor_hil.experiments.paper.sensitivity.points import Point, Settings
from macor_hil.experiments.results.store import Result
from macor_hil.mind.memories.transitions import Competence, SensorimotorMap

SYSTEMS: Final = (REACTIVE, ANTICIPATIVE, Q)

_UNREAD: Final = {REACTIVE: ("gamma",), ANTICIPATIVE: ("gamma",), Q: ("w_max", "mu")}
"""Fields that a system does not know."""

_NOT_LEARNED: Final = ("w_max", "mu", "width", "distance")
"""Fields on which nothing that is learned depends."""


def trial(settings: Settings, seed: int, recordings: Recordings) -> Result:
    """Learn at every point from the drive of a seed, and drive the trials of all systems."""
    recording = recordings[seed]

    @cache
    def learned(point: Point) -> dict[str, System]:
        return learn_all(point.learning(), recording.first(point.commands), SYSTEMS)

    @cache
    def driven(name: str, point: Point) -> list[list[Any]]:
        system = learned(_without(_NOT_LEARNED, point, settings.base))[name]
        course = replace(settings.course, arena=point.corridor().file(recordings.arenas))
        return _trials(course, with_competence(system, point.competence()), seed, settings)

    return {
        "driven": [
            {
                "point": asdict(point),
                "trials": {
                    name: driven(name, _without(_UNREAD[name], point, settings.base))
                    for name in SYSTEMS
                },
            }
            for point in settings.points()
        ]
    }


def _without(fields: tuple[str, ...], point: Point, base: Point) -> Point:
    """Return a point that differs from the base in no field of some."""
    return replace(point, **{name: getattr(base, name) for name in fields})


def with_competence(system: System, competence: Competence) -> System:
    """Return a system that has learned the same, with other parameters of equation 1."""
    known = system.brain.memories["transitions"]
    assert isinstance(known, SensorimotorMap)
    weighed = SensorimotorMap(known.nodes, known.commands, competence)
    weighed.load(known.state())
    memories = {**system.brain.memories, "transitions": weighed}
    return System(replace(system.brain, memories=memories), system.planner)


def _trials(course: Course, system: System, seed: int, settings: Settings) -> list[list[Any]]:
    """Return commands, collision and reinforcement of every trial."""
    with on_course(course, seed, settings.drive) as track:
        return [
            [one.length, one.collided, round(one.total, 4)] for one in track.drive(system, seed)
        ]
