"""Beyond the paper: hypothetical drives over the free floor, weighed by their chance to succeed.

No situations: from where the floor ends in every direction follows the clearance of every place
that hypothetical drives (`foresight.drives`) lead to, and from that the chance to get there without
a collision. With p the chance of a stride, r what its n commands earn and r_c a collision,

    V(pose) = max over a of p (n r(a) + V(pose after a)) + (1 - p) r_c,

back from the last stride to the first: the reinforcement that each next command can be expected to
earn within 42 commands. Motions, chances and reinforcement are learned (`memories.foresight`). It
is planning with a local map that is thrown away at every step, as in the dynamic window approach
(Fox, Burgard and Thrun 1997), with a longer look ahead and measured chances for its margins.
"""

from dataclasses import dataclass
from typing import Annotated, Final, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from macor_hil.arrays import Array, Indices
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Moment
from macor_hil.mind.foresight.drives import MOST_AHEAD, Stride, hypothetical_drives
from macor_hil.mind.foresight.floor import clearance, solids
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.foresight.view import CLEARANCES, UNSEEN, bins_of, cells_of, raster
from macor_hil.mind.planners.planner import NO_PLAN, Plan, best_command

_EXACT: Final = 4
"""First strides, whose clearances are reckoned exactly; those of others come from the raster."""

_CLOSE: Final = 4.0
"""Heights: what is farther away is out of the reach of the first strides."""

_Values = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class _Foreseen:
    """A stride, and what of it does not depend on what is seen.

    Attributes:
        stride: where its commands lead.
        cells: of the raster, shape (commands, m * n).
        survival: chance of one command to get through, by its bin.
        earns: what the commands of it earn, shape (m, 1).
    """

    stride: Stride
    cells: Indices
    survival: _Values
    earns: _Values


class Skilled(Protocol):
    """A memory that knows the robot's skill."""

    @property
    def skill(self) -> Skill | None:
        """The skill; None: it has not been learned."""
        ...


class Foresight:
    """Expected reinforcement of the next 42 commands.

    Args:
        ahead: how many commands it looks ahead at most, in strides that grow (`foresight.drives`).
        hazard: chance that a command into what is hidden ends in a collision.
        memory: name of the memory that it reads.
    """

    def __init__(
        self,
        ahead: Annotated[int, Field(ge=1, le=MOST_AHEAD)] = MOST_AHEAD,
        hazard: Annotated[float, Field(ge=0.0, le=1.0)] = 0.03,
        memory: str = "foresight",
    ) -> None:
        self.memory = memory
        self._ahead = ahead
        self._hazard = hazard
        self._skill: Skill | None = None
        self._drives: list[_Foreseen] = []
        self._first = np.zeros((0, 2))

    def plan(self, memory: Skilled, now: Moment) -> Plan:
        """Evaluate the commands; none where nothing was learned, or no floor is seen."""
        if memory.skill is None or now.floor is None:
            return NO_PLAN
        if memory.skill is not self._skill:
            self._prepare(memory.skill)
        evaluations = tuple(self._evaluations(memory.skill, now.floor).tolist())
        return Plan(evaluations, best_command(evaluations), steps=len(self._drives))

    def _prepare(self, skill: Skill) -> None:
        """Compute what does not depend on what is seen."""
        self._drives = [
            self._foreseen(stride, skill)
            for stride in hypothetical_drives(skill.motions, self._ahead)
        ]
        self._first = np.concatenate([each.stride.ways[0] for each in self._drives[:_EXACT]])
        self._skill = skill

    def _foreseen(self, stride: Stride, skill: Skill) -> _Foreseen:
        seen = skill.curve.survival(CLEARANCES, stride.before)
        survival = np.concatenate([seen, seen * (1.0 - self._hazard)]).astype(np.float32)
        earns = (stride.commands * skill.earns[:, None]).astype(np.float32)
        return _Foreseen(stride, cells_of(stride.ways), survival, earns)

    def _evaluations(self, skill: Skill, floor: Array) -> _Values:
        chances = self._chances(floor)
        value = np.zeros(self._drives[-1].stride.poses, np.float32)
        worth = np.zeros((len(COMMANDS), 1), np.float32)
        for each, chance in zip(reversed(self._drives), reversed(chances), strict=True):
            through = chance.reshape(len(COMMANDS), -1)
            lost = (1.0 - through) * np.float32(skill.collision)
            worth = through * (each.earns + value[each.stride.ends]) + lost
            value = worth.max(axis=0)
        return worth[:, 0]

    def _chances(self, floor: Array) -> list[_Values]:
        """Return the chance of each way of each stride to get through."""
        bins = raster(floor)
        begin, end = solids(floor)
        close = np.minimum(np.hypot(*begin.T), np.hypot(*end.T)) < _CLOSE
        exact = bins_of(clearance((begin[close], end[close]), self._first))
        chances, first = [], 0
        for number, each in enumerate(self._drives):
            seen = bins[each.cells]
            if number < _EXACT:
                seen = np.bitwise_or(seen & UNSEEN, exact[first : first + seen.size])
                first += seen.size
            chances.append(each.survival[seen].prod(axis=0))
        return chances
