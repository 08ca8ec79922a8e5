"""What the controller has learned, as one value: eyes, situations and their transitions.

No port, camera, file or clock: a picture goes in and a situation comes out.
"""

from dataclasses import dataclass, field

from macor_hil.clustering.fuzzy_art import FuzzyArt, Resonance
from macor_hil.clustering.membership import WIDTH, Array, memberships
from macor_hil.drive import COMMANDS, STRAIGHT
from macor_hil.graded_map import GradedMap
from macor_hil.memory import Memory
from macor_hil.reinforcement import Reinforcement
from macor_hil.sensorimotor_map import Competence, SensorimotorMap
from macor_hil.vision.receptive_fields import Features, ReceptiveFields
from macor_hil.vision.unwrap import Image, PanoramaSize, Unwrapper
from protocol.mirror import Mirror

FIRST_COMMAND = COMMANDS.index(STRAIGHT)
"""Command that a situation counts as entered by when the robot was put there."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Everything that decides what is learned, with the paper's values where it gives them.

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

    nodes: int = 50
    vigilance: float = 0.9
    alpha: float = 0.001
    sectors: int = 12
    reinforcement: Reinforcement = field(default_factory=Reinforcement)
    competence: Competence = field(default_factory=Competence)
    width: float = WIDTH
    mirror: Mirror = field(default_factory=Mirror)
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
        """How much untuned features belong to each situation, shape (n,)."""
        distances = self.art.distances(self.fields.tune(raw))
        return memberships(distances, self.settings.nodes, self.settings.width)
