"""Arenas made from a seed, in each of which a way is known to be possible.

A layout is drawn. It is kept if a robot that only drives straight on collides, and if 40 commands
are possible without a collision, with twice the usual margin, from its start and from starts all
round it. Otherwise another one is drawn.
"""

from itertools import product
from math import cos, radians, sin
from typing import Final, NamedTuple, TypeVar

import numpy as np
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import Arena, Colour, Point
from khepera_emulator.arenas.arena_text import Notes, arena_text
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KHEPERA
from khepera_emulator.routes.layout import Difficulty, Kind, Layout, draw_layout
from khepera_emulator.routes.oracle import MARGIN, PAPER_COMMANDS, Oracle
from khepera_emulator.routes.passages import Place, faces, walls
from khepera_emulator.routes.variants import with_own_colours
from khepera_emulator.world.free_space import pose_of
from khepera_emulator.world.outline import outline

COMMANDS: Final = 40
"""Commands that are possible from the start of every arena that is made here."""

AROUND: Final = (0.01, 0.01, radians(5))
"""Metres ahead and aside, and radians, by which starts may differ from the start."""

_SURE: Final = 2 * MARGIN
_WIDTHS: Final = (64, 512)
_STRAIGHT_ON: Final = range(5, 27)
"""Commands that are possible straight on."""

_TRIES: Final = 10_000
_THICKNESS: Final = 10
_CLOSED_END: Final = 100
"""Millimetres that random starts keep from where the way begins and ends."""

_BODY: Final = 35
"""Millimetres that they keep from the side walls of the narrowest stretch: a body and a little."""

_FLOOR: Final[Colour] = (0.35, 0.35, 0.35)
_SKY: Final[Colour] = (1.0, 1.0, 1.0)
_WALL_COLOURS: Final[tuple[Colour, ...]] = (
    (0.85, 0.75, 0.25),
    (0.9, 0.9, 0.85),
    (0.45, 0.65, 0.85),
    (0.6, 0.75, 0.45),
    (0.85, 0.6, 0.5),
)
_POST_COLOURS: Final[tuple[Colour, ...]] = (
    (0.85, 0.25, 0.2),
    (0.2, 0.65, 0.3),
    (0.25, 0.35, 0.85),
    (0.95, 0.55, 0.1),
)

_T = TypeVar("_T")


class Generated(NamedTuple):
    """An arena and the text of its file."""

    arena: Arena
    text: str


def generate(
    seed: int,
    kind: Kind | None = None,
    difficulty: Difficulty | None = None,
    *,
    own_colours: bool = False,
) -> Generated:
    """Make an arena from a seed; the same seed gives the same text.

    Args:
        seed: of all that is left to chance.
        kind: what the robot comes to first; None: the seed's turn decides.
        difficulty: how narrow it is, and how much there is in it; None: the same.
        own_colours: whether every straight wall has a colour of its own.

    Raises:
        EmulatorError: no layout with a way was drawn.
    """
    rng = np.random.default_rng(seed)
    # fifteen seeds in a row have each kind in each difficulty once
    kind = kind or list(Kind)[seed % len(Kind)]
    difficulty = difficulty or list(Difficulty)[seed // len(Kind) % len(Difficulty)]
    command = f"--generate {seed} --kind {kind} --difficulty {difficulty}"
    for _ in range(_TRIES):
        layout = draw_layout(rng, kind, difficulty)
        if layout is None:
            continue
        title = f"Generated from seed {seed}: {kind}, {difficulty}"
        arena, notes = _arena(layout, rng, title)
        straight_on = _way_straight_on(arena)
        if straight_on is None or not _has_a_way(arena):
            continue
        if own_colours:
            arena, notes, command = with_own_colours(arena), {}, f"{command} --own-colours"
        return Generated(arena, arena_text(arena, _head(command, layout, straight_on), notes))
    raise EmulatorError(f"no arena found for: {command}; try another seed")


def _choice(rng: np.random.Generator, values: tuple[_T, ...]) -> _T:
    return values[int(rng.integers(len(values)))]


def _arena(layout: Layout, rng: np.random.Generator, title: str) -> tuple[Arena, Notes]:
    """Return what stands round a layout, with comments."""
    colour, post_colour = _choice(rng, _WALL_COLOURS), _choice(rng, _POST_COLOURS)
    lines = [walls(line, _THICKNESS) for line in faces(layout.floors)]
    notes = {("wall", 0): "all round"}
    for bend, cut in layout.cuts.items():
        notes["wall", len(lines)] = f"across the outer corner between stretch {bend} and {bend + 1}"
        lines.append(list(cut))
    for number, (stretch, _) in enumerate(layout.posts):
        notes["cylinder", number] = f"in stretch {stretch + 1}"
    x, y = _metres(layout.way[0].at(layout.start))
    arena = {
        "version": 1,
        "title": title,
        "floor": _FLOOR,
        "sky": _SKY,
        "start": {"x": x, "y": y, "heading": 90.0 * layout.way[0].towards},
        "free": _free(layout),
        "wall": [{"points": list(map(_metres, line)), "colour": colour} for line in lines],
        "cylinder": [
            {"centre": _metres(post[:2]), "radius": post.radius / 1000, "colour": post_colour}
            for _, post in layout.posts
        ],
    }
    return Arena.model_validate(arena), notes


def _free(layout: Layout) -> dict[str, object]:
    first, last = layout.way[0], layout.way[-1]
    middle = [first.at(_CLOSED_END), *(each.at(each.length) for each in layout.way[:-1])]
    middle.append(last.at(last.length - _CLOSED_END))
    narrowest = min(each.width for each in layout.way)
    return {
        "points": [_metres(place) for place in middle],
        "half_width": (narrowest // 2 - _BODY) / 1000,
        "heading_spread": 45.0,
    }


def _metres(place: Place) -> Point:
    return place[0] / 1000, place[1] / 1000


def _way_straight_on(arena: Arena) -> int | None:
    """Return how many commands are possible straight on; None: too few or too many."""
    straight = Oracle(outline(arena, KHEPERA), PAPER_COMMANDS[-1:])
    length = straight.longest_drive(pose_of(arena.start), COMMANDS).length
    return length if length in _STRAIGHT_ON else None


def _has_a_way(arena: Arena) -> bool:
    oracle = Oracle(outline(arena, KHEPERA), margin=_SURE)
    start = pose_of(arena.start)
    corners = product((-1, 1), repeat=len(AROUND))
    starts = (_beside(start, shares) for shares in ((0, 0, 0), *corners))
    return all(oracle.longest_drive(each, COMMANDS, _WIDTHS).length == COMMANDS for each in starts)


def _beside(start: Pose, shares: tuple[int, ...]) -> Pose:
    ahead, aside, turn = (share * most for share, most in zip(shares, AROUND, strict=True))
    c, s = cos(start.heading), sin(start.heading)
    return Pose(
        x=start.x + c * ahead - s * aside,
        y=start.y + s * ahead + c * aside,
        heading=start.heading + turn,
    )


def _head(command: str, layout: Layout, straight_on: int) -> list[str]:
    return [
        f"khepera-emulator arenas {command}",
        "",
        *(f"{number}. {words}" for number, words in enumerate(layout.told, 1)),
        "",
        "stretch   long   wide",
        *(
            f"{number:>7} {each.length / 10:>4.0f} cm {each.width / 10:>3.0f} cm"
            for number, each in enumerate(layout.way, 1)
        ),
        "",
        f"Straight on a robot collides after {straight_on} commands of 2.1 cm. From the start, and",
        f"from starts up to 1 cm and 5 degrees beside it, {COMMANDS} are possible.",
    ]
