"""Steps of many robots, each alone in a world of its own and on a line of its own, compiled.

The plain form is `macor_hil.hardware.driver.Driver`, whose requests these are, over a `khepera://`
port. Arrays hold a row for each robot; robots that are not `active` are left alone.
"""

from typing import Any

from khepera_protocol.system.compiled import compiled

from khepera_emulator.robot.compiled.arcs import drive_arc
from khepera_emulator.robot.compiled.driving import run
from khepera_emulator.robot.compiled.layout import Stage
from khepera_emulator.robot.compiled.sensing import proximity
from khepera_emulator.robot.compiled.talking import (
    ask_counters,
    ask_sensors,
    hold_speed,
    set_speeds,
    zero_counters,
)
from khepera_emulator.robot.compiled.watching import front, watch


@compiled
def begin(
    robots: Any, walls: Any, slips: Any, noises: Any, line: Any, stage: Any, tally: Any
) -> None:
    """Stop, set the counters to 0, and look at the sensors and counters.

    Args:
        robots: records of `layout.ROBOT`.
        walls: see `driving.run`, shape (N, solids, 2).
        slips: drawn ahead, shape (N, K, 2).
        noises: drawn ahead, shape (N, K, 2, 8).
        line: one record of `layout.LINE`.
        stage: see `layout.Stage`.
        tally: see `layout.Tally`.
    """
    for i in range(len(robots)):
        if tally.active[i]:
            robot, mine, slip = robots[i], walls[i], slips[i]
            set_speeds(robot, mine, slip, 0, 0, line, stage)
            zero_counters(robot, mine, slip, line, stage)
            tally.began[i] = robot.now
            ask_sensors(robot, mine, slip, noises[i], line, stage)
            ask_counters(robot, mine, slip, tally.counters[i], line, stage)
            tally.targets[i] = 0


@compiled
def drive_arcs(
    robots: Any,
    walls: Any,
    slips: Any,
    noises: Any,
    line: Any,
    stage: Any,
    tally: Any,
    arcs: Any,
    which: Any,
    limit: int,
    patience: float,
) -> None:
    """Drive each robot an arc to its end, or to a collision.

    Args:
        robots: see `begin`.
        walls: likewise.
        slips: likewise.
        noises: likewise.
        line: likewise.
        stage: likewise.
        tally: likewise.
        arcs: see `layout.Arcs`.
        which: number of each robot's arc, shape (N,).
        limit: counts of a sensor at the front that are a collision.
        patience: seconds that an arc may take beyond its duration.
    """
    for i in range(len(robots)):
        if tally.active[i]:
            robot, mine, slip, k = robots[i], walls[i], slips[i], which[i]
            target = tally.targets[i]
            for w in range(2):
                target[w] += arcs.ways[k, w]
            tally.collided[i], _, _ = drive_arc(
                robot,
                mine,
                slip,
                noises[i],
                line,
                stage,
                arcs.profiles[k],
                target,
                tally.counters[i],
                limit,
                arcs.durations[k],
                patience,
            )
            if tally.collided[i]:
                target[:] = tally.counters[i]


@compiled
def hold_speeds(
    robots: Any,
    walls: Any,
    slips: Any,
    noises: Any,
    line: Any,
    stage: Any,
    tally: Any,
    speeds: Any,
    limit: int,
    seconds: float,
) -> None:
    """Let each robot hold wheel speeds for a time, or to a collision.

    Args:
        robots: see `begin`.
        walls: likewise.
        slips: likewise.
        noises: likewise.
        line: likewise.
        stage: likewise.
        tally: likewise.
        speeds: of both wheels, counts / 10 ms, shape (N, 2).
        limit: counts of a sensor at the front that are a collision.
        seconds: how long.
    """
    for i in range(len(robots)):
        if tally.active[i]:
            robot, mine, slip = robots[i], walls[i], slips[i]
            set_speeds(robot, mine, slip, speeds[i, 0], speeds[i, 1], line, stage)
            end = robot.now + seconds
            watch(robot, mine, slip, noises[i], line, stage, limit, 0.0, end, -1.0)
            tally.collided[i] = front(robot) >= limit
            if tally.collided[i]:
                set_speeds(robot, mine, slip, 0, 0, line, stage)
            ask_counters(robot, mine, slip, tally.counters[i], line, stage)


@compiled
def make_room(robots: Any, slips: Any, noises: Any, blocks: Any, room: Any) -> bool:
    """Make room for a block of drawn numbers at the end, where less than that is left.

    Args:
        robots: see `begin`.
        slips: likewise.
        noises: likewise.
        blocks: length of a block of either.
        room: is told whether there is room for slips and for noises of each robot, shape (N, 2).

    Returns:
        Whether there is room anywhere.
    """
    anywhere = False
    for i in range(len(robots)):
        robot = robots[i]
        room[i, 0] = room[i, 1] = False
        if slips.shape[1] - robot.slips < blocks[0]:
            room[i, 0] = anywhere = True
            for k in range(robot.slips, slips.shape[1]):
                slips[i, k - blocks[0]] = slips[i, k]
            robot.slips -= blocks[0]
        if noises.shape[1] - robot.noises < blocks[1]:
            room[i, 1] = anywhere = True
            for k in range(robot.noises, noises.shape[1]):
                noises[i, k - blocks[1]] = noises[i, k]
            robot.noises -= blocks[1]
    return anywhere


@compiled
def pass_periods(
    robots: Any,
    walls: Any,
    slips: Any,
    noises: Any,
    model: Any,
    curves: Any,
    solids: Any,
    blocks: Any,
    room: Any,
    speeds: Any,
    periods: int,
) -> bool:
    """Let each robot hold wheel speeds for control periods, then scan its sensors; no line.

    Nothing passes where numbers must be drawn before.

    Args:
        robots: see `begin`.
        walls: likewise.
        slips: likewise.
        noises: likewise.
        model: part of the stage, see `layout.Stage`: arrays are handed over faster than tuples.
        curves: likewise.
        solids: likewise.
        blocks: see `make_room`.
        room: likewise.
        speeds: of both wheels, counts / 10 ms, shape (N, 2).
        periods: how many.

    Returns:
        Whether numbers must be drawn before.
    """
    if make_room(robots, slips, noises, blocks, room):
        return True
    stage = Stage(model, curves, solids)
    for i in range(len(robots)):
        robot = robots[i]
        for w in range(2):
            hold_speed(robot, w, speeds[i, w], stage)
        run(robot, walls[i], slips[i], robot.ticks + periods, stage)
        if not robot.scanned:
            proximity(robot, noises[i, robot.noises], stage)
            robot.noises += 1
            robot.scanned = 1
    return False
