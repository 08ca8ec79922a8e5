"""A client that asks for the proximity sensors again and again, compiled.

Request and reply take their time on the line as in `line.uart.Uart`, on which nothing else is, and
the robot drives on. The plain form is the client's own loop over a `khepera://` port.
"""

from typing import Any

from khepera_protocol.system.compiled import compiled, part

from khepera_emulator.robot.compiled.layout import MORE, POSITION, SEEN, TOLD
from khepera_emulator.robot.compiled.talking import ask_controllers, ask_sensors

_FRONT = 6
"""Sensors that face where a robot can drive to."""

MOST_PERIODS = 16
"""Control periods that an exchange may take."""


@part
def front(robot: Any) -> int:
    """Return the highest count of the sensors at front and sides, as last read."""
    most = 0
    for sensor in range(_FRONT):
        most = max(most, robot.counts[sensor])
    return most


@compiled
def watch(
    robot: Any,
    walls: Any,
    slips: Any,
    noises: Any,
    line: Any,
    stage: Any,
    limit: int,
    begin: float,
    duration: float,
    patience: float,
) -> tuple[int, int, float, float]:
    """Ask until a sensor at the front has reached a limit, or a time has passed.

    After that time the motion controllers are asked as well, until both have reached their
    targets, or patience is over.

    Args:
        robot: a record of `layout.ROBOT`; the line is silent.
        walls: see `driving.run`.
        slips: drawn ahead, shape (K, 2).
        noises: drawn ahead, shape (K, 2, 8).
        line: a record of `layout.LINE`.
        stage: see `layout.Stage`.
        limit: counts.
        begin: time from which the duration counts, in seconds.
        duration: seconds.
        patience: seconds beyond the duration; less than 0: the controllers are not asked.

    Returns:
        The end (see `layout.MORE`), the number of exchanges, seconds of the longest, and seconds
        from the beginning to the last reply of the sensors.
    """
    asked, longest = 0, 0.0
    while True:
        if robot.slips + 2 * MOST_PERIODS > len(slips) or robot.noises + 1 > len(noises):
            return MORE, asked, longest, 0.0
        before = robot.now
        ask_sensors(robot, walls, slips, noises, line, stage)
        asked += 1
        longest = max(longest, robot.now - before)
        elapsed = robot.now - begin
        if front(robot) >= limit:
            return SEEN, asked, longest, elapsed
        if elapsed < duration:
            continue
        if patience < 0.0 or robot.mode[0] != POSITION or robot.mode[1] != POSITION:
            return SEEN, asked, longest, elapsed
        before = robot.now
        ask_controllers(robot, walls, slips, line, stage)
        asked += 1
        longest = max(longest, robot.now - before)
        both = robot.told_reached[0] and robot.told_reached[1]
        if both or elapsed > duration + patience:
            return TOLD, asked, longest, elapsed
