"""One arc of a robot, compiled: profile, target, looks on the way, a stop where it collides.

The plain form is `macor_hil.hardware.driver.Driver`, whose requests these are, over a `khepera://`
port.
"""

from typing import Any

from khepera_protocol.system.compiled import compiled

from khepera_emulator.robot.compiled.layout import SEEN
from khepera_emulator.robot.compiled.talking import (
    ask_counters,
    set_profiles,
    set_speeds,
    set_targets,
)
from khepera_emulator.robot.compiled.watching import watch


@compiled
def drive_arc(
    robot: Any,
    walls: Any,
    slips: Any,
    noises: Any,
    line: Any,
    stage: Any,
    profiles: Any,
    target: Any,
    counters: Any,
    limit: int,
    duration: float,
    patience: float,
) -> tuple[bool, int, float]:
    """Drive an arc to its end, or to a collision, where the robot is stopped.

    Args:
        robot: see `watching.watch`.
        walls: likewise.
        slips: likewise, as many as there are periods at least.
        noises: likewise, as many as there are scans at least.
        line: likewise.
        stage: likewise.
        profiles: top speed and acceleration of each wheel, shape (2, 2).
        target: counter values to go to, shape (2,).
        counters: is told the counters at the end, shape (2,).
        limit: counts of a sensor at the front that are a collision.
        duration: seconds that the arc takes.
        patience: seconds that it may take beyond these.

    Returns:
        Whether it was cut short, the number of exchanges, and seconds of the longest.
    """
    before = robot.now
    set_profiles(robot, walls, slips, profiles, line, stage)
    longest, before = robot.now - before, robot.now
    set_targets(robot, walls, slips, target[0], target[1], line, stage)
    longest, before = max(longest, robot.now - before), robot.now
    end, asked, long, _ = watch(
        robot, walls, slips, noises, line, stage, limit, before, duration, patience
    )
    longest, before = max(longest, long), robot.now
    collided = end == SEEN or not (robot.told_reached[0] and robot.told_reached[1])
    if collided:
        set_speeds(robot, walls, slips, 0, 0, line, stage)
        longest, before = max(longest, robot.now - before), robot.now
        asked += 1
    ask_counters(robot, walls, slips, counters, line, stage)
    return collided, asked + 3, max(longest, robot.now - before)
