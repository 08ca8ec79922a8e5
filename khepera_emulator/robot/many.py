"""Many robots, each alone in a world and on a line of its own, stepped together on all cores.

They are what `emulator.Emulator` is after a seeded reset, number by number; but nothing of them is
an object, and no bytes are made. `macor_hil.environment` drives them as `KheperaEnv` drives one.
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
from khepera_protocol.extras import how_to_install
from khepera_protocol.system.compiled import is_installed, load
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from khepera_emulator.body.drift import SLIP_BLOCK, slips
from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import KheperaModel
from khepera_emulator.robot.compiled.layout import Arcs, Tally
from khepera_emulator.robot.compiled.packing import Packed, is_quick, line_of, stage_of
from khepera_emulator.robot.emulator import Emulator
from khepera_emulator.robot.khepera.choices import Choices
from khepera_emulator.robot.khepera.robot import Robot
from khepera_emulator.robot.setup import Setup
from khepera_emulator.senses.camera import OmniCamera
from khepera_emulator.senses.infrared import NOISE_BLOCK, scan_noises
from khepera_emulator.senses.renderers.view import Image
from khepera_emulator.world.free_space import check_room, random_pose
from khepera_emulator.world.rays import Array

_KERNEL: Final = "khepera_emulator.robot.compiled.steps"

_CHUNK: Final = 32
"""Robots for which a thread of its own pays."""

# children of a reset's seed, as `Emulator` and the robot's parts spawn them
_SLIP, _SCANS, _CAMERA, _PLACES = (1, 0), (1, 1, 1), (2,), (3,)

Which = NDArray[np.bool_]
Counts = NDArray[np.int64]


class Many:
    """Robots of one kind in worlds of one kind.

    Args:
        setup: what each is made from; its seed is that of their wheels.
        size: how many.
        workers: threads; None: as many as there are processors.

    Attributes:
        tally: what the last step has come to.

    Raises:
        EmulatorError: Numba is not installed, or the arena, the robot or its line has more to it
            than compiled functions know.
    """

    def __init__(self, setup: Setup, size: int, workers: int | None = None) -> None:
        _check(setup)
        self._kernel: Any = load(_KERNEL)
        self._emulator = emulator = Emulator(setup)
        world, robot = emulator.fleet.world, emulator.robot
        if not isinstance(robot, Robot):
            raise EmulatorError("many robots at once are Kheperas; make others one by one")
        self._gap = emulator.fleet.gap_at_start(emulator)
        self._inside = emulator.fleet.enclosure.holds
        self._stage = stage_of(world.plan, robot)
        packed = Packed(robot, len(self._stage.solids))
        packed.take()
        self._new = packed.records[0].copy()
        self._robots = np.repeat(packed.records, size)
        self._counts: Counts = self._robots["counts"]
        self._walls = np.zeros((size, len(self._stage.solids), 2))
        self._slips = np.zeros((size, 2 * SLIP_BLOCK, 2))
        self._noises = np.zeros((size, 2 * NOISE_BLOCK, 2, 8))
        self._blocks = np.array([SLIP_BLOCK, NOISE_BLOCK])
        self._room = np.zeros((size, 2), np.bool_)
        drawn = self._robots, self._walls, self._slips, self._noises
        self._whole = *drawn, *self._stage, self._blocks, self._room
        self._draws: dict[int, _Draws] = {}
        self._line = line_of(emulator.uart)
        self.tally = _tally(size)
        count = min(workers or len(os.sched_getaffinity(0)), max(1, size // _CHUNK))
        bounds = [size * k // count for k in range(count + 1)]
        self._parts = list(map(slice, bounds, bounds[1:]))
        self._pool = ThreadPoolExecutor(count)
        none = np.random.default_rng(0)
        self._cameras = [OmniCamera(world, none, setup.mirror) for _ in self._parts]

    def __len__(self) -> int:
        return len(self._robots)

    def close(self) -> None:
        """End the threads, and give back the physics client."""
        self._pool.shutdown()
        self._emulator.close()

    @property
    def poses(self) -> Array:
        """Poses of all: x, y (metres) and heading (radians, -pi to pi), shape (N, 3)."""
        robots = self._robots
        heading = (robots["heading"] + pi) % (2 * pi) - pi
        return np.column_stack([robots["x"], robots["y"], heading])

    @property
    def proximity(self) -> Counts:
        """The proximity sensors as they were last read, shape (N, 8)."""
        return self._counts.copy()

    @property
    def times(self) -> Array:
        """Seconds since each has begun, shape (N,)."""
        elapsed: Array = self._robots["now"] - self.tally.began
        return elapsed

    def put(self, number: int, seed: int, pose: Pose | None = None, *, anywhere: bool) -> Pose:
        """Put a robot down, all chance anew from a seed; its line is silent, and nothing moves.

        Args:
            number: of the robot.
            seed: of all that happens by chance.
            pose: where; None: a free place, or the arena's start.
            anywhere: whether a free place is meant.

        Returns:
            Where it is.

        Raises:
            EmulatorError: the pose is not free, or no free one was found.
        """
        if pose is None and anywhere:
            free, rng = self._emulator.setup.arena.free, _stream(seed, _PLACES)
            pose = random_pose(free, self._gap, rng, self._inside)
        pose = pose or self._emulator.start_pose
        check_room(pose, self._gap, self._inside)
        draws = _Draws(*(_stream(seed, key) for key in (_SLIP, _SCANS, _CAMERA)))
        self._draws[number] = draws
        self._slips[number, SLIP_BLOCK:] = slips(draws.slips)
        self._noises[number, NOISE_BLOCK:] = scan_noises(draws.scans)
        self._place(number, pose, SLIP_BLOCK, NOISE_BLOCK)
        return pose

    def move(self, number: int, pose: Pose) -> None:
        """Put a robot that has not driven yet somewhere else; what happens by chance goes on.

        Raises:
            EmulatorError: the pose is not free.
        """
        check_room(pose, self._gap, self._inside)
        robot = self._robots[number]
        self._place(number, pose, robot["slips"].item(), robot["noises"].item())

    def begin(self, active: Which) -> None:
        """Stop robots, set their counters to 0, and look at their sensors and counters."""
        self._step(active, lambda rows: self._kernel.begin(*self._on_lines(rows)))

    def drive_arcs(
        self, active: Which, arcs: Arcs, which: Counts, limit: int, patience: float
    ) -> None:
        """Drive robots an arc each, to its end or a collision; see `steps.drive_arcs`."""
        self._step(
            active,
            lambda rows: self._kernel.drive_arcs(
                *self._on_lines(rows), arcs, which[rows], limit, patience
            ),
        )

    def hold_speeds(self, active: Which, speeds: Counts, limit: int, seconds: float) -> None:
        """Let robots hold wheel speeds for a time, or to a collision; see `steps.hold_speeds`."""
        self._step(
            active,
            lambda rows: self._kernel.hold_speeds(
                *self._on_lines(rows), speeds[rows], limit, seconds
            ),
        )

    def pass_periods(self, speeds: Counts, periods: int) -> None:
        """Let all hold wheel speeds for control periods, then scan their sensors, without a line.

        Args:
            speeds: of both wheels, counts / 10 ms, shape (N, 2).
            periods: of 10 ms, 128 at most.
        """
        if len(self._parts) == 1:
            # in a step of one robot a second call would cost as much as the robot
            while self._kernel.pass_periods(*self._whole, speeds, periods):
                self._draw_more()
            return
        self._draw()
        self._over(
            lambda rows: self._kernel.pass_periods(
                *self._drawn(rows),
                *self._stage,
                self._blocks,
                self._room[rows],
                speeds[rows],
                periods,
            )
        )

    def look(self, active: Which, see: Callable[[int, Image], None]) -> None:
        """Take a picture of each robot's mirror; `see` gets it with its number, in any thread."""
        poses = self.poses.tolist()

        def take(rows: slice, camera: OmniCamera) -> None:
            for number in rows.start + np.flatnonzero(active[rows]):
                x, y, heading = poses[number]
                camera.rng = self._draws[int(number)].camera
                see(int(number), camera.mirror_image(Pose(x=x, y=y, heading=heading)))

        list(self._pool.map(take, self._parts, self._cameras))

    def _step(self, active: Which, call: Callable[[slice], None]) -> None:
        self._draw()
        self.tally.active[:] = active
        self._over(call)

    def _over(self, call: Callable[[slice], None]) -> None:
        """Call something for the rows of each thread."""
        if len(self._parts) == 1:
            call(self._parts[0])
        else:
            list(self._pool.map(call, self._parts))

    def _draw(self) -> None:
        """Draw random numbers for robots that have few left."""
        drawn = self._robots, self._slips, self._noises
        if self._kernel.make_room(*drawn, self._blocks, self._room):
            self._draw_more()

    def _draw_more(self) -> None:
        """Draw random numbers for robots that have room for them."""
        few_slips, few_noises = self._room.T
        for number in np.flatnonzero(few_slips).tolist():
            self._slips[number, SLIP_BLOCK:] = slips(self._draws[number].slips)
        for number in np.flatnonzero(few_noises).tolist():
            self._noises[number, NOISE_BLOCK:] = scan_noises(self._draws[number].scans)

    def _drawn(self, rows: slice) -> tuple[Any, ...]:
        return self._robots[rows], self._walls[rows], self._slips[rows], self._noises[rows]

    def _on_lines(self, rows: slice) -> tuple[Any, ...]:
        own = self.tally
        tally = Tally(
            own.active[rows],
            own.collided[rows],
            own.counters[rows],
            own.targets[rows],
            own.began[rows],
        )
        return *self._drawn(rows), self._line, self._stage, tally

    def _place(self, number: int, pose: Pose, slip: int, noise: int) -> None:
        self._robots[number] = self._new
        robot = self._robots[number]
        robot["x"], robot["y"], robot["heading"] = place = pose.x, pose.y, pose.heading
        robot["scan"] = place
        robot["slips"], robot["noises"] = slip, noise


class _Draws(NamedTuple):
    """Sources of a robot's randomness since it was put down."""

    slips: np.random.Generator
    scans: np.random.Generator
    camera: np.random.Generator


def _stream(seed: int, key: tuple[int, ...]) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))


def _tally(size: int) -> Tally:
    active, collided = np.ones(size, np.bool_), np.zeros(size, np.bool_)
    counters, targets = np.zeros((size, 2), np.int64), np.zeros((size, 2), np.int64)
    return Tally(active, collided, counters, targets, np.zeros(size))


def _check(setup: Setup) -> None:
    if not is_installed():
        raise EmulatorError(
            "many robots at once need Numba, which is not installed; install the extra 'compiled'"
            f" with: {how_to_install('compiled')}"
        )
    more = {
        "robots that are no Kheperas": not isinstance(setup.model, KheperaModel),
        "things to push": setup.arena.object,
        "turrets": setup.turrets,
        "faults": setup.faults,
        "a dead man's switch": setup.dead_man is not None,
        "choices of the firmware": isinstance(setup.choices, Choices)
        and setup.choices != Choices(),
        "a rigid body": setup.rigid,
        "a slow line": not is_quick(setup.baud),
    }
    found = [name for name, there in more.items() if there]
    if found:
        raise EmulatorError(
            f"many robots at once cannot have {' and '.join(found)}; make them one by one, such as"
            " with vectorization_mode='sync'"
        )
