"""Beyond the paper: drives to a goal that is named after the training (section 4, outlook).

The training's views are joined to a chart (`foresight.chart`), the camera's own views tell where
the goal was seen near, and value iteration over the chart gives the worth of every pose. With a new
goal only that is done anew. A decision finds the robot in the chart by what it sees, follows every
sequence of a few commands over the floor that it sees now, and adds the worth of where each ends:

    V(pose) = max over a of p (R + g V(pose after a)),

with p the chance to get through, R the reward of the place reached, and g what a command costs.
Where a goal is to be kept to, every command without a collision has a share of its reward: without
that, the nearest way along it is the best, even into a dead end.
Where the robot is in no place of the chart, or no way is known, foresight drives it on.
"""

from typing import Annotated, Final

import numpy as np
from pydantic import Field

from macor_hil.arrays import Array
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Moment
from macor_hil.mind.foresight.chart.atlas import Atlas
from macor_hil.mind.foresight.chart.views import Views
from macor_hil.mind.foresight.chart.worth import Worth, worth_of
from macor_hil.mind.foresight.floor import clearance, solids
from macor_hil.mind.foresight.motions import moved
from macor_hil.mind.memories.places import PlacesMemory
from macor_hil.mind.planners.destinations import destination
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.mind.planners.planner import NO_PLAN, Aim, Plan, best_command

_AHEAD: Final = 5
"""Commands of the sequences that are followed over the floor in view."""

_ALIVE: Final = 0.2
"""Reward of a command without a collision, as a share of that of a goal that is kept to."""

_HOPELESS: Final = 1e-3
"""Worth of a pose from which no way is known."""


class Goal:
    """Worth of the ways to a goal.

    Args:
        goal: name of a destination.
        keeps: share of a reward that a command leaves of it; the nearer to 1, the more of a detour
            a chance of a collision is worth.
        memory: name of the memory that it reads.

    Attributes:
        destination: the goal.

    Raises:
        MacorError: there is no such goal.
    """

    def __init__(
        self,
        goal: str = "red",
        keeps: Annotated[float, Field(ge=0.5, le=0.9999)] = 0.995,
        memory: str = "places",
    ) -> None:
        self.destination = destination(goal)
        self.memory = memory
        self._keeps = keeps
        self._foresight = Foresight()
        self._atlas: Atlas | None = None
        self._worth: Worth | None = None
        self._sequences: list[Array] = []
        self._pose: Array | None = None

    def prepare(self, memory: PlacesMemory) -> None:
        """Do what is done once for a map and a goal, some seconds; `plan` does it if need be."""
        atlas = memory.atlas
        if atlas is None or atlas is self._atlas:
            return
        known = atlas.chart.known
        seen = self.destination.reached(memory.profiles[known], memory.sights[known])
        reward = atlas.ground.reward(atlas.chart.poses[known], seen)
        if self.destination.along:
            reward = _ALIVE + (1 - _ALIVE) * reward
        self._worth = worth_of(
            atlas.ground,
            reward,
            atlas.skill.motions,
            atlas.skill.curve,
            self._keeps,
            ends=not self.destination.along,
        )
        self._sequences = _sequences(atlas.skill.motions)
        self._atlas, self._pose = atlas, None

    def plan(self, memory: PlacesMemory, now: Moment) -> Plan:
        """Evaluate the commands; none where nothing was learned, or no floor is seen."""
        self.prepare(memory)
        if self._atlas is None or self._worth is None or now.floor is None or now.sights is None:
            return NO_PLAN
        self._pose = self._whereabouts(self._atlas, now)
        if self._pose is not None:
            values = self._evaluations(self._atlas, self._worth, self._pose, now.floor)
            if values.max() > _HOPELESS:
                evaluations = tuple(values.tolist())
                return Plan(evaluations, best_command(evaluations), steps=_AHEAD)
        return self._foresight.plan(memory, now)

    def aim(self, now: Moment) -> Aim:
        """Return the goal as it is seen at a moment."""
        goal = self.destination
        if now.floor is None or now.sights is None:
            return Aim(goal.name, ends=not goal.along)
        return Aim(
            goal.name,
            goal.bearing(now.floor, now.sights),
            bool(goal.reached(now.floor, now.sights)),
            not goal.along,
        )

    def _whereabouts(self, atlas: Atlas, now: Moment) -> Array | None:
        assert now.floor is not None
        assert now.sights is not None
        seen = Views.of(now.floor[np.newaxis], now.sights[np.newaxis])
        foreseen = None
        if self._pose is not None:
            foreseen = moved(self._pose, atlas.skill.motions[now.neuron % len(COMMANDS)])
        return atlas.whereabouts.find(seen, foreseen)

    def _evaluations(self, atlas: Atlas, worth: Worth, pose: Array, floor: Array) -> Array:
        """Return the worth of each command at a pose, shape (m,)."""
        places = np.concatenate([each[:, :2] for each in self._sequences])
        room = np.split(
            clearance(solids(floor), places),
            np.cumsum([len(each) for each in self._sequences[:-1]]),
        )
        poses = [moved(pose, each) for each in self._sequences]
        value: Array = worth.at(poses[-1]).astype(np.float64)
        for number in reversed(range(_AHEAD)):
            through = atlas.skill.curve.survival(room[number], number)
            reward = worth.reward_at(poses[number])
            rest = (1.0 - reward) if worth.ends else 1.0
            value = through * (reward + rest * self._keeps * value)
            if number:
                value = value.reshape(len(COMMANDS), -1).max(axis=0)
        return value


def _sequences(motions: Array) -> list[Array]:
    """Return the poses after one command, after two, ...: shapes (m, 3), (m * m, 3), ...

    The last command is the slowest index, so that a maximum over it gives the poses before.
    """
    poses = [np.zeros((1, 3))]
    for _ in range(_AHEAD):
        poses.append(
            moved(np.tile(poses[-1], (len(motions), 1)), np.repeat(motions, len(poses[-1]), 0))
        )
    return poses[1:]
