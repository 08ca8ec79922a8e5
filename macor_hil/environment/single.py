"""One Khepera as a Gymnasium environment, over any serial port.

An episode begins with a seeded reset of the emulated robot, ends (terminated) with a collision as
the robot's own sensors tell it, and is cut (truncated) after 40 steps. On a physical robot (any
other port, with a camera of its own) it begins after backing off from where the last one ended.

A physical robot stands whenever `step` is not running, and after whatever ends a step: an error,
Ctrl-C, SIGTERM, SIGHUP. It is stopped when the environment is closed, forgotten, or the
interpreter ends.
"""

from contextlib import AbstractContextManager, ExitStack, nullcontext
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium import spaces
from khepera_protocol.zenoh.payloads import Reset
from numpy.typing import NDArray

from macor_hil.commands import COMMANDS, MotorCommand
from macor_hil.environment.terms import (
    Observation,
    Start,
    Views,
    WheelSpeeds,
    command_of,
    graded,
    one_of,
    pose_of,
    rgb,
)
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras import Frame
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver, DriveSettings, Outcome
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.runs.trials import Spread
from macor_hil.safety.watchdog import stopped_after

LONGEST_HOLD: Final = 0.5
"""Seconds beyond a step for which a physical robot may hold its wheel speeds."""


class KheperaEnv(gymnasium.Env[NDArray[Any], Any]):
    """A Khepera with a camera, driven step by step; the base of the registered environments.

    The info of `reset` and `step` holds `proximity` (eight readings, 0 far to 1023 near),
    `counters` (left and right), `time` (seconds on the robot's clock since the episode began) and,
    where an emulator tells it, the true `pose` (x and y in metres, heading in radians).

    Args:
        port: serial device or pySerial URL; `khepera://` is a robot in this process.
        camera: see `macor_hil.hardware.cameras`.
        observation: one of `Observation`.
        start: one of `Start`.
        fields: the receptive fields; none: untuned ones. A map holds tuned ones.
        reinforcement: what a step earns; none: the paper's.
        drive: how the robot is driven; none: as `macor-hil run` does.
        render_mode: `rgb_array` for the camera's picture, or None.

    Raises:
        MacorError: an argument is wrong, or port or camera cannot be used.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 5}

    def __init__(
        self,
        port: str = "khepera://corridor?seed=1",
        camera: str = "auto",
        observation: str = Observation.FIELDS,
        start: str = Start.RANDOM,
        fields: ReceptiveFields | None = None,
        reinforcement: Reinforcement | None = None,
        drive: DriveSettings | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.render_mode = render_mode
        self._views = Views(observation, fields)
        self._start = one_of(Start, start)
        self._reinforcement = reinforcement or Reinforcement()
        self._drive = drive or DriveSettings()
        self.observation_space = self._views.space
        with ExitStack() as stack:
            self._hardware = stack.enter_context(open_hardware(port, camera))
            self._hardware.robot.stop()
            self._stack = stack.pop_all()
        self._thinking_is_free = self._hardware.address.embedded
        self._driver = Driver(self._hardware.robot, self._drive)
        self._began = 0.0
        self._frame: Frame | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of all that follows by chance, in later episodes too.
            options: `pose` (x, y, heading; metres and radians) puts an emulated robot there.

        Raises:
            MacorError: the robot, its camera or its emulator fails, there is no such option, or
                the pose is not free or not inside the walls.
        """
        pose = pose_of(options)
        bench = self._hardware.bench
        if bench is None and pose is not None:
            raise MacorError("the option 'pose' needs an emulated robot: nobody carries this one")
        super().reset(seed=seed)
        if bench is None:
            self._driver.back_off(int(self.np_random.integers(3, 9)))
        else:
            chance = int(self.np_random.integers(2**31))
            if pose is not None:
                bench.reset(Reset(pose=pose, seed=chance))
            elif self._start is Start.ARENA:
                start = bench.reset(Reset(seed=chance)).pose
                bench.reset(Reset(pose=Spread().draw(start, self.np_random)))
            else:
                bench.reset(Reset(random=True, seed=chance))
        self._driver.start()
        robot = self._hardware.robot
        self._began = robot.clock()
        picture = self._picture()
        outcome = Outcome(False, robot.proximity(), robot.counters())
        return self._seen(picture, outcome), self._info(outcome)

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Drive one action; returns observation, reward, terminated, truncated and info.

        Raises:
            InvalidAction: the action is not in the action space; the robot does not move.
            MacorError: the robot or its camera fails.
        """
        command, outcome = self._act(action)
        reward = graded(self._reinforcement, command, outcome.collided)
        seen = self._seen(self._picture(), outcome)
        return seen, reward, outcome.collided, False, self._info(outcome)

    def render(self) -> Any:
        """Return the camera's last picture, red, green and blue, shape (160, 160, 3), or None."""
        if self.render_mode != "rgb_array":
            return None
        if self._frame is None:
            self._frame = self._hardware.camera.grab()
        return rgb(self._frame.image)

    def close(self) -> None:
        """Stop the robot and close port and camera; a second time does nothing."""
        self._stack.close()

    def _act(self, action: Any) -> tuple[MotorCommand, Outcome]:
        """Drive an action; return the command that it comes to, and how it went."""
        raise NotImplementedError

    def _picture(self) -> Frame | None:
        """Take a picture, where one is to be seen."""
        if self._views.pictures:
            self._frame = self._hardware.camera.grab()
        return self._frame

    def _seen(self, picture: Frame | None, outcome: Outcome) -> NDArray[Any]:
        if not self._views.pictures or picture is None:
            return np.array(outcome.proximity, np.float32)
        return self._views.of(picture.image)

    def _info(self, outcome: Outcome) -> dict[str, Any]:
        info: dict[str, Any] = {
            "proximity": outcome.proximity,
            "counters": outcome.counters,
            "time": self._hardware.robot.clock() - self._began,
        }
        if self._hardware.bench is not None:
            pose = self._hardware.bench.truth().pose
            info["pose"] = pose.x, pose.y, pose.heading
        return info


class CommandsEnv(KheperaEnv):
    """Actions are the paper's commands: 0 left, 1 right, 2 straight on; 21 mm each."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.action_space = spaces.Discrete(len(COMMANDS))

    def _act(self, action: Any) -> tuple[MotorCommand, Outcome]:
        command = COMMANDS[command_of(action)]
        return command, self._driver.execute(command)


class WheelsEnv(KheperaEnv):
    """Actions are wheel speeds, left and right, in m/s: two real numbers of any kind.

    A step ends with the first infrared reading after the time that a command of the paper takes at
    full speed. The wheels turn on from one step to the next, but for a physical robot: nobody
    knows how long its learner thinks, so it stands. Should anything keep a step from its end, a
    thread stops the robot (`LONGEST_HOLD`).
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self._wheels = WheelSpeeds(self._drive)
        self.action_space = self._wheels.space

    def _act(self, action: Any) -> tuple[MotorCommand, Outcome]:
        left, right = self._wheels.counts(action)
        alone = self._thinking_is_free
        limit = nullcontext() if alone else self._limit()
        with limit:
            outcome = self._driver.hold(left, right, self._wheels.period, roll_on=alone)
        return self._wheels.arc(left, right), outcome

    def _limit(self) -> AbstractContextManager[None]:
        return stopped_after(self._hardware.robot.port, self._wheels.period + LONGEST_HOLD)
