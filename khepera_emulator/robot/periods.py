"""Control periods of all robots of a world, who take each of them together.

A period has three parts: all robots aim, so that each knows how far the others may go; the
dynamics run if anything can touch or moves by itself; all arrive, by the dynamics or, away from
everything, exactly. Robots that do not take part in the dynamics are shown to them where they are.
"""

from collections.abc import Sequence

from khepera_emulator.robot.rolling import Rolling
from khepera_emulator.world.world import World


def is_moving(world: World, robots: Sequence[Rolling]) -> bool:
    """Tell whether any robot's wheels turn or are driven, or something slides or rolls."""
    return any(robot.moving for robot in robots) or world.restless


def run_periods(world: World, robots: Sequence[Rolling], ticks: int) -> None:
    """Let control periods pass up to the given number since the robots were made.

    Args:
        world: of the robots.
        robots: all of them, in the order in which each takes every step.
        ticks: number of the last period.
    """
    if len(robots) == 1 and world.dynamics is None:
        robots[0].run(ticks)
        return
    while robots[0].ticks < ticks:
        if not is_moving(world, robots):
            for robot in robots:
                robot.rest(ticks)
            return
        _period(world, robots)


def _period(world: World, robots: Sequence[Rolling]) -> None:
    world.neighbours.period += 1
    for robot in robots:
        robot.aim()
    things = world.things
    most = max([robot.chassis.reach for robot in robots] + [t.footprint.reach for t in things])
    near = [robot.chassis.meets_mover(most) for robot in robots]
    if world.restless or any(near):
        for robot, dynamic in zip(robots, near, strict=True):
            if dynamic:
                robot.chassis.drive()
            else:
                robot.chassis.show()
        world.period()
    for robot, dynamic in zip(robots, near, strict=True):
        robot.arrive(robot.chassis.arrive() if dynamic else robot.chassis.go())
