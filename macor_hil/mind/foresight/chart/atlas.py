"""Everything that planners on a chart read: it depends on no goal, and serves all of them."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.mind.foresight.chart.chart import Chart, charted
from macor_hil.mind.foresight.chart.ground import Ground, ground_of
from macor_hil.mind.foresight.chart.matching import noise_of
from macor_hil.mind.foresight.chart.views import Views
from macor_hil.mind.foresight.chart.whereabouts import Whereabouts
from macor_hil.mind.foresight.skill import Skill, learned_skill

_SKILL: Final = 3_000
"""Last views that the skill is learned from."""

_NOISE: Final = 1_000
"""Driven commands that noise is measured by."""

_LEAST: Final = 50
"""Views that a chart needs."""


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """A chart, with the robot's skill and the ground.

    Attributes:
        skill: motions of the commands, and chances of a collision.
        chart: poses of the training's views.
        ground: the floor that they show.
        whereabouts: tells where a view was taken.
    """

    skill: Skill
    chart: Chart
    ground: Ground
    whereabouts: Whereabouts


def atlas_of(
    profiles: Array, sights: Array, commands: Indices, collided: Mask, earned: Array
) -> Atlas | None:
    """Return the atlas of a training; None: it shows too little.

    Args:
        profiles: of every view, shape (T, directions).
        sights: what stands around, shape (T, 24, 5).
        commands: index of the command that led to each view, negative where none did, shape (T,).
        collided: whether it ended in a collision, shape (T,).
        earned: what it earned, shape (T,).
    """
    last = slice(-_SKILL, None)
    skill = learned_skill(profiles[last], commands[last], collided[last], earned[last])
    if skill is None or np.count_nonzero(~collided) < _LEAST:
        return None
    views = Views.of(profiles, sights)
    views = replace(views, noise=_noise(views, commands, collided, skill))
    chart = charted(views, commands, collided, skill.motions)
    if len(chart.matched) < _LEAST:
        return None
    ground = ground_of(chart.poses[chart.matched], views.profiles[chart.matched])
    return Atlas(skill, chart, ground, Whereabouts(chart, views))


def _noise(views: Views, commands: Indices, collided: Mask, skill: Skill) -> float:
    through = 1 + np.flatnonzero((commands[1:] >= 0) & ~collided[1:])[:_NOISE]
    before, after = views.profiles[through - 1], views.profiles[through]
    return noise_of(before, after, skill.motions[commands[through]])
