"""Arenas for tests, made in place."""

from collections.abc import Callable

from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import Arena, load_arena
from khepera_emulator.models import KHEPERA2, Model
from khepera_emulator.world.floor_plan import FloorPlan


def arena(**parts: object) -> Arena:
    """An arena with given parts; without any, an endless floor."""
    return Arena.model_validate(
        {
            "version": 1,
            "title": "test",
            "start": {"x": 0, "y": 0},
            "free": {"points": [[0, 0], [0.1, 0]], "half_width": 0.1},
            **parts,
        }
    )


def gap_in(name: str, model: Model = KHEPERA2) -> Callable[[Pose], float]:
    plan = FloorPlan(load_arena(name))
    return lambda pose: plan.clearance(pose.x, pose.y) - model.radius


def reachable(name: str, model: Model, step: float = 0.01) -> set[tuple[float, float]]:
    """Centres of squares of the floor that a robot's middle can get to from the start."""
    arena, gap = load_arena(name), gap_in(name, model)
    first = (round(arena.start.x / step), round(arena.start.y / step))
    seen, border = {first}, [first]
    while border:
        i, j = border.pop()
        for near in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if near not in seen and gap(Pose(x=near[0] * step, y=near[1] * step, heading=0)) > 0:
                seen.add(near)
                border.append(near)
    return {(i * step, j * step) for i, j in seen}
