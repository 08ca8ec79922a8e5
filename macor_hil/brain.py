"""What the controller has learned, as one value: eyes, situations and their transitions.

No port, camera, file or clock: a picture goes in and a situation comes out.
"""

from dataclasses import dataclass, field
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from macor_hil.clustering.fuzzy_art import FuzzyArt, Resonance
from macor_hil.clustering.membership import WIDTH, Array, Prototypes, placed
from macor_hil.drive import COMMANDS, MIRRORED, STRAIGHT
from macor_hil.graded_map import GradedMap
from macor_hil.memory import Memory
from macor_hil.reinforcement import Reinforcement
from macor_hil.sensorimotor_map import Competence, SensorimotorMap
from macor_hil.vision.receptive_fields import Features, ReceptiveFields
from macor_hil.vision.unwrap import Image, PanoramaSize, Unwrapper
from protocol.mirror import Mirror, StoredMirror

FIRST_COMMAND = COMMANDS.index(STRAIGHT)
"""Command that a situation counts as entered by when the robot was put there."""

MOST_NODES: Final = 1000
"""Situations of the largest map."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that decides what is learned, with the paper's values where it gives them.

    The bounds are those of files.

    Attributes:
        nodes: n, the most situations.
        vigilance: rho of Fuzzy ART.
        alpha: its choice parameter.
        sectors: receptive fields around the robot.
        reinforcement: what commands earn.
        competence: parameters of equation 1.
        width: of the memberships of graded situations.
        mirror: geometry of the camera's mirror.
        panorama: size of the unwrapped picture.
    """

    nodes: Annotated[int, Field(ge=1, le=MOST_NODES)] = 50
    vigilance: Annotated[float, Field(ge=0.0, le=1.0)] = 0.9
    alpha: Annotated[float, Field(ge=1e-9, le=1e3)] = 0.001
    sectors: Annotated[int, Field(ge=1, le=120)] = 12
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    competence: Competence = field(default_factory=Competence)
    width: Annotated[float, Field(ge=1e-3, le=1e3)] = WIDTH
    mirror: StoredMirror = field(default_factory=Mirror)
    panorama: PanoramaSize = field(default_factory=PanoramaSize)


class Brain:
    """Vision, clusterer and sensorimotor map of one controller."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.unwrap = Unwrapper(settings.mirror, settings.panorama)
        self.fields = ReceptiveFields(settings.sectors)
        self.art = FuzzyArt(self.fields.size, settings.nodes, settings.vigilance, settings.alpha)
        self.map = SensorimotorMap(settings.nodes, len(COMMANDS), settings.competence)
        self.graded = GradedMap(settings.nodes, len(COMMANDS))
        self.prototypes = Prototypes(np.zeros((settings.nodes, self.fields.size)), settings.width)

    @property
    def memory(self) -> Memory:
        """What planners look into."""
        return Memory(self.map, self.graded)

    def look_into(self, mirror: Mirror) -> None:
        """See through another mirror than the one that the map was learned with."""
        self.unwrap = Unwrapper(mirror, self.settings.panorama)

    def look(self, image: Image) -> Features:
        """Untuned features of a mirror image, shape (M,)."""
        return self.fields.raw(self.unwrap(image))

    def recognise(self, raw: Features, *, learn: bool) -> Resonance:
        """The situation of untuned features."""
        return self.art.present(self.fields.tune(raw), learn=learn)

    def memberships(self, raw: Features) -> Array:
        """How much untuned features belong to each prototype, shape (n,)."""
        return self.prototypes.memberships(self.fields.tune(raw))

    def tune(self, seen: Features, rng: np.random.Generator) -> None:
        """Fit the eyes to a first drive: the fields' ranges, and where the prototypes lie.

        Args:
            seen: untuned features, shape (frames, M).
            rng: see `membership.placed`.
        """
        self.fields = self.fields.tuned_to(seen)
        x = self.fields.tune(seen)
        both = np.concatenate([x, self.fields.mirrored(x)])
        self.prototypes = placed(both, self.settings.nodes, rng, self.settings.width)

    def experience(
        self, before: Features, command: int, after: Features, *, collided: bool
    ) -> None:
        """Count what a command led to among graded situations, and the mirror image of that.

        A robot that is the same on both sides would have experienced that, too.

        Args:
            before: untuned features before the command, shape (M,).
            command: its index.
            after: untuned features after it, shape (M,).
            collided: whether it ended in a collision.
        """
        seen, then = self.fields.tune(before), self.fields.tune(after)
        self._count(seen, command, then, collided)
        mirrored = self.fields.mirrored
        self._count(mirrored(seen), MIRRORED[command], mirrored(then), collided)

    def _count(self, before: Features, command: int, after: Features, collided: bool) -> None:
        then = None if collided else self.prototypes.memberships(after)
        r = self.settings.reinforcement(COMMANDS[command], collided)
        self.graded.learn(self.prototypes.memberships(before), command, then, r)
