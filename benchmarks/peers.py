"""Robots of other simulators beside those of this one: a room, eight sensors, steps of 20 ms.

    python benchmarks/peers.py

Peers are optional (extra `benchmarks`); those that are not installed are left out. All take turns
in one run; medians of robot-steps in a second of the processor, and of the clock.
"""

import os
import time
from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from typing import Any, Final, NamedTuple

import numpy as np
from khepera_protocol.zenoh.payloads import Pose, Reset
from rich.console import Console
from rich.table import Table

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.robot.emulator import Emulator, Setup
from khepera_emulator.robot.many import Many

STEP: Final = 0.020
_ROUNDS: Final = 5
_AT_WALL: Final = Pose(x=0.4525, y=0.0, heading=0.0)

Go = Callable[[int], None]
"""Lets so many steps pass."""


class _Case(NamedTuple):
    """A way of stepping robots: its name, how it is made, how many robots and steps."""

    name: str
    make: Callable[[int], Go]
    robots: int
    steps: int


def _many(robots: int) -> Go:
    many = Many(Setup(load_arena("open-box"), baud=None), robots)
    for number in range(robots):
        many.put(number, number, _AT_WALL if robots == 1 else None, anywhere=True)
    speeds = np.tile([[4, -4]], (robots, 1))

    def go(steps: int) -> None:
        for _ in range(steps):
            many.pass_periods(speeds, 2)
            many.proximity  # noqa: B018 - read, as a learner does

    return go


def _over_the_protocol(_: int) -> Go:
    emulator = Emulator(Setup(load_arena("open-box"), baud=None))
    emulator.reset(Reset(pose=_AT_WALL, seed=1))
    emulator.write(b"D,4,-4\n")

    def go(steps: int) -> None:
        for _ in range(steps):
            emulator.write(b"N\n")
            emulator.advance(emulator.now + STEP)
            emulator.read()

    return go


def _navground(_: int) -> Go:
    from navground import core, sim

    world = sim.World()
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    for begin, end in zip(corners, corners[1:] + corners[:1], strict=True):
        world.add_wall(sim.Wall(core.LineSegment(np.array(begin), np.array(end))))
    kinematics = core.kinematics.TwoWheelsDifferentialDriveKinematics(
        max_speed=0.16, wheel_axis=0.053
    )
    lidar = sim.state_estimations.LidarStateEstimation(
        range=0.0705, start_angle=-np.pi, field_of_view=2 * np.pi, resolution=8
    )
    behavior = core.behaviors.DummyBehavior(kinematics, 0.0275)
    agent = sim.Agent(radius=0.0275, kinematics=kinematics, behavior=behavior)
    agent.position = np.array([_AT_WALL.x, _AT_WALL.y])
    world.add_agent(agent)
    state = core.SensingState()

    def go(steps: int) -> None:
        for _ in range(steps):
            world.update(STEP)
            lidar.update(agent, world, state)

    return go


def _kheperax(robots: int) -> Go:
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    import jax

    # Kheperax 0.2 asks for names that JAX has moved
    for name in ("tree_leaves", "tree_map"):
        setattr(jax, name, getattr(jax.tree_util, name))
    from kheperax.tasks.config import KheperaxConfig
    from kheperax.tasks.main import KheperaxTask

    task: Any = KheperaxTask(KheperaxConfig.get_default())
    keys = jax.random.split(jax.random.PRNGKey(0), robots)
    state = jax.jit(jax.vmap(task.reset))(keys)
    step = jax.jit(jax.vmap(task.step))
    actions = jax.numpy.tile(jax.numpy.array([0.3, 0.4]), (robots, 1))

    def go(steps: int) -> None:
        nonlocal state
        for _ in range(steps):
            state = step(state, actions)
        jax.block_until_ready(state.obs)

    return go


def main() -> None:
    """Measure, and print a table."""
    cases = [
        _Case("this one, over the protocol", _over_the_protocol, 1, 2_000),
        _Case("this one, without bytes, step by step", _many, 1, 5_000),
        _Case("this one, 1,024 at once", _many, 1_024, 60),
    ]
    if find_spec("navground"):
        cases.append(_Case("navground, its robot stands", _navground, 1, 5_000))
    if find_spec("kheperax"):
        cases.append(_Case("Kheperax, step by step", _kheperax, 1, 1_000))
        cases.append(_Case("Kheperax, 1,024 at once", _kheperax, 1_024, 40))
    made = [(case, case.make(case.robots)) for case in cases]
    for _, go in made:
        go(2)
    speeds: dict[str, list[tuple[float, float]]] = {case.name: [] for case in cases}
    for _ in range(_ROUNDS):
        for case, go in made:
            clock, processor = time.perf_counter(), time.process_time()
            go(case.steps)
            done = case.steps * case.robots
            speeds[case.name].append(
                (done / (time.process_time() - processor), done / (time.perf_counter() - clock))
            )
    table = Table("robot-steps a second", "of the processor", "of the clock")
    for name, found in speeds.items():
        table.add_row(name, *(f"{median(column):,.0f}" for column in zip(*found, strict=True)))
    Console().print(table)


if __name__ == "__main__":
    main()
