"""A controller as a process of its own: `python controller_process.py JSON`.

The JSON text holds fields of `RunOptions`, and `trouble`: `slow planner` (it takes seconds once the
robot has made a step), `exception` (a defect while the robot drives), `clock jump` (an hour ahead),
`clock jumps` (up to a day either way, again and again). With `hurry`, the clock that the robot's
drives are timed by goes so many times faster, as an emulator with `--speed` does; what is on the
line is timed as ever. The planner `circle` always turns left: round and round without ever meeting
a wall. A line `step` is printed for each decision, the end of the run or its error last; with
`forever` the next run follows, until a signal comes.
"""

import json
import random
import sys
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

from macor_hil.errors import MacorError
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.line.open_line import OpenLine
from macor_hil.hardware.robots.client import LineClient
from macor_hil.mind.experience import Moment
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions

SLOW = 2.5


class Circle:
    """Left for ever: a circle of 10 cm radius."""

    memory = "transitions"

    def plan(self, *_: object) -> Plan:
        return Plan((0.0, None, None), 0)


class SlowPlanner:
    """Takes its time at the third decision."""

    memory = "transitions"

    def __init__(self) -> None:
        self.left = 2

    def plan(self, memory: SensorimotorMap, now: Moment) -> Plan:
        self.left -= 1
        if self.left == -1:
            print("slow", flush=True)
            time.sleep(SLOW)
        return Reactive().plan(memory, now)


OWN_PLANNERS = {"circle": f"{__file__}:Circle", "slow": f"{__file__}:SlowPlanner"}


def break_in_mid_drive() -> None:
    """The driver's look at the sensors fails while the wheels turn, in the third command."""
    look, go = Khepera.proximity, Khepera.go_to
    moves: list[tuple[int, ...]] = []

    def counted(robot: Khepera, *target: int) -> None:
        moves.append(target)
        go(robot, *target)

    def broken(robot: Khepera) -> tuple[int, ...]:
        seen = look(robot)
        if len(moves) == 3 and max(map(abs, robot.request("E").values)) > 5:
            print("broken", flush=True)
            raise ZeroDivisionError("a defect")
        return seen

    patch.object(Khepera, "go_to", counted).start()
    patch.object(Khepera, "proximity", broken).start()


def jump() -> None:
    """The wall clock is an hour ahead from its 20th reading on."""
    read = time.time
    readings: list[float] = []

    def jumping() -> float:
        readings.append(read())
        if len(readings) == 20:
            print("jump", flush=True)
        return readings[-1] + 3600.0 * (len(readings) > 20)

    patch.object(time, "time", jumping).start()


def jump_about() -> None:
    """The wall clock is set anew now and then, up to a day ahead or back."""
    read, rng = time.time, random.Random(1)
    offset = [0.0]

    def jumping() -> float:
        if rng.random() < 0.01:
            offset[0] = rng.uniform(-86_400.0, 86_400.0)
        return read() + offset[0]

    patch.object(time, "time", jumping).start()


def hurry(times: float) -> None:
    """Time drives by a clock as fast as the emulated robot's."""
    take: Callable[..., None] = LineClient._take

    def faster(robot: LineClient[Any], line: OpenLine) -> None:
        take(robot, line)
        robot.clock = lambda: times * line.clock()

    patch.object(LineClient, "_take", faster).start()


def main() -> None:
    fields = json.loads(sys.argv[1])
    hurry(fields.pop("hurry", 1.0))
    trouble = fields.pop("trouble", "")
    if trouble == "slow planner":
        fields["planner"] = "slow"
    elif trouble == "exception":
        break_in_mid_drive()
    elif trouble == "clock jump":
        jump()
    elif trouble == "clock jumps":
        jump_about()
    forever = fields.pop("forever", False)
    if (planner := fields.get("planner")) in OWN_PLANNERS:
        fields["planner"] = OWN_PLANNERS[planner]
    options = RunOptions(**fields)
    while not run(options) and forever:
        pass


def run(options: RunOptions) -> bool:
    """A run, and how it ended; whether a signal has come."""
    try:
        report = serve(options, lambda _: print("step", flush=True))
    except MacorError as error:
        print(f"{type(error).__name__}: {error}", flush=True)
        return False
    print(report.ending.value, report.signal, report.recoveries, flush=True)
    return bool(report.signal)


if __name__ == "__main__":
    main()
