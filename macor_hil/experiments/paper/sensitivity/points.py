"""Settings of the map: what is varied, around the settings of table 1.

The paper prints vigilance, nodes and gamma; the greatest competence, mu, the reinforcement and the
corridor's measures it does not.
"""

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, NamedTuple

from macor_hil.experiments.drives.corridors import Corridor
from macor_hil.experiments.drives.course import Course
from macor_hil.experiments.drives.systems import Learning
from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.mind.memories.transitions import Competence
from macor_hil.mind.reinforcement import Reinforcement


@dataclass(frozen=True, slots=True)
class Point:
    """A point of the map, with the values of table 1 where nothing else is given.

    Attributes:
        vigilance, nodes: of Fuzzy ART.
        w_max, mu: of equation 1: the greatest competence, and the adaptations to half of it.
        gamma: discount of Q-learning.
        turn: reinforcement of a turn; straight on earns 0.62.
        collision: reinforcement of a collision.
        commands: of the training.
        width: of the corridor that is driven, in metres.
        distance: from its start to the end wall, in metres.
    """

    vigilance: float = 0.9
    nodes: int = 50
    w_max: float = 0.95
    mu: float = 2.8
    gamma: float = 0.9
    turn: float = 0.54
    collision: float = 0.0
    commands: int = 13_000
    width: float = 0.25
    distance: float = 0.195

    def learning(self) -> Learning:
        """Return the settings of learning."""
        return Learning(
            nodes=self.nodes,
            vigilance=self.vigilance,
            gamma=self.gamma,
            competence=self.competence(),
            reinforcement=Reinforcement(turn=self.turn, collision=self.collision),
        )

    def competence(self) -> Competence:
        """Return the parameters of equation 1."""
        return Competence(mu=self.mu, w_max=self.w_max)

    def corridor(self) -> Corridor:
        """Return the corridor that is driven."""
        return Corridor(self.width, self.distance)


class Axis(NamedTuple):
    """Values of one field of points."""

    name: str
    values: tuple[float, ...]

    def at(self, base: Point, value: float) -> Point:
        """Return a point with another value of this field."""
        change: dict[str, Any] = {self.name: value}
        return replace(base, **change)


class Grid(NamedTuple):
    """Two axes, whose values are combined with each other."""

    rows: Axis
    columns: Axis

    def at(self, base: Point) -> dict[tuple[float, float], Point]:
        """Return the points by their values on both axes, row by row."""
        return {
            (row, column): self.columns.at(self.rows.at(base, row), column)
            for row, column in product(self.rows.values, self.columns.values)
        }


@dataclass(frozen=True)
class Settings:
    """The map's points, and their trials."""

    drive: Drive = field(default_factory=Drive)
    """The training drive, of all points; some learn only its beginning."""
    base: Point = Point()
    """Table 1."""
    grids: tuple[Grid, ...] = (
        Grid(Axis("vigilance", (0.7, 0.8, 0.9, 0.95)), Axis("nodes", (20, 30, 50, 100))),
        Grid(Axis("width", (0.18, 0.25, 0.32)), Axis("distance", (0.195, 0.3, 0.4))),
    )
    """Fields that are varied by twos."""
    lines: tuple[Axis, ...] = (
        Axis("commands", (1_000, 3_000, 6_000, 13_000)),
        Axis("w_max", (0.8, 0.9, 0.95, 0.99)),
        Axis("mu", (1.0, 2.8, 5.0, 10.0)),
        Axis("gamma", (0.5, 0.9, 0.99)),
        Axis("turn", (0.46, 0.54, 0.62)),
        Axis("collision", (-2.0, -1.0, 0.0)),
    )
    """Fields that are varied alone."""
    course: Course = field(default_factory=lambda: Course(trials=3))
    """Trials of each system at each point; the arena is the point's corridor."""

    @property
    def arenas(self) -> tuple[str, ...]:
        """None comes as a file: corridors follow from code."""
        return ()

    def points(self) -> list[Point]:
        """Return all points, each once."""
        on_grids = (point for grid in self.grids for point in grid.at(self.base).values())
        on_lines = (line.at(self.base, value) for line in self.lines for value in line.values)
        return list(dict.fromkeys((self.base, *on_grids, *on_lines)))


QUICK: Final = Settings(
    drive=Drive(tuning=100, random=1_500),
    base=Point(commands=1_500),
    grids=(
        Grid(Axis("vigilance", (0.8, 0.9)), Axis("nodes", (20, 50))),
        Grid(Axis("width", (0.25, 0.32)), Axis("distance", (0.195, 0.3))),
    ),
    lines=(Axis("commands", (500, 1_500)), Axis("collision", (-1.0, 0.0))),
    course=Course(trials=2),
)
