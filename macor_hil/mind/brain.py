"""The controller's mind, composed of eyes, a clusterer and memories.

No port, camera, file or clock: a picture goes in and a moment comes out; experiences go in.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from macor_hil.arrays import Array, Image
from macor_hil.commands import COMMANDS, FIRST_COMMAND
from macor_hil.mind.clusterers.clusterer import Clusterer
from macor_hil.mind.experience import Experience, Moment, Seen
from macor_hil.mind.eyes.eyes import Eyes, FloorSeeing
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MindSettings


@dataclass(eq=False)
class Brain:
    """Eyes, situations and memories of one controller.

    Attributes:
        eyes: turn pictures into features.
        clusterer: turns features into situations.
        memories: learn from experience, each under the name that planners ask for.
        reinforcement: what commands earn.
        settings: what it was built from; None where it was put together by hand, and such a brain
            cannot be saved.
    """

    eyes: Eyes
    clusterer: Clusterer
    memories: Mapping[str, Memory]
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    settings: MindSettings | None = None
    _known: tuple[Eyes, FloorSeeing | None] | None = field(default=None, init=False, repr=False)

    @property
    def transitions(self) -> int:
        """Number of transitions between neurons that occurred; 0 without a memory of them."""
        known = self.memories.get("transitions")
        return len(known) if isinstance(known, SensorimotorMap) else 0

    def look(self, image: Image) -> Array:
        """Return the untuned features of a picture, shape (M,)."""
        return self.eyes.look(image)

    def perceive(self, raw: Array, command: int, *, learn: bool) -> Moment:
        """Recognise the situation of untuned features.

        Args:
            raw: shape (M,).
            command: index of the command that led here.
            learn: whether the clusterer learns.
        """
        x = self.eyes.tuned(raw)
        resonance = self.clusterer.present(x, learn=learn)
        neuron = resonance.node * len(COMMANDS) + command
        eyes = self._floor_seeing()
        if eyes is None:
            return Moment(raw, x, resonance, neuron)
        return Moment(raw, x, resonance, neuron, eyes.floor(raw), eyes.sights(raw))

    def earned(self, command: int, *, collided: bool) -> float:
        """Return what a driven command earns."""
        return self.reinforcement(COMMANDS[command], collided)

    def learn(self, experience: Experience) -> None:
        """Let every memory learn from an experience."""
        for memory in self.memories.values():
            memory.learn(experience)

    def relive(self, drive: Iterable[Seen], *, situations: bool = True) -> None:
        """Learn from a drive that was seen before, as if it happened now.

        Args:
            drive: what was seen, in its order.
            situations: whether the clusterer learns, too.
        """
        before: Moment | None = None
        for seen in drive:
            command = FIRST_COMMAND if seen.command is None else seen.command
            after = self.perceive(seen.raw, command, learn=situations)
            if before is not None and seen.command is not None:
                r = seen.reinforcement
                if r is None:
                    r = self.earned(command, collided=seen.collided)
                self.learn(Experience(before, command, after, r, seen.collided))
            before = after

    def _floor_seeing(self) -> FloorSeeing | None:
        """Return the eyes if they see the floor, which takes long to find out."""
        if self._known is None or self._known[0] is not self.eyes:
            self._known = self.eyes, self.eyes if isinstance(self.eyes, FloorSeeing) else None
        return self._known[1]

    def tune(self, seen: Array, rng: np.random.Generator) -> None:
        """Fit eyes and memories to a first drive.

        Args:
            seen: untuned features, shape (frames, M).
            rng: source of what is drawn by that.
        """
        self.eyes.tune(seen)
        x = self.eyes.tuned(seen)
        for memory in self.memories.values():
            memory.tune(x, rng)
