"""The paper's corridor in other measures: how wide it is, and how far its end is from the start."""

from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Final

from macor_hil.experiments.drives.arena_files import arena_file

_THICK: Final = 0.01
_END: Final = 1.0
"""Place of the middle of the part after the curve, along the part before it, in metres."""

_TEXT: Final = Template("""\
# The corridor's curve, $width m wide; the robot starts $distance m before the end wall.
version = 1
title = "Corridor with a curve to the left, $width m wide, end wall at $distance m"
floor = [0.35, 0.35, 0.35]
sky = [1.0, 1.0, 1.0]

[start]
x = $start
y = 0.0
heading = 0.0

[free]
points = [[0.10, 0.0], [$end, 0.0], [$end, 0.90]]
half_width = $free
heading_spread = 45.0
gap = 0.02

[[wall]]
points = [[-0.13, -$side], [$outer, -$side], [$outer, 1.13]]
colour = [0.85, 0.75, 0.25]

[[wall]]
points = [[-0.13, $side], [$inner, $side], [$inner, 1.13]]
colour = [0.85, 0.75, 0.25]

[[wall]]
points = [[-0.13, -$side], [-0.13, $side]]
colour = [0.85, 0.75, 0.25]

[[wall]]
points = [[$inner, 1.13], [$outer, 1.13]]
colour = [0.85, 0.75, 0.25]
""")


@dataclass(frozen=True, slots=True)
class Corridor:
    """A corridor with a curve to the left.

    Attributes:
        width: between the faces of its walls, in metres.
        distance: from the robot's start to the face of the end wall, in metres.
    """

    width: float = 0.25
    distance: float = 0.195

    def file(self, folder: Path) -> str:
        """Return the arena for a port: the path of a file that is written now.

        Raises:
            MacorError: the folder cannot be written to.
        """
        return arena_file(folder, f"corridor-{self.width:g}-{self.distance:g}", self.text)

    def text(self) -> str:
        """Return the arena as TOML."""
        side = self.width / 2 + _THICK / 2
        return _TEXT.substitute(
            width=f"{self.width:g}",
            distance=f"{self.distance:g}",
            start=round(_END + self.width / 2 - self.distance, 4),
            end=_END,
            free=round(self.width / 2 - 0.035, 4),
            side=round(side, 4),
            outer=round(_END + side, 4),
            inner=round(_END - side, 4),
        )
