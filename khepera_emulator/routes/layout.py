"""Ways drawn at random: stretches of corridor with bends, dead ends, rooms and posts.

A way is planned as legs, each as wide as chance has it, and then laid on the floor, where it must
not run into itself. All lengths are whole millimetres.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from math import hypot
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from khepera_emulator.routes.passages import Passage, Place

APART: Final = 20
"""Least wall between two floors: one wall for each side."""

_Span = tuple[int, int]
"""Least and greatest value of what is drawn."""

_FIRST: Final = (400, 650)
_MIDDLE: Final = (350, 550)
_LAST: Final = (500, 800)
_BETWEEN: Final = (20, 120)
"""Wall between two bends that follow each other closely."""

_LONGEST: Final = 2600
"""Of a way: a trial of 40 commands is 840 mm long."""

_DEAD_END: Final = (180, 450)
_CUT: Final = (40, 110)
"""Length that a wall across the outer corner of a bend takes away of both sides."""

_ROOM: Final = (560, 800)
_ROOM_POSTS: Final = (2, 4)
_ROOM_POST: Final = (14, 30)
_SIDE_POST: Final = (12, 20)
_TO_THE_WALL: Final = (5, 20)
_BY_A_POST: Final = 190
"""Least width that a post beside a wall leaves."""

_BETWEEN_POSTS: Final = 130
"""Least width that posts in a room leave, among them and to walls."""

_START: Final = (150, 450)
"""Distance of the start from where the first stretch's middle line ends."""

_BEHIND: Final = 100
"""Least distance of the start from the wall behind it."""

_TRIES: Final = 60
_AGAIN, _CUT_OFF, _POST, _LIKELY_POST = 0.4, 0.3, 0.15, 0.6
"""Chances: that another thing is of the same kind; that a bend's corner is cut off; that a post
stands in a stretch, and in one of an arena of posts or hairpins."""

_STEPS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))
_SIDES: Final = {1: "left", -1: "right"}


class Kind(StrEnum):
    """The first thing that the robot comes to; what follows is bends, and more of the same."""

    BENDS = "bends"
    S_CURVE = "s-curve"
    HAIRPIN = "hairpin"
    JUNCTIONS = "junctions"
    POSTS = "posts"


class Difficulty(StrEnum):
    """Width of corridors, and number of things on the way."""

    EASY = "easy"
    MEDIUM = "medium"
    HARD = "hard"


class _Measures(NamedTuple):
    """Least and greatest width in centimetres, and number of things on the way."""

    width: tuple[int, int]
    things: tuple[int, int]


_MEASURES: Final = MappingProxyType(
    {
        Difficulty.EASY: _Measures((26, 32), (1, 2)),
        Difficulty.MEDIUM: _Measures((21, 28), (2, 3)),
        Difficulty.HARD: _Measures((18, 23), (3, 4)),
    }
)


class Stretch(NamedTuple):
    """A straight part of the way: where its middle line begins, whereto, how long and wide."""

    x: int
    y: int
    towards: int
    length: int
    width: int

    def at(self, along: int, aside: int = 0) -> Place:
        """Return the place so far along its middle line and so far to the left of it."""
        ux, uy = _STEPS[self.towards]
        return self.x + along * ux - aside * uy, self.y + along * uy + aside * ux

    def floor(self, before: int, after: int) -> Passage:
        """Return its floor, with more of it at both ends."""
        x0, y0 = self.at(-before, -self.width // 2)
        x1, y1 = self.at(self.length + after, self.width // 2)
        return Passage(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))


class Post(NamedTuple):
    """A round post: where it stands, and its radius."""

    x: int
    y: int
    radius: int


@dataclass(frozen=True, slots=True)
class Layout:
    """A way with everything beside it.

    Attributes:
        way: stretches, one after the other.
        floors: the floor of all stretches, and that of dead ends.
        cuts: lines across corners that are cut off, each with the number of its bend.
        posts: what stands on the floor, each with the number of its stretch.
        start: millimetres from the beginning of the way.
        told: what the robot comes to, in words.
    """

    way: tuple[Stretch, ...]
    floors: tuple[Passage, ...]
    cuts: Mapping[int, tuple[Place, Place]]
    posts: tuple[tuple[int, Post], ...]
    start: int
    told: tuple[str, ...]


class _Leg(NamedTuple):
    """A stretch as it is planned.

    Attributes:
        turn: 1 for a bend to the left before it, -1 for one to the right, 0 for none.
        length: from the middle of the stretch before to the middle of the next.
        width: of the stretch.
        dead_ends: turns of what else leaves the place where it begins.
        posts: how many stand in it; it is a room then.
    """

    turn: int
    length: int
    width: int
    dead_ends: tuple[int, ...] = ()
    posts: int = 0


def draw_layout(rng: np.random.Generator, kind: Kind, difficulty: Difficulty) -> Layout | None:
    """Draw a layout; None: what was drawn does not fit."""
    chance = _Chance(rng, _MEASURES[difficulty].width)
    legs, told = _plan(chance, kind, _MEASURES[difficulty].things)
    way = _lay(legs, chance.draw((0, len(_STEPS) - 1)))
    floors = _floors(chance, legs, way)
    if sum(leg.length for leg in legs) > _LONGEST or _overlap(floors):
        return None
    likely = _LIKELY_POST if kind in (Kind.POSTS, Kind.HAIRPIN) else _POST
    return Layout(
        tuple(way),
        tuple(floor for floor, _ in floors),
        _cuts(chance, legs, way),
        tuple(
            (number, post)
            for number, (leg, stretch) in enumerate(zip(legs, way, strict=True))
            for post in _posts(chance, leg, stretch, likely)
        ),
        max(way[0].length - chance.draw(_START), _BEHIND),
        tuple(told),
    )


class _Chance(NamedTuple):
    """Random numbers, and the range of widths in centimetres."""

    rng: np.random.Generator
    widths: _Span

    def draw(self, span: _Span) -> int:
        """Return a whole number from the first to the last of a range."""
        return int(self.rng.integers(span[0], span[1] + 1))

    def side(self) -> int:
        """Return 1 for left or -1 for right."""
        return 1 if self.happens(0.5) else -1

    def width(self) -> int:
        """Return the width of a corridor."""
        return 10 * self.draw(self.widths)

    def happens(self, share: float) -> bool:
        """Tell whether something happens that does so in a share of all cases."""
        return float(self.rng.random()) < share


_Thing = Callable[[_Chance, _Leg, _Span], tuple[list[_Leg], str]]
"""Plans what follows a leg: legs, the last of which has a length from a range, and words."""


def _bend(chance: _Chance, _before: _Leg, after: _Span) -> tuple[list[_Leg], str]:
    turn = chance.side()
    return [_Leg(turn, chance.draw(after), chance.width())], f"a bend to the {_SIDES[turn]}"


def _s_curve(chance: _Chance, before: _Leg, after: _Span) -> tuple[list[_Leg], str]:
    turn = chance.side()
    legs = _two(chance, before, (turn, -turn), after)
    return legs, f"an S-curve to the {_SIDES[turn]} and the {_SIDES[-turn]}"


def _hairpin(chance: _Chance, before: _Leg, after: _Span) -> tuple[list[_Leg], str]:
    turn = chance.side()
    legs = _two(chance, before, (turn, turn), after)
    return legs, f"a bend of 180 degrees to the {_SIDES[turn]}"


def _two(chance: _Chance, before: _Leg, turns: tuple[int, int], after: _Span) -> list[_Leg]:
    """Bend twice, with little more between than the walls need."""
    last = _Leg(turns[1], chance.draw(after), chance.width())
    between = (before.width + last.width) // 2 + chance.draw(_BETWEEN)
    return [_Leg(turns[0], between, chance.width()), last]


def _junction(chance: _Chance, _before: _Leg, after: _Span) -> tuple[list[_Leg], str]:
    turn = chance.side()
    choices = ((0,), (-turn,), (0, -turn))
    dead_ends = choices[chance.draw((0, len(choices) - 1))]
    names = {0: "straight on", -turn: f"to the {_SIDES[-turn]}"}
    where = " and ".join(names[each] for each in dead_ends)
    leg = _Leg(turn, chance.draw(after), chance.width(), dead_ends)
    return [leg], f"a junction: on to the {_SIDES[turn]}, a dead end {where}"


def _room(chance: _Chance, _before: _Leg, after: _Span) -> tuple[list[_Leg], str]:
    posts = chance.draw(_ROOM_POSTS)
    room = _Leg(0, chance.draw(_ROOM), chance.draw(_ROOM) // 2 * 2, (), posts)
    door = _Leg(chance.draw((-1, 1)), chance.draw(after), chance.width())
    names = {0: "straight on", **{turn: f"to the {side}" for turn, side in _SIDES.items()}}
    return [room, door], f"a room with posts, its door {names[door.turn]}"


_THINGS: Final[Mapping[Kind, _Thing]] = MappingProxyType(
    {
        Kind.BENDS: _bend,
        Kind.S_CURVE: _s_curve,
        Kind.HAIRPIN: _hairpin,
        Kind.JUNCTIONS: _junction,
        Kind.POSTS: _room,
    }
)


def _plan(chance: _Chance, kind: Kind, things: _Span) -> tuple[list[_Leg], list[str]]:
    legs, told = [_Leg(0, chance.draw(_FIRST), chance.width())], []
    count = chance.draw(things)
    for number in range(count):
        own = number == 0 or chance.happens(_AGAIN)
        after = _LAST if number == count - 1 else _MIDDLE
        more, words = _THINGS[kind if own else Kind.BENDS](chance, legs[-1], after)
        legs += more
        told.append(words)
    return legs, told


def _lay(legs: list[_Leg], towards: int) -> list[Stretch]:
    way: list[Stretch] = []
    x, y = 0, 0
    for leg in legs:
        towards = (towards + leg.turn) % len(_STEPS)
        way.append(Stretch(x, y, towards, leg.length, leg.width))
        x, y = way[-1].at(leg.length)
    return way


_Floor = tuple[Passage, frozenset[int]]
"""A floor, and the numbers of the places along the way that it reaches."""


def _floors(chance: _Chance, legs: list[_Leg], way: list[Stretch]) -> list[_Floor]:
    floors = []
    dead_ends = []
    for k, (leg, stretch) in enumerate(zip(legs, way, strict=True)):
        before = way[k - 1].width // 2 if leg.turn else 0
        after = way[k + 1].width // 2 if k + 1 < len(way) and legs[k + 1].turn else 0
        floors.append((stretch.floor(before, after), frozenset((k, k + 1))))
        for turn in leg.dead_ends:
            # as wide as what it goes on with, on the other side of what it leaves
            along, across = (way[k - 1], stretch) if turn == 0 else (stretch, way[k - 1])
            length = across.width // 2 + chance.draw(_DEAD_END)
            towards = (way[k - 1].towards + turn) % len(_STEPS)
            end = Stretch(stretch.x, stretch.y, towards, length, along.width)
            dead_ends.append((end.floor(0, 0), frozenset((k,))))
    return floors + dead_ends


def _overlap(floors: list[_Floor]) -> bool:
    return any(
        not places & others and floor.is_near(other, APART)
        for number, (floor, places) in enumerate(floors)
        for other, others in floors[:number]
    )


def _cuts(chance: _Chance, legs: list[_Leg], way: list[Stretch]) -> dict[int, tuple[Place, Place]]:
    cuts = {}
    for k, leg in enumerate(legs):
        if leg.turn and not leg.dead_ends and not legs[k - 1].posts and chance.happens(_CUT_OFF):
            size = chance.draw(_CUT)
            before, after = way[k - 1], way[k]
            outside = -leg.turn * before.width // 2
            begin = before.at(before.length + after.width // 2 - size, outside)
            cuts[k] = begin, after.at(size - before.width // 2, -leg.turn * after.width // 2)
    return cuts


def _posts(chance: _Chance, leg: _Leg, stretch: Stretch, likely: float) -> list[Post]:
    if leg.posts:
        return _in_a_room(chance, stretch, leg.posts)
    radius, gap = chance.draw(_SIDE_POST), chance.draw(_TO_THE_WALL)
    room = stretch.width - 2 * radius - gap
    if not chance.happens(likely) or room < _BY_A_POST:
        return []
    aside = chance.side() * (stretch.width // 2 - gap - radius)
    along = chance.draw((stretch.length // 5, stretch.length * 9 // 10))
    return [Post(*stretch.at(along, aside), radius)]


def _in_a_room(chance: _Chance, room: Stretch, count: int) -> list[Post]:
    posts: list[Post] = []
    for _ in range(_TRIES):
        radius = chance.draw(_ROOM_POST)
        edge = radius + _BETWEEN_POSTS
        along = chance.draw((edge, room.length - edge))
        x, y = room.at(along, chance.draw((edge - room.width // 2, room.width // 2 - edge)))
        away = [hypot(x - post.x, y - post.y) - post.radius for post in posts]
        if min(away, default=edge) >= edge and len(posts) < count:
            posts.append(Post(x, y, radius))
    return posts
