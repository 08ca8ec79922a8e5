"""Q-learning, the implicitly planning system that the paper compares with (section 2.3).

An evaluation weight stores not only what the next transition earns but also, discounted, what can
be earned after it. In the paper's indices: j the preceding neuron, i the present one, k and l
the ones after it,

    w^r_ij <- w^r_ij + 1 / z_ij * ( r + gamma * w^r_ki - w^r_ij )        (3)
    w^r_ki  = max over l of w^r_li                                      (4)

With gamma = 0 this is equation 2 ("weak Q-learning"). The maximum is taken over transitions that
have occurred; after a collision, or where nothing has followed yet, there is none, and 0 stands
for it. Competence weights are not used.
"""

from typing import Annotated

from pydantic import Field

from macor_hil.arrays import State
from macor_hil.mind.experience import Experience
from macor_hil.mind.memories.transitions import SensorimotorMap


class QMap(SensorimotorMap):
    """A sensorimotor map whose evaluations follow equations 3 and 4.

    Args:
        nodes: n, situations.
        commands: m, commands of each situation.
        gamma: discount, 0.9 in the paper.
    """

    most = 1e9  # with a discount near 1 evaluations are sums of many rewards

    def __init__(
        self,
        nodes: int,
        commands: int,
        gamma: Annotated[float, Field(ge=0.0, le=1.0)] = 0.9,
    ) -> None:
        super().__init__(nodes, commands)
        self.gamma = gamma
        self._followers: dict[int, set[int]] = {}

    def learn(self, experience: Experience) -> None:
        """Adapt the transition of an experience; nothing follows a collision."""
        adapt = self.adapt_last if experience.collided else self.adapt
        adapt(experience.before.neuron, experience.after.neuron, experience.reinforcement)

    def adapt(self, j: int, i: int, r: float) -> None:
        """Adapt the transition j -> i that earned r; what can follow i is known."""
        self._adapt(j, i, r + self.gamma * self._best_after(i))

    def adapt_last(self, j: int, i: int, r: float) -> None:
        """Adapt the transition j -> i that earned r and ended in a collision: nothing follows."""
        self._adapt(j, i, r)

    def _adapt(self, j: int, i: int, target: float) -> None:
        # equation 2 with another target
        super().adapt(j, i, target)
        self._followers.setdefault(j, set()).add(i)

    def _best_after(self, i: int) -> float:
        """Return the best evaluation of a transition that has followed i (equation 4)."""
        return max((self.evaluation(i, k) for k in self._followers.get(i, ())), default=0.0)

    def load(self, state: State) -> None:
        """Take over stored transitions.

        Raises:
            ValueError, KeyError: something is missing or does not fit.
        """
        super().load(state)
        self._followers = {}
        known = self.transitions()
        for j, i in zip(known.past.tolist(), known.present.tolist(), strict=True):
            self._followers.setdefault(j, set()).add(i)
