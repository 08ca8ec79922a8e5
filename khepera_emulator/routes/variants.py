"""Variants of an arena in which the same ways are possible, but everything looks otherwise."""

from colorsys import hsv_to_rgb
from itertools import pairwise
from typing import Final

from khepera_emulator.arenas.arena import Arena, Colour, Wall

_HUE_STEP: Final = 0.618034
"""Of a turn: so that walls next to each other never look alike, however many there are."""

_GREY: Final = 0.6
"""Mean of a colour's three parts, as of the corridor's yellow: all that infrared sees of it."""

_DARKEST, _BRIGHTEST = 0.1, 0.95


def own_colour(number: int) -> Colour:
    """Return a colour that no other number has; infrared sees no difference between them."""
    rgb = hsv_to_rgb(number * _HUE_STEP % 1.0, 1.0, 1.0)
    mean = sum(rgb) / 3
    room = [
        ((_BRIGHTEST if part > mean else _DARKEST) - _GREY) / (part - mean)
        for part in rgb
        if abs(part - mean) > 1e-9
    ]
    red, green, blue = (round(_GREY + min(room) * (part - mean), 3) for part in rgb)
    return red, green, blue


def with_own_colours(arena: Arena) -> Arena:
    """Return an arena in which every straight wall has a colour of its own; posts keep theirs."""
    stretches = [
        (wall, [start, end]) for wall in arena.wall for start, end in pairwise(wall.points)
    ]
    walls: list[Wall] = [
        wall.model_copy(update={"points": points, "colour": own_colour(number)})
        for number, (wall, points) in enumerate(stretches)
    ]
    title = f"{arena.title}, every wall in a colour of its own"
    return arena.model_copy(update={"title": title, "wall": walls})
