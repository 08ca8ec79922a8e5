"""The search for the longest drive: what it takes, and what it leaves open: docs/arenas.md.

From places near each arena's start and from anywhere in it, 40 commands. Of the answers that are
not certain, some are compared with a search that keeps eight times as many poses. Then drives that
were found with several margins are driven on emulated robots without drift.
"""

from collections import Counter
from time import process_time
from typing import NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Pose, Reset
from page import DOCS, report

from khepera_emulator.arenas.arena import Arena, arena_names, load_arena
from khepera_emulator.models import KHEPERA
from khepera_emulator.routes.oracle import WIDTHS, LongestDrive, Oracle
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import pose_of, random_pose
from khepera_emulator.world.outline import outline
from macor_hil.commands import COMMANDS
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.runs.trials import MAX_COMMANDS, Spread

_STARTS = 100
_WIDER = (8 * WIDTHS[-1],)
_COMPARED = 10
_MARGINS = (0.0, 0.001, 0.0015, 0.002)
_DRIVEN = ("corridor", "maze", "s-curve")
_DRIVES = 30
_HEAD = ("arena", "starts", "all 40", "fewer", "none", "open", "time, mean", "time, longest")


class _Asked(NamedTuple):
    """A start, what was told of it, and the seconds of processor time that it took."""

    start: Pose
    told: LongestDrive
    seconds: float


def main() -> None:
    """Ask, count, compare."""
    rows: list[tuple[str, ...]] = []
    longer: Counter[int] = Counter()
    for name in arena_names():
        arena = load_arena(name)
        oracle = Oracle(outline(arena, KHEPERA))
        for where, starts in (("near", _near(arena)), ("anywhere", _anywhere(arena))):
            asked = [_ask(oracle, start) for start in starts]
            rows.append((name, where, *_row(asked)))
            left_open = [each for each in asked if not each.told.exact][:_COMPARED]
            for start, told, _ in left_open:
                wider = oracle.longest_drive(start, MAX_COMMANDS, _WIDER).length
                longer[wider - told.length] += 1
    counts = ", ".join(f"{longer[k]} by {k}" for k in sorted(longer))
    note = f"Longer in a search that keeps eight times as many poses: {counts} commands."
    report("What is possible", _HEAD, rows, (DOCS / "arenas.md", "possible"), note)
    head = ("margin", "drives", "collided")
    report("Driven", head, [_drive(margin) for margin in _MARGINS], (DOCS / "arenas.md", "driven"))


def _drive(margin: float) -> tuple[str, ...]:
    collided = []
    for name in _DRIVEN:
        with open_hardware(f"khepera://{name}?drift=none") as hardware:
            assert hardware.bench is not None
            oracle = Oracle(hardware.bench.outline(), margin=margin)
            driver = Driver(hardware.robot)
            for seed in range(_DRIVES):
                start = hardware.bench.reset(Reset(random=True, seed=seed)).pose
                found = oracle.longest_drive(start, MAX_COMMANDS)
                driver.start()
                collided.append(any(driver.execute(COMMANDS[c]).collided for c in found.commands))
    return f"{1000 * margin:g} mm", str(len(collided)), str(sum(collided))


def _near(arena: Arena) -> list[Pose]:
    rng = np.random.default_rng(1)
    return [Spread().draw(pose_of(arena.start), rng) for _ in range(_STARTS)]


def _anywhere(arena: Arena) -> list[Pose]:
    rng, clearance = np.random.default_rng(2), FloorPlan(arena).clearance
    return [
        random_pose(arena.free, lambda pose: clearance(pose.x, pose.y) - KHEPERA.radius, rng)
        for _ in range(_STARTS)
    ]


def _ask(oracle: Oracle, start: Pose) -> _Asked:
    begin = process_time()
    told = oracle.longest_drive(start, MAX_COMMANDS)
    return _Asked(start, told, process_time() - begin)


def _row(asked: list[_Asked]) -> tuple[str, ...]:
    lengths = [each.told.length for each in asked]
    full, none = lengths.count(MAX_COMMANDS), lengths.count(0)
    times = [1000 * each.seconds for each in asked]
    return (
        str(full),
        str(len(asked) - full - none),
        str(none),
        str(sum(not each.told.exact for each in asked)),
        f"{np.mean(times):.0f} ms",
        f"{max(times):.0f} ms",
    )


if __name__ == "__main__":
    main()
