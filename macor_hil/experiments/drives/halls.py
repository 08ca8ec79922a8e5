"""Long arenas, as files, in which reacting to what is near can be early enough.

At a turning radius of 10 cm a robot that drives straight towards a wall must turn 13 cm ahead of
it, one that meets a side wall at 30 degrees 4 cm ahead, and one that drives at the middle of a
post 5 cm ahead. Both arenas are longer than a trial's 40 commands, so that a robot that turns away
from the sides and passes the posts never meets the wall at the end.
"""

from dataclasses import dataclass
from pathlib import Path

from macor_hil.experiments.drives.arena_files import arena_file


@dataclass(frozen=True, slots=True)
class Hall:
    """A rectangle of 2 m length, yellow as the corridor, with red posts.

    Attributes:
        name: in tables and of the file.
        width: between the side walls, in metres.
        aside: distance of random starts from the middle line, at most, in metres.
        spread: of their headings to either side, in degrees.
        posts: middles of the posts, in metres from the middle of the wall behind the start.
    """

    name: str
    width: float
    aside: float
    spread: float
    posts: tuple[tuple[float, float], ...] = ()

    def file(self, folder: Path) -> str:
        """Return the path of the arena, which is written now if it is not there.

        Raises:
            MacorError: the folder cannot be written to.
        """
        return arena_file(folder, self.name.replace(" ", "-"), self.text)

    def text(self) -> str:
        """Return the arena as the text of a TOML file."""
        side = round(self.width / 2 + 0.005, 3)  # half of a wall's thickness beside its face
        return f"""version = 1
title = "Hall of 2 m by {self.width:g} m, {len(self.posts)} posts"
floor = [0.35, 0.35, 0.35]
sky = [1.0, 1.0, 1.0]

[start]
x = 0.20
y = 0.0
heading = 0.0

[free]
points = [[0.20, 0.0], [1.0, 0.0]]
half_width = {self.aside}
heading_spread = {self.spread}
gap = 0.03

[[wall]]
points = [[-0.005, -{side}], [2.005, -{side}], [2.005, {side}], [-0.005, {side}], [-0.005, -{side}]]
colour = [0.85, 0.75, 0.25]
""" + "".join(
            f"""
[[cylinder]]
centre = [{x}, {y}]
radius = 0.02
colour = [0.85, 0.25, 0.2]
"""
            for x, y in self.posts
        )


LONG_CORRIDOR = Hall("long corridor", 0.30, 0.06, 45.0)
"""Side walls only, which every robot meets that does not turn."""

WIDE_HALL = Hall("wide hall", 0.80, 0.30, 60.0, ((0.60, 0.12), (1.00, -0.12), (1.40, 0.12)))
"""Three posts, which few frames show nearby, and much room around them."""
