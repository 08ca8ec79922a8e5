"""Robots that share a world: they see, block and push each other, each on a line of its own."""

from collections.abc import Callable, Iterator
from math import cos, degrees, hypot, pi, sin
from typing import Any

import numpy as np
import pytest
from khepera_protocol.zenoh.payloads import Pose, Reset, Truth
from worlds import arena

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.body.drift import PRESETS
from khepera_emulator.errors import EmulatorError
from khepera_emulator.robot.emulator import Emulator, Setup, make_fleet

SQUARE = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]
DIAMETER = 0.055
FACING = [{"x": 0.2, "y": 0.0, "heading": 180.0}]


def setup(*starts: dict[str, float], seed: int = 0, drift: str = "none", **parts: Any) -> Setup:
    made = arena(starts=list(starts), wall=[{"points": SQUARE}], **parts)
    return Setup(arena=made, seed=seed, drift=PRESETS[drift], baud=None)


@pytest.fixture
def fleet() -> Iterator[Callable[..., list[Emulator]]]:
    opened: list[list[Emulator]] = []

    def make(size: int, *starts: dict[str, float], **options: Any) -> list[Emulator]:
        opened.append(make_fleet(setup(*starts, **options), size))
        return opened[-1]

    yield make
    for robots in opened:
        robots[0].close()


def ask(robot: Emulator, line: bytes) -> bytes:
    robot.write(line + b"\n")
    robot.advance(robot.now)
    return robot.read()


def after(robot: Emulator, seconds: float) -> Truth:
    robot.advance(robot.now + seconds)
    return robot.truth()


def places(robots: list[Emulator]) -> list[tuple[float, float]]:
    return [(robot.truth().pose.x, robot.truth().pose.y) for robot in robots]


class TestStarts:
    def test_the_arena_may_name_them(self, fleet: Callable[..., list[Emulator]]) -> None:
        robots = fleet(2, {"x": 0.1, "y": 0.2, "heading": 90.0})
        assert places(robots) == [(0.0, 0.0), (0.1, 0.2)]
        assert robots[1].truth().pose.heading == pytest.approx(pi / 2)

    def test_others_spread_along_the_free_strip(self, fleet: Callable[..., list[Emulator]]) -> None:
        strip = {"points": [[-0.4, 0], [0.4, 0]], "half_width": 0.4, "gap": 0.03}
        robots = fleet(6, free=strip)
        at = places(robots)
        assert at[0] == (0.0, 0.0)
        gaps = [hypot(a[0] - b[0], a[1] - b[1]) for k, a in enumerate(at) for b in at[:k]]
        assert min(gaps) >= DIAMETER + 0.03
        assert places(fleet(6, free=strip)) == at
        assert places(fleet(6, free=strip, seed=1)) != at

    def test_too_many_are_refused(self) -> None:
        with pytest.raises(EmulatorError, match="no free place for a robot"):
            make_fleet(setup(), 20)

    def test_two_on_one_place_are_refused(self) -> None:
        with pytest.raises(EmulatorError, match="no room for the robot"):
            make_fleet(setup({"x": 0.03, "y": 0.03}), 2)


def test_no_meeting_is_missed_by_looking_only_when_something_can_be_near() -> None:
    """Robots that drive at each other from all sides, and a ball between them."""
    starts = [
        {"x": 0.3 * cos(angle), "y": 0.3 * sin(angle), "heading": degrees(angle) - 180}
        for angle in (0.0, 1.3, 2.6, 3.9, 5.2)
    ]
    ball = {"shape": "ball", "centre": [0.06, 0.0], "radius": 0.02, "mass": 0.005}

    def drive(*, always: bool) -> tuple[list[list[Pose]], int]:
        robots = make_fleet(setup(*starts, object=[ball]), 6)
        world = robots[0].robot.chassis._world
        rng = np.random.default_rng(0)
        poses, met = [], 0
        for step in range(400):
            if step % 100 == 0:
                for robot in robots[1:]:
                    robot.write(b"D,%d,%d\n" % tuple(rng.integers(10, 14, 2)))
            if step == 200:
                robots[0].reset(Reset(random=True))
            world.arrangement += always
            robots[0].advance(robots[0].now + 0.01)
            poses.append([robot.truth().pose for robot in robots])
            met += sum(robot.robot.chassis._dynamic for robot in robots)
        robots[0].close()
        return poses, met

    looking, met = drive(always=True)
    assert met > 100
    assert drive(always=False) == (looking, met)


class TestLines:
    def test_each_robot_has_its_own(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(2, *FACING)
        assert ask(first, b"G,5,6") == b"g\r\n"
        assert ask(second, b"H") == b"h,0,0\r\n"
        assert ask(first, b"H") == b"h,5,6\r\n"

    def test_time_passes_for_both(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(2, *FACING)
        ask(second, b"D,5,-5")
        first.advance(1.0)
        assert second.now == 1.0
        assert second.moving
        assert abs(second.truth().pose.heading) < pi - 0.1

    def test_requests_are_carried_out_in_the_order_of_their_arrival(self) -> None:
        made = setup({"x": 0.2, "y": 0.2, "heading": 180.0})
        robots = make_fleet(Setup(arena=made.arena, drift=made.drift, baud=9600), 2)
        robots[1].write(b"D,10,10\n")
        robots[0].advance(0.5)
        robots[0].write(b"D,10,10\nH\n")
        robots[1].write(b"H\nD,0,0\nH\n")
        robots[0].advance(2.0)
        assert robots[1].read().count(b"\r\n") == 4
        assert robots[0].read().count(b"\r\n") == 2
        # the second stopped half a second after it began, in spite of the first's long run
        assert robots[1].truth().pose.x == pytest.approx(0.2 - 0.042, abs=0.006)
        robots[0].close()

    def test_how_time_is_cut_makes_no_difference(self) -> None:
        def drive(steps: int) -> list[tuple[bytes, Truth]]:
            made = setup(*FACING, drift="default")
            robots = make_fleet(Setup(arena=made.arena, drift=made.drift, baud=9600), 2)
            robots[0].write(b"D,10,9\nN\nH\nN\n")
            robots[1].write(b"D,5,9\nN\nN\nH\n")
            for step in range(steps):
                now = robots[0].now
                robots[step % 2].advance(now + (2.0 - now) / (steps - step))
            seen = [(robot.read(), robot.truth()) for robot in robots]
            assert any(truth.touched for _, truth in seen)
            robots[0].close()
            return seen

        assert drive(1) == drive(6) == drive(501)


class TestContact:
    def test_robots_block_each_other(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = robots = fleet(2, *FACING)
        for robot in robots:
            ask(robot, b"D,10,10")
        after(first, 4.0)
        (x0, _), (x1, _) = places(robots)
        assert x1 - x0 == pytest.approx(DIAMETER, abs=0.001)
        assert (x0 + x1) / 2 == pytest.approx(0.1, abs=0.005)
        assert first.truth().contact
        assert second.truth().contact

    def test_one_that_stands_holds_its_place_against_one_and_not_against_two(
        self, fleet: Callable[..., list[Emulator]]
    ) -> None:
        ways = []
        for size in (2, 3):
            ahead, behind = ({"x": x, "y": 0.0, "heading": 0.0} for x in (0.06, -0.06))
            robots = fleet(size, ahead, behind)
            for robot in robots[::2]:
                ask(robot, b"D,10,10")
            after(robots[0], 4.0)
            ways.append(places(robots)[1][0] - 0.06)
            # the gear turns the wheels' encoders, unless the tyres slip
            assert int(ask(robots[1], b"H").split(b",")[1]) > 100
            assert robots[1].truth().touched
        assert 0.0 < ways[0] < 0.05
        assert ways[1] > ways[0] + 0.05

    def test_one_that_passes_by_does_not_touch(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(2, {"x": 0.2, "y": DIAMETER + 0.004, "heading": 180.0})
        alone = Emulator(setup())
        for robot in (first, second, alone):
            ask(robot, b"D,10,10")
        assert not after(first, 2.0).touched
        assert not second.truth().touched
        # so near that the dynamics ran, and still as alone
        assert first.truth().pose.x == pytest.approx(after(alone, 2.0).pose.x, abs=0.001)
        alone.close()

    def test_away_from_the_others_a_robot_is_as_alone(
        self, fleet: Callable[..., list[Emulator]]
    ) -> None:
        first, _ = fleet(2, {"x": 0.3, "y": 0.3, "heading": 0.0}, drift="default")
        alone = Emulator(setup(drift="default"))
        for robot in (first, alone):
            ask(robot, b"D,5,7")
            robot.advance(2.0)
        assert first.truth() == alone.truth()
        assert ask(first, b"H") == ask(alone, b"H")
        alone.close()

    def test_it_is_so_while_others_collide(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second, third = fleet(
            3, {"x": 0.3, "y": 0.3, "heading": 0.0}, {"x": 0.4, "y": 0.3, "heading": 180.0}
        )
        alone = Emulator(setup())
        for robot in (first, second, third, alone):
            ask(robot, b"D,5,7")
        first.advance(2.0)
        assert second.truth().touched
        assert third.truth().touched
        pose = first.truth().pose
        alone.advance(first.now)
        assert pose == alone.truth().pose
        alone.close()

    def test_nothing_bumps_into_where_a_robot_was(
        self, fleet: Callable[..., list[Emulator]]
    ) -> None:
        box = {"shape": "box", "centre": [-0.08, 0.0], "size": [0.03, 0.03]}
        first, second = fleet(2, {"x": -0.15, "y": 0.0, "heading": 0.0}, object=[box])
        ask(first, b"D,15,15")
        after(first, 2.0)
        ask(first, b"D,0,0")
        ask(second, b"D,8,8")
        # the second pushes the box through the place that the first has left
        assert after(second, 3.0).pose.x == pytest.approx(-0.15 + 0.19, abs=0.01)
        assert second.truth().touched
        assert not first.truth().touched


class TestSight:
    def test_infrared_sees_a_robot_as_a_grey_post(self) -> None:
        grey = 120 / 255
        post = {"centre": [0.07, 0.0], "radius": DIAMETER / 2, "colour": [grey] * 3}
        white = {**post, "colour": [1, 1, 1]}
        readings = []
        worlds: list[tuple[int, dict[str, Any]]] = [
            (2, {}),
            (1, {"cylinder": [post]}),
            (1, {"cylinder": [white]}),
        ]
        for size, parts in worlds:
            robots = make_fleet(setup({"x": 0.07, "y": 0.0}, **parts), size)
            readings.append([int(word) for word in ask(robots[0], b"N").split(b",")[1:]])
            robots[0].close()
        assert readings[0] == readings[1]
        assert max(readings[2][2:4]) > max(readings[0][2:4]) > 50

    def test_it_sees_it_where_it_is_now(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(2, {"x": 0.075, "y": 0.0, "heading": 0.0})
        assert max(map(int, ask(first, b"N").split(b",")[3:5])) > 100
        ask(second, b"D,10,10")
        after(first, 1.5)
        assert max(map(int, ask(first, b"N").split(b",")[1:])) < 50

    def test_a_camera_sees_the_others_and_not_its_own_robot(self) -> None:
        pictures = []
        for size in (1, 2):
            robots = make_fleet(setup({"x": 0.15, "y": 0.0}), size)
            pictures.append(robots[0].panorama().astype(int))
            if size == 2:
                behind = robots[1].panorama().astype(int)
            robots[0].close()
        changed = np.argwhere(np.abs(pictures[0] - pictures[1]).max(axis=2) > 40)
        # ahead, as wide as 55 mm are 150 mm away: 21 degrees, 14 columns
        assert len(changed) > 50
        columns = changed[:, 1]
        assert columns.mean() == pytest.approx(119.5, abs=1)
        assert 10 < columns.max() - columns.min() < 18
        # the first is behind the second, at both ends of its panorama
        assert behind[21, 0].max() < 90 < behind[21, 60].max()

    def test_a_camera_sees_a_robot_that_has_moved(
        self, fleet: Callable[..., list[Emulator]]
    ) -> None:
        first, second = fleet(2, {"x": 0.15, "y": 0.0, "heading": 90.0})
        before = first.panorama().astype(int)
        ask(second, b"D,10,10")
        after(first, 1.5)
        changed = np.abs(first.panorama().astype(int) - before).max(axis=2) > 40
        columns = np.flatnonzero(changed.sum(axis=0) > 3)
        # 0.12 m to the left of where it was: 38 degrees, and where it was
        assert columns.min() == pytest.approx(119.5 - 26 - 5, abs=6)
        assert columns.max() == pytest.approx(119.5 + 7, abs=3)


class TestReset:
    def test_without_a_seed_concerns_one_robot(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(2, {"x": 0.3, "y": 0.0})
        for robot in (first, second):
            ask(robot, b"D,5,-5")
        after(first, 0.5)
        before = second.truth()
        truth = first.reset(Reset(pose=Pose(x=-0.2, y=0.1, heading=1.0)))
        assert truth.pose == Pose(x=-0.2, y=0.1, heading=1.0)
        assert second.truth() == before
        assert ask(second, b"K").startswith(b"k,0,1,")
        assert ask(first, b"H") == b"h,0,0\r\n"

    def test_a_place_that_another_has_taken_is_refused(
        self, fleet: Callable[..., list[Emulator]]
    ) -> None:
        first, second = fleet(2, {"x": 0.3, "y": 0.0})
        with pytest.raises(EmulatorError, match="no room"):
            first.reset(Reset(pose=Pose(x=0.26, y=0.01, heading=0.0)))
        with pytest.raises(EmulatorError, match="no room"):
            first.reset(Reset(pose=Pose(x=0.26, y=0.01, heading=0.0), seed=3))
        assert first.truth().pose.x == 0.0
        # where the first stands is no place for the second, its own is
        assert second.reset(Reset(pose=Pose(x=0.31, y=0.0, heading=0.0))).pose.x == 0.31

    def test_with_a_seed_concerns_all(self, fleet: Callable[..., list[Emulator]]) -> None:
        def run(robots: list[Emulator]) -> list[bytes | Pose]:
            seen: list[bytes | Pose] = []
            begin = robots[0].now
            for step in range(20):
                for robot, line in zip(robots, (b"D,9,7", b"D,5,8"), strict=True):
                    seen.append(ask(robot, [line, b"N", b"O", b"H"][step % 4]))
                robots[step % 2].advance(robots[0].now + 0.07)
                seen += [robot.truth().pose for robot in robots]
            seen.append(robots[1].panorama().tobytes())
            assert robots[0].now - begin == pytest.approx(1.4)
            return seen

        fresh, used = (fleet(2, *FACING, drift="default", seed=7) for _ in range(2))
        expected = run(fresh)
        assert any(robot.truth().touched for robot in fresh)
        run(used)
        used[1].write(b"D,9,")
        used[1].reset(Reset(seed=7))
        assert run(used) == expected
        assert used[0].reset(Reset(seed=8)).drift == fresh[0].truth().drift
        assert run(used) != expected

    def test_random_places_keep_off_the_others(self, fleet: Callable[..., list[Emulator]]) -> None:
        first, second = fleet(
            2, {"x": 0.1, "y": 0.0}, free={"points": [[-0.2, 0], [0.2, 0]], "half_width": 0.1}
        )
        for seed in [None] * 20 + [5, 6]:
            pose = first.reset(Reset(random=True, seed=seed)).pose
            other = second.truth().pose
            assert hypot(pose.x - other.x, pose.y - other.y) >= DIAMETER + 0.03


def test_eight_robots_in_the_corridor() -> None:
    robots = make_fleet(Setup(arena=load_arena("corridor"), seed=1, baud=None), 8)
    for robot in robots:
        ask(robot, b"D,8,7")
    after(robots[0], 5.0)
    at = places(robots)
    gaps = [hypot(a[0] - b[0], a[1] - b[1]) for k, a in enumerate(at) for b in at[:k]]
    assert min(gaps) > DIAMETER - 0.001
    assert sum(robot.truth().touched for robot in robots) >= 3
    assert all(-0.13 < x < 1.13 and -0.13 < y < 1.13 for x, y in at)
    assert len({robot.truth().drift.wheel_base for robot in robots}) == 8
    robots[0].close()
