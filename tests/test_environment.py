"""Gymnasium environments: the checker's contract, the seed, what steps earn, and a real port."""

import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from emulator_process import PATIENCE
from gymnasium.utils.env_checker import check_env

from macor_hil.commands import COMMANDS, MotorCommand
from macor_hil.environment import Observation, Start, graded
from macor_hil.errors import MacorError
from macor_hil.mind.reinforcement import Reinforcement

IDS = ("khepera/Commands-v0", "khepera/Wheels-v0")
EXAMPLE = Path(__file__).parent.parent / "examples" / "gymnasium_learner.py"
LEFT, RIGHT, STRAIGHT = range(3)


def make(name=IDS[0], **settings):
    return gymnasium.make(name, **settings)


@pytest.fixture
def env():
    with make() as made:
        yield made


@pytest.mark.parametrize("observation", list(Observation))
@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_checker_has_nothing_to_say(name, observation):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with make(name, observation=observation) as env:
            check_env(env.unwrapped)


def rollout(name, seed, steps=6):
    with make(name) as env:
        env.action_space.seed(seed)
        seen, _ = env.reset(seed=seed)
        told = [seen.tolist()]
        for _ in range(steps):
            seen, reward, terminated, _, info = env.step(env.action_space.sample())
            told.append((seen.tolist(), reward, terminated, info))
            if terminated:
                seen, info = env.reset()
                told.append((seen.tolist(), info))
        return told


@pytest.mark.parametrize("name", IDS)
def test_the_seed_decides_everything(name):
    assert rollout(name, 4) == rollout(name, 4)
    assert rollout(name, 4) != rollout(name, 5)


def test_episodes_differ_until_the_seed_is_given_again(env):
    first = env.reset(seed=1)[1]["pose"]
    assert env.reset()[1]["pose"] != first
    assert env.reset(seed=1)[1]["pose"] == first


def test_a_pose_can_be_asked_for(env):
    _, info = env.reset(seed=1, options={"pose": (0.3, 0.0, 1.0)})
    assert info["pose"] == pytest.approx((0.3, 0.0, 1.0))


def test_starts_near_the_arenas_own_are_near_each_other():
    with make(start=Start.ARENA) as env:
        poses = np.array([env.reset(seed=seed)[1]["pose"] for seed in range(5)])
    spread = poses.max(axis=0) - poses.min(axis=0)
    assert np.all(spread > 0)
    assert np.hypot(*spread[:2]) < 0.05


def test_commands_turn_and_earn_as_in_the_paper(env):
    for command, turn, earned in ((LEFT, 12, 0.54), (RIGHT, -12, 0.54), (STRAIGHT, 0, 0.62)):
        _, before = env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        _, reward, terminated, truncated, info = env.step(command)
        assert np.degrees(info["pose"][2] - before["pose"][2]) == pytest.approx(turn, abs=1.5)
        assert reward == pytest.approx(earned)
        assert not terminated
        assert not truncated


def test_a_collision_ends_the_episode_and_earns_nothing(env):
    env.reset(seed=1, options={"pose": (0.3, 0.0, np.pi / 2)})
    earned = []
    for _ in range(10):
        _, reward, terminated, _, _ = env.step(STRAIGHT)
        earned.append(reward)
        if terminated:
            break
    assert terminated
    assert earned == pytest.approx([0.62] * (len(earned) - 1) + [0.0])


def test_forty_steps_are_an_episode():
    with make("khepera/Wheels-v0") as env:
        env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        ends = [env.step(np.zeros(2, np.float32))[2:4] for _ in range(40)]
    assert ends == [(False, False)] * 39 + [(False, True)]


def test_wheels_drive_at_the_speeds_asked_for():
    with make("khepera/Wheels-v0", port="khepera://corridor?seed=1&drift=none") as env:
        _, before = env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
        infos = [env.step(np.array([0.048, 0.08], np.float32))[4] for _ in range(4)]
    last, end = infos[-2:]
    seconds = end["time"] - last["time"]
    ways = np.subtract(end["counters"], last["counters"]) * 0.08e-3
    assert ways / seconds == pytest.approx([0.048, 0.08], rel=0.05)
    assert end["pose"][2] > before["pose"][2]


def test_any_arc_earns_between_the_papers_values():
    earns = Reinforcement()
    assert [graded(earns, command, False) for command in COMMANDS] == [
        earns(command, False) for command in COMMANDS
    ]
    half_turn = MotorCommand("half", COMMANDS[LEFT].turn / 2)
    assert graded(earns, half_turn, False) == pytest.approx((earns.straight + earns.turn) / 2)
    assert graded(earns, MotorCommand("stand", 0.0, way=0.0), False) == 0.0
    assert graded(earns, MotorCommand("back", 0.0, way=-0.02), False) == 0.0
    assert graded(earns, COMMANDS[STRAIGHT], True) == earns.collision


def test_the_picture_of_the_camera_is_rendered_in_red_green_and_blue():
    with make(observation="mirror", render_mode="rgb_array") as env:
        seen, _ = env.reset(seed=1)
        camera = env.unwrapped._frame.image
        assert np.array_equal(env.render(), seen)
        assert np.array_equal(seen, camera[:, :, ::-1])


def test_many_robots_learn_at_once():
    envs = gymnasium.make_vec(IDS[0], num_envs=2, vectorization_mode="sync")
    try:
        seen, _ = envs.reset(seed=[1, 2])
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
def test_wrong_settings_are_named(settings, message):
    with pytest.raises(MacorError, match=message):
        make(**settings)


def test_the_robot_stands_when_the_environment_is_closed():
    env = make("khepera/Wheels-v0")
    env.reset(seed=1, options={"pose": (0.3, 0.0, 0.0)})
    env.step(np.full(2, 0.16, np.float32))
    emulator = env.unwrapped._hardware.robot.port.emulator
    at_the_end = []

    def close(switch_off=emulator.close):
        emulator.advance(emulator.now + 1.0)
        at_the_end.append(max(map(abs, emulator.truth().speed)))
        switch_off()

    emulator.close = close
    env.close()
    assert at_the_end == pytest.approx([0.0], abs=1e-3)


def test_the_example_trains_and_scores_a_learner():
    done = subprocess.run(
        [sys.executable, EXAMPLE, "--experience", "60", "--trials", "1"],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert done.stdout.startswith("1 trials: ")
    assert "reinforcement" in done.stdout
