"""Gymnasium environments: the checker's contract, the seed, what steps earn, and a real port."""

import importlib
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import gymnasium
import numpy as np
import pytest
from as_type import as_type
from emulator_process import PATIENCE
from gymnasium.error import InvalidAction
from gymnasium.utils.env_checker import check_env
from khepera_protocol.system.compiled import is_installed
from rig import Rig, rig

from macor_hil.commands import COMMANDS, MotorCommand
from macor_hil.environment import LONGEST_HOLD, Observation, Start, graded
from macor_hil.errors import MacorError
from macor_hil.mind.reinforcement import Reinforcement

IDS = ("khepera/Commands-v0", "khepera/Wheels-v0")
EXAMPLE = Path(__file__).parent.parent / "examples" / "gymnasium_learner.py"
LEFT, RIGHT, STRAIGHT = range(3)


def make(name: str = IDS[0], **settings: Any) -> gymnasium.Env[Any, Any]:
    return gymnasium.make(name, **settings)


def itself(env: gymnasium.Env[Any, Any]) -> Any:
    """The environment without wrappers, and with all that it keeps."""
    return env.unwrapped


@pytest.fixture
def env() -> Iterator[gymnasium.Env[Any, Any]]:
    with make() as made:
        yield made


@pytest.mark.parametrize("observation", list(Observation))
@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_checker_has_nothing_to_say(name: str, observation: Observation) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with make(name, observation=observation) as env:
            check_env(env.unwrapped)


def rollout(name: str, seed: int, steps: int = 6) -> list[Any]:
    with make(name) as env:
        env.action_space.seed(seed)
        seen, _ = env.reset(seed=seed)
        told: list[Any] = [seen.tolist()]
        for _ in range(steps):
            seen, reward, terminated, _, info = env.step(env.action_space.sample())
            told.append((seen.tolist(), reward, terminated, info))
            if terminated:
                seen, info = env.reset()
                told.append((seen.tolist(), info))
    return told


@pytest.mark.parametrize("name", IDS)
def test_the_seed_decides_everything(name: str) -> None:
    assert rollout(name, 4) == rollout(name, 4)
    assert rollout(name, 4) != rollout(name, 5)


def test_episodes_differ_until_the_seed_is_given_again(env: gymnasium.Env[Any, Any]) -> None:
    first = env.reset(seed=1)[1]["pose"]
    assert env.reset()[1]["pose"] != first
    assert env.reset(seed=1)[1]["pose"] == first


def test_a_pose_can_be_asked_for(env: gymnasium.Env[Any, Any]) -> None:
    _, info = env.reset(seed=1, options={"pose": (0.3, 0.0, 1.0)})
    assert info["pose"] == pytest.approx((0.3, 0.0, 1.0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"place": (0.3, 0.0, 1.0)}, "no option 'place'; there is 'pose'"),
        ({"pose": (0.3, 0.0, 1.0), "seed": 1}, "no option 'seed'"),
        ({3: 4}, "no option 3"),
        ([("pose", (0.3, 0.0, 1.0))], "are a dictionary"),
        ({"pose": (0.3, 0.0)}, r"the pose \(0.3, 0.0\) is not x, y and heading"),
        ({"pose": (0.3, 0.0, "1")}, "is not x, y and heading"),
        ({"pose": 0.3}, "the pose 0.3 is not x, y and heading"),
        ({"pose": (0.3, 0.0, np.nan)}, "is not x, y and heading"),
        ({"pose": (10**400, 0.0, 0.0)}, "is not x, y and heading"),
        ({"pose": (1e308, 0.0, 0.0)}, "x="),
        ({"pose": (11.0, 0.0, 0.0)}, "x=11 m, y=0 m is in no arena"),
        ({"pose": (0.3, 0.0, 7.0)}, "the heading 7 is not an angle"),
        ({"pose": (0.3, 0.12, 0.0)}, "no room for the robot at x=0.300 m, y=0.120 m"),
        ({"pose": (0.3, 0.6, 0.0)}, "x=0.300 m, y=0.600 m is outside the walls of the arena"),
    ],
)
def test_wrong_options_are_refused_and_change_nothing(
    env: gymnasium.Env[Any, Any], options: dict[str, int | tuple[float, float, float]], message: str
) -> None:
    if options == {"pose": (1e308, 0.0, 0.0)}:
        message = "x=|is not x, y and heading"  # by whoever sees it first
    env.reset(seed=1, options={"pose": (0.3, 0.0, 1.0)})
    before = itself(env)._hardware.bench.truth()
    with pytest.raises(MacorError, match=message) as caught:
        env.unwrapped.reset(seed=2, options=options)
    assert str(caught.value).isprintable()
    assert itself(env)._hardware.bench.truth() == before


def test_no_options_are_as_good_as_none(env: gymnasium.Env[Any, Any]) -> None:
    for options in (None, {}, {"pose": None}):
        env.reset(seed=1, options=options)
    _, info = env.reset(seed=1, options={"pose": np.array([0.3, 0.0, 1.0], np.float32)})
    assert info["pose"] == pytest.approx((0.3, 0.0, 1.0))


@pytest.mark.parametrize(
    "action", [-1, 3, 1.0, np.nan, None, "0", [0], np.array([1]), np.array(1.0), 10**30]
)
def test_a_command_that_is_none_is_refused(
    env: gymnasium.Env[Any, Any], action: float | list[int] | str | None
) -> None:
    env.reset(seed=1)
    before = itself(env)._hardware.bench.truth()
    with pytest.raises(InvalidAction, match=r"the action .* is none of 0 \(left\)"):
        env.unwrapped.step(action)
    assert itself(env)._hardware.bench.truth() == before
    for good in (0, np.int64(1), np.array(2)):
        env.step(good)


@pytest.mark.parametrize(
    "action",
    [
        [np.nan, 0.0],
        [np.inf, 0.0],
        [0.0, -0.161],
        [0.0, 1e308],
        [0.1],
        [0.1, 0.1, 0.1],
        [[0.1, 0.1]],
        [0.1, [0.1]],
        0.1,
        None,
        ["0.1", "0.1"],
        [0.1, None],
        [0.1j, 0.0],
        [True, False],
        np.array([10**20, 0]),
        "stop\x1b[2J",
    ],
)
def test_wheel_speeds_outside_the_space_are_refused(action: float | list[Any] | str | None) -> None:
    with make(IDS[1]) as env:
        env.reset(seed=1)
        before = itself(env)._hardware.bench.truth()
        with pytest.raises(InvalidAction, match=r"not two speeds from -0\.16 to 0\.16") as caught:
            env.unwrapped.step(action)
        assert str(caught.value).isprintable()
        assert itself(env)._hardware.bench.truth() == before


@pytest.mark.parametrize("kind", [list, tuple, np.float64, np.float32, np.float16])
def test_wheel_speeds_of_any_real_type_are_driven(kind: Any) -> None:
    speeds = [0.12, -0.08]
    action = kind(speeds) if kind in (list, tuple) else np.array(speeds, kind)
    with make(IDS[1]) as env, warnings.catch_warnings():
        warnings.simplefilter("error")
        env.reset(seed=1)
        env.unwrapped.step(action)
        left, right = itself(env)._hardware.robot.request("E").values
    assert left == pytest.approx(15, abs=1)
    assert right == pytest.approx(-10, abs=1)


def test_starts_near_the_arenas_own_are_near_each_other() -> None:
    with make(start=Start.ARENA) as env:
        poses = np.array([env.reset(seed=seed)[1]["pose"] for seed in range(5)])
    spread = poses.max(axis=0) - poses.min(axis=0)
    assert np.all(spread > 0)
    assert np.hypot(*spread[:2]) < 0.05


def test_commands_turn_and_earn_as_in_the_paper(env: gymnasium.Env[Any, Any]) -> None:
    for command, turn, earned in ((LEFT, 12, 0.54), (RIGHT, -12, 0.54), (STRAIGHT, 0, 0.62)):
        _, before = env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        _, reward, terminated, truncated, info = env.step(command)
        assert np.degrees(info["pose"][2] - before["pose"][2]) == pytest.approx(turn, abs=1.5)
        assert reward == pytest.approx(earned)
        assert not terminated
        assert not truncated


def test_a_collision_ends_the_episode_and_earns_nothing(env: gymnasium.Env[Any, Any]) -> None:
    env.reset(seed=1, options={"pose": (0.3, 0.0, np.pi / 2)})
    earned = []
    for _ in range(10):
        _, reward, terminated, _, _ = env.step(STRAIGHT)
        earned.append(reward)
        if terminated:
            break
    assert terminated
    assert earned == pytest.approx([0.62] * (len(earned) - 1) + [0.0])


def test_forty_steps_are_an_episode() -> None:
    with make("khepera/Wheels-v0") as env:
        env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(40)]
    assert ends == [(False, False)] * 39 + [(False, True)]


def test_wheels_drive_at_the_speeds_asked_for() -> None:
    with make("khepera/Wheels-v0", port="khepera://corridor?seed=1&drift=none") as env:
        _, before = env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        infos = [env.step(np.array([0.048, 0.08], np.float32))[4] for _ in range(4)]
    last, end = infos[-2:]
    seconds = end["time"] - last["time"]
    ways = np.subtract(end["counters"], last["counters"]) * 0.08e-3
    assert ways / seconds == pytest.approx([0.048, 0.08], rel=0.05)
    assert end["pose"][2] > before["pose"][2]


def test_any_arc_earns_between_the_papers_values() -> None:
    earns = Reinforcement()
    assert [graded(earns, command, False) for command in COMMANDS] == [
        earns(command, False) for command in COMMANDS
    ]
    half_turn = MotorCommand("half", COMMANDS[LEFT].turn / 2)
    assert graded(earns, half_turn, False) == pytest.approx((earns.straight + earns.turn) / 2)
    assert graded(earns, MotorCommand("stand", 0.0, way=0.0), False) == 0.0
    assert graded(earns, MotorCommand("back", 0.0, way=-0.02), False) == 0.0
    assert graded(earns, COMMANDS[STRAIGHT], True) == earns.collision


def test_the_picture_of_the_camera_is_rendered_in_red_green_and_blue() -> None:
    with make(observation="mirror", render_mode="rgb_array") as env:
        seen, _ = env.reset(seed=1)
        camera = itself(env)._frame.image
        assert np.array_equal(as_type(np.ndarray, env.render()), seen)
        assert np.array_equal(seen, camera[:, :, ::-1])


def test_many_robots_learn_at_once() -> None:
    envs = gymnasium.make_vec(IDS[0], num_envs=2, vectorization_mode="sync")
    try:
        seen, _ = envs.reset(seed=[1, 2])  # type: ignore[arg-type]
        assert seen.shape == (2, 36)
        assert not np.array_equal(seen[0], seen[1])
    finally:
        envs.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"observation": "smell"}, "no observation 'smell'; there are fields, panorama, mirror"),
        ({"start": "moon"}, "no start 'moon'; there are random, arena"),
        ({"port": "khepera://nowhere"}, "nowhere"),
    ],
)
def test_wrong_settings_are_named(settings: dict[str, str], message: str) -> None:
    with pytest.raises(MacorError, match=message):
        make(**settings)


def test_the_robot_stands_when_the_environment_is_closed() -> None:
    env = make("khepera/Wheels-v0")
    env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
    env.step(np.full(2, 0.16, np.float32))
    emulator = itself(env)._hardware.robot.port.emulator
    at_the_end = []

    def close(switch_off: Callable[..., Any] = emulator.close) -> None:
        emulator.advance(emulator.now + 1.0)
        at_the_end.append(max(map(abs, emulator.truth().speed)))
        switch_off()

    emulator.close = close
    env.close()
    assert at_the_end == pytest.approx([0.0], abs=1e-3)


A_LEARNER = """
import os, signal, sys, threading, time
import gymnasium, numpy as np
from macor_hil.hardware.khepera import Khepera
env = gymnasium.make(
    "macor_hil.environment:khepera/Wheels-v0", port=sys.argv[1], camera=f"images:{{sys.argv[2]}}"
)
env.reset(seed=1)
spin = np.array([-0.16, 0.16], np.float32)
looks = Khepera.proximity
def trouble(what):
    # in the middle of the third step
    times = iter(range(10**6))
    def look(robot):
        if next(times) == 8:
            print("trouble", flush=True)
            what()
        return looks(robot)
    Khepera.proximity = look
def kill(number):
    return lambda: (os.kill(os.getpid(), number), time.sleep(60))
{}
while True:
    env.step(spin)
"""
"""A program of somebody's own that holds wheel speeds, without any care for its end."""

ENDINGS = {
    "an exception": "trouble(lambda: 1 / 0)",
    "an exit": "trouble(sys.exit)",
    "Ctrl-C": "trouble(kill(signal.SIGINT))",
    "SIGTERM": "trouble(kill(signal.SIGTERM))",
    "a closed terminal": "trouble(kill(signal.SIGHUP))",
    "a cell of a notebook that was interrupted": (
        "trouble(kill(signal.SIGINT))\n"
        "try:\n"
        "    while True: env.step(spin)\n"
        "except KeyboardInterrupt: time.sleep(60)"
    ),
    "a cell of a notebook that failed": (
        "trouble(lambda: 1 / 0)\n"
        "try:\n"
        "    while True: env.step(spin)\n"
        "except ZeroDivisionError: time.sleep(60)"
    ),
    "forgetting": "env.step(spin); print('trouble', flush=True); del env; time.sleep(60)",
    "thinking": "env.step(spin); print('trouble', flush=True); time.sleep(60)",
}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of pictures, as many as steps are ever driven."""
    folder = tmp_path_factory.mktemp("pictures")
    with make(observation="mirror") as env:
        seen, _ = env.reset(seed=1)
    for number in range(40):
        cv2.imwrite(str(folder / f"{number:03}.png"), seen)
    return folder


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with rig(tmp_path_factory.mktemp("bench"), relay=False, baud=9600) as running:
        yield running


def learns_until(bench: Rig, pictures: Path, trouble: str) -> None:
    bench.make_ready()
    script = A_LEARNER.format(trouble)
    learner = bench.start([sys.executable, "-c", script, str(bench.link), str(pictures)])
    learner.wait_for(lambda lines: "trouble" in lines)


@pytest.mark.wall_clock
@pytest.mark.parametrize("trouble", ENDINGS.values(), ids=ENDINGS)
def test_a_robot_stands_whatever_ends_a_step(bench: Rig, pictures: Path, trouble: str) -> None:
    assert bench.stops_within(0.5, lambda: learns_until(bench, pictures, trouble))


@pytest.mark.wall_clock
def test_a_step_that_never_ends_does_not_hold_the_wheels_speeds(bench: Rig, pictures: Path) -> None:
    stuck = "trouble(lambda: time.sleep(60))"
    period = 0.13
    limit = period + LONGEST_HOLD + 0.5
    assert bench.stops_within(limit, lambda: learns_until(bench, pictures, stuck))


@pytest.mark.wall_clock
def test_a_step_that_was_kept_from_its_end_goes_on(bench: Rig, pictures: Path) -> None:
    late = "trouble(lambda: time.sleep(1.0)); [env.step(spin) for _ in range(5)]; print('done')"
    bench.make_ready()
    script = A_LEARNER.format(late + "; sys.exit(0)")
    learner = bench.start([sys.executable, "-c", script, str(bench.link), str(pictures)])
    assert learner.end() == "done"


def test_the_example_trains_and_scores_a_learner() -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLE, "--experience", "60", "--trials", "1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert done.stdout.startswith("1 trials: ")
    assert "reinforcement" in done.stdout


needs_numba = pytest.mark.skipif(not is_installed(), reason="Numba is not installed")


def make_many(name: str, mode: str | None = None, count: int = 3, **settings: Any) -> Any:
    made: Any = gymnasium.make_vec(name, num_envs=count, vectorization_mode=mode, **settings)
    return closing(made)


@pytest.mark.long
@needs_numba
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        (IDS[0], {"observation": "fields"}),
        (IDS[0], {"observation": "proximity", "start": "arena", "port": "khepera://maze?seed=2"}),
        (IDS[1], {"observation": "mirror", "port": "khepera://corridor?drift=strong&baud=unpaced"}),
    ],
)
def test_many_are_what_each_is_alone(name: str, settings: Any) -> None:
    with make_many(name, **settings) as many, make_many(name, "sync", **settings) as alone:
        assert type(many.unwrapped).__name__.endswith("VectorEnv")
        for space in ("observation_space", "action_space", "single_observation_space"):
            assert getattr(many, space) == getattr(alone, space)
        many.action_space.seed(1)
        told = [(many.reset(seed=7), alone.reset(seed=7))]
        ended = 0
        for _ in range(45):
            actions = many.action_space.sample()
            told.append((many.step(actions), alone.step(actions)))
            ended += int((told[-1][0][2] | told[-1][0][3]).sum())
        assert ended >= 3  # so that episodes have begun anew
        for together, one_by_one in told:
            for own, other in zip(together[:-1], one_by_one[:-1], strict=True):
                assert own.dtype == other.dtype
                assert np.array_equal(own, other)
            for key in ("proximity", "counters", "time", "pose"):
                assert np.array_equal(together[-1][key], np.array(one_by_one[-1][key].tolist()))


@pytest.mark.long
@needs_numba
def test_many_take_seeds_and_a_mask_as_gymnasium_has_it() -> None:
    with make_many(IDS[0], observation="proximity") as many:
        first, _ = many.reset(seed=[5, 9, 5])
        assert np.array_equal(first[0], first[2])
        assert not np.array_equal(first[0], first[1])
        many.step(np.array([2, 2, 2]))
        before = itself(many)._robots.poses
        many.reset(options={"reset_mask": np.array([False, True, False])})
        moved = (itself(many)._robots.poses != before).any(axis=1)
        assert moved.tolist() == [False, True, False]
        with pytest.raises(MacorError, match="2 seeds for 3 robots"):
            many.reset(seed=[1, 2])


@pytest.mark.long
@needs_numba
def test_a_reset_of_many_is_that_of_each_alone() -> None:
    with make_many(IDS[0]) as many, make_many(IDS[0], "sync") as alone:
        straight, ended = np.full(3, STRAIGHT), np.zeros(3, np.bool_)
        many.reset(seed=7)
        alone.reset(seed=7)
        while not ended.any():
            _, _, *ends, _ = many.step(straight)
            alone.step(straight)
            ended = ends[0] | ends[1]
        # all at once, when some would have begun anew in the next step; then one of them
        for mask in (None, np.array([False, True, False])):
            options = {} if mask is None else {"reset_mask": mask}
            told = [(many.reset(options=dict(options)), alone.reset(options=dict(options)))]
            told += [(many.step(straight), alone.step(straight)) for _ in range(2)]
            for together, one_by_one in told:
                assert np.array_equal(together[0], one_by_one[0])
            assert np.array_equal(together[-1]["counters"], np.stack(one_by_one[-1]["counters"]))


@pytest.mark.long
@needs_numba
@pytest.mark.parametrize(
    ("name", "actions"),
    [
        (IDS[0], [0, 1]),
        (IDS[0], [0, 1, 3]),
        (IDS[1], [[0.1, 0.1]] * 2),
        (IDS[1], [[0.1, 0.1], [0.1, 0.2], [np.nan, 0.0]]),
        (IDS[1], "fast"),
        (IDS[1], [["0.1", "0.1"]] * 3),
        (IDS[1], [[True, False]] * 3),
    ],
)
def test_many_refuse_what_is_no_action_and_stand(name: str, actions: Any) -> None:
    with make_many(name, observation="proximity") as many:
        many.reset(seed=1)
        before = itself(many)._robots.poses
        with pytest.raises(InvalidAction):
            itself(many).step(actions)
        assert np.array_equal(itself(many)._robots.poses, before)


@pytest.mark.parametrize(
    ("port", "said"),
    [
        ("khepera://corridor?turret=gripper", "cannot have turrets"),
        ("khepera://toys", "cannot have things to push"),
        ("khepera://corridor?fault=drop:p=0.1&baud=1200", "faults and a slow line"),
        ("khepera://nowhere", "nowhere"),
    ],
)
def test_many_that_cannot_be_are_told_in_a_sentence(port: str, said: str) -> None:
    message = said if is_installed() else "need Numba"
    with pytest.raises(MacorError, match=message):
        make_many(IDS[0], port=port)


def test_many_share_no_world() -> None:
    with pytest.raises(MacorError, match="each alone"):
        make_many(IDS[0], port="khepera://corridor?robots=2")


@pytest.mark.long
@needs_numba
def test_the_example_with_many_robots_learns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(EXAMPLE.parent)
    train = importlib.import_module("many_robots").train
    curve = train(robots=64, updates=8, seed=1)
    assert np.mean(curve[-3:]) > np.mean(curve[:3]) + 0.01
