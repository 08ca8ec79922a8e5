"""All robots of one world, brought from control period to control period together."""

from collections.abc import Sequence

from khepera_emulator.robot.robot import Robot
from khepera_emulator.world.world import World


class Crew:
    """The robots of a world, in the order in which each of them takes every step.

    A period has three parts: all robots aim, so that each knows how far the others may go; the
    dynamics run if anything can touch or moves by itself; all arrive, by the dynamics or, away
    from everything, exactly. Robots that do not take part in the dynamics are shown to them
    where they are.
    """

    def __init__(self, world: World, robots: Sequence[Robot]) -> None:
        self._world = world
        self._robots = robots
        self._alone = len(robots) == 1 and not world.things

    @property
    def moving(self) -> bool:
        """Whether any robot's wheels turn or are driven, or something slides or rolls."""
        return any(robot.moving for robot in self._robots) or self._world.restless

    def run(self, ticks: int) -> None:
        """Let control periods pass up to the given number since the robots were made."""
        robots = self._robots
        if self._alone:
            robots[0].run(ticks)
            return
        while robots[0].ticks < ticks:
            if not self.moving:
                for robot in robots:
                    robot.rest(ticks)
                return
            self._period()

    def _period(self) -> None:
        for robot in self._robots:
            robot.aim()
        robots, things = self._robots, self._world.things
        most = max([robot.chassis.reach for robot in robots] + [t.footprint.reach for t in things])
        near = [robot.chassis.meets_mover(most) for robot in self._robots]
        if self._world.restless or any(near):
            for robot, dynamic in zip(self._robots, near, strict=True):
                if dynamic:
                    robot.chassis.drive()
                else:
                    robot.chassis.show()
            self._world.period()
        for robot, dynamic in zip(self._robots, near, strict=True):
            robot.arrive(robot.chassis.arrive() if dynamic else robot.chassis.go())
