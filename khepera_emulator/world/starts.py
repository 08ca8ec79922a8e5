"""The places of an arena where robots start, checked as those who use them check them."""

from collections.abc import Iterator

import numpy as np
from khepera_protocol.zenoh.payloads import Pose

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import Model
from khepera_emulator.world.enclosure import Enclosure
from khepera_emulator.world.floor_plan import FloorPlan, Surroundings
from khepera_emulator.world.free_space import check_room, pose_of, random_pose
from khepera_emulator.world.solids import Disc, Footprint, footprint


def check_starts(arena: Arena, model: Model) -> None:
    """See that a robot can stand at each start of an arena, and at a place by chance.

    Raises:
        EmulatorError: one cannot; all that are wrong are told.
    """
    wrong = list(_troubles(arena, model.radius))
    if wrong:
        count = f"{len(wrong)} mistakes: " if len(wrong) > 1 else ""
        raise EmulatorError(count + "; ".join(wrong))


def _troubles(arena: Arena, radius: float) -> Iterator[str]:
    plan = FloorPlan(arena)
    inside = Enclosure(plan, arena.start, radius).holds
    movers: list[Footprint] = [footprint(part) for part in arena.object]
    scene = Surroundings(plan, movers)

    def gap(pose: Pose) -> float:
        return scene.clearance(pose.x, pose.y) - radius

    for number, start in enumerate([arena.start, *arena.starts]):
        try:
            check_room(pose_of(start), gap, inside)
        except EmulatorError as error:
            yield f"{'start' if number == 0 else f'starts {number}'}: {error}"
        movers.append(Disc(start.x, start.y, radius, 0.0))
    try:
        random_pose(arena.free, gap, np.random.default_rng(0), inside)
    except EmulatorError as error:
        yield f"free: {error}"
