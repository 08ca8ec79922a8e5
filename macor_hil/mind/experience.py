"""Moments, and experiences: what a command led to from one moment to the next."""

from dataclasses import dataclass

from macor_hil.arrays import Array


@dataclass(frozen=True, slots=True)
class Resonance:
    """Situation that a clusterer takes an input for.

    Attributes:
        node: the situation k.
        resonant: whether the node's match reached the vigilance; if not, it is the nearest one.
        match: |I ^ w_k| / M of that node, before learning.
    """

    node: int
    resonant: bool
    match: float


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """A view of the robot at one moment.

    Attributes:
        raw: untuned features, shape (M,).
        features: features x, each in [0, 1], shape (M,).
        resonance: the situation that they were taken for.
        neuron: that situation, entered by the last command (i = k * m + a).
        floor: inverse distance of the floor's end in each direction, shape (directions,), see
            `FloorSeeing`; None: the eyes do not tell.
        sights: what stands around the robot, shape (24, 5), see `eyes.sights`; None: as above.
    """

    raw: Array
    features: Array
    resonance: Resonance
    neuron: int
    floor: Array | None = None
    sights: Array | None = None

    @property
    def node(self) -> int:
        """The situation k."""
        return self.resonance.node


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Untuned features as they came, and what led to them: all that a drive leaves to learn from.

    Attributes:
        raw: untuned features, shape (R,).
        command: index of the command that was driven, or None where a drive begins.
        collided: whether it ended in a collision.
        reinforcement: what it earned, where that is known; None: what commands earn now.
    """

    raw: Array
    command: int | None = None
    collided: bool = False
    reinforcement: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Experience:
    """A command and what it led to.

    Attributes:
        before: when the command was chosen.
        command: its index a.
        after: when it had been driven.
        reinforcement: what it earned.
        collided: whether it ended in a collision, which nothing follows.
    """

    before: Moment
    command: int
    after: Moment
    reinforcement: float
    collided: bool
