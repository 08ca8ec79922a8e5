"""Gymnasium environments over a Khepera's serial port: any learner can be set beside MACOR.

Importing this module registers two ids with Gymnasium, and does nothing else:

    khepera/Commands-v0   Discrete(3): the paper's commands, left, right and straight on
    khepera/Wheels-v0     Box(2): speeds of the left and the right wheel, m/s

    gymnasium.make("macor_hil.environment:khepera/Commands-v0", port="khepera://corridor?seed=1")

An episode begins with a seeded reset of the emulated robot, ends (terminated) with a collision as
the robot's own sensors tell it, and is cut (truncated) after 40 steps. On a physical robot (any
other port, with a camera of its own) it begins after backing off from where the last one ended.

A physical robot stands whenever `step` is not running, and after whatever ends a step: an error,
Ctrl-C, SIGTERM, SIGHUP. It is stopped when the environment is closed, forgotten, or the
interpreter ends.
"""

from contextlib import AbstractContextManager, ExitStack, nullcontext
from enum import StrEnum
from numbers import Real
from typing import Any, Final, TypeVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from khepera_protocol.mirror import Mirror
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import Pose, Reset
from numpy.typing import NDArray

from macor_hil.commands import COMMANDS, LEFT, STRAIGHT, MotorCommand
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras import Frame
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver, DriveSettings, Outcome
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.runs.trials import MAX_COMMANDS, Spread
from macor_hil.safety.watchdog import stopped_after

LONGEST_HOLD: Final = 0.5
"""Seconds beyond a step for which a physical robot may hold its wheel speeds."""

_SHOWN: Final = 60
"""Characters of a value that an error shows."""

_E = TypeVar("_E", bound=StrEnum)


class Observation(StrEnum):
    """Kinds of observations."""

    FIELDS = "fields"
    """Mean colours of the receptive fields, in [0, 1]: shape (sectors * 3,), float32."""
    PANORAMA = "panorama"
    """The unwrapped picture, red, green and blue: shape (32, 120, 3), uint8."""
    MIRROR = "mirror"
    """The camera's picture, red, green and blue: shape (160, 160, 3), uint8."""


class Start(StrEnum):
    """Places where an emulated robot is put at the begin of an episode."""

    RANDOM = "random"
    """A free place, as in the paper's training."""
    ARENA = "arena"
    """Near the arena's own start, as in `macor-hil trials`."""


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
        self._observation = _one_of(Observation, observation)
        self._start = _one_of(Start, start)
        self._fields = fields or ReceptiveFields()
        self._reinforcement = reinforcement or Reinforcement()
        self._drive = drive or DriveSettings()
        self._mirror = Mirror()
        self._unwrap = Unwrapper(self._mirror, PanoramaSize())
        self.observation_space = self._space()
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
        pose = _pose_of(options)
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
        return self._look(), self._info(Outcome(False, robot.proximity(), robot.counters()))

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Drive one action; returns observation, reward, terminated, truncated and info.

        Raises:
            InvalidAction: the action is not in the action space; the robot does not move.
            MacorError: the robot or its camera fails.
        """
        command, outcome = self._act(action)
        reward = graded(self._reinforcement, command, outcome.collided)
        return self._look(), reward, outcome.collided, False, self._info(outcome)

    def render(self) -> Any:
        """Return the camera's last picture, red, green and blue, shape (160, 160, 3), or None."""
        if self.render_mode != "rgb_array":
            return None
        if self._frame is None:
            self._frame = self._hardware.camera.grab()
        return _rgb(self._frame.image)

    def close(self) -> None:
        """Stop the robot and close port and camera; a second time does nothing."""
        self._stack.close()

    def _act(self, action: Any) -> tuple[MotorCommand, Outcome]:
        """Drive an action; return the command that it comes to, and how it went."""
        raise NotImplementedError

    def _space(self) -> spaces.Box:
        if self._observation is Observation.FIELDS:
            return spaces.Box(0.0, 1.0, (self._fields.size,), np.float32)
        size = PanoramaSize()
        mirror = self._mirror.height, self._mirror.width
        shape = mirror if self._observation is Observation.MIRROR else (size.rows, size.columns)
        return spaces.Box(0, 255, (*shape, 3), np.uint8)

    def _look(self) -> NDArray[Any]:
        self._frame = self._hardware.camera.grab()
        if self._observation is Observation.MIRROR:
            return _rgb(self._frame.image)
        panorama = self._unwrap(self._frame.image)
        if self._observation is Observation.PANORAMA:
            return _rgb(panorama)
        return self._fields(panorama).astype(np.float32)

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
        if not self.action_space.contains(action):
            raise InvalidAction(
                f"the action {_shown(action)} is none of 0 (left), 1 (right) and 2 (straight on)"
            )
        command = COMMANDS[int(action)]
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
        self._unit = self._drive.wheels.left / 0.010  # m/s of one count / 10 ms
        top = np.float32(self._drive.speed * self._unit)
        self._top = float(top)
        self._period = STRAIGHT.way / self._top
        self.action_space = spaces.Box(-top, top, (2,), np.float32)

    def _act(self, action: Any) -> tuple[MotorCommand, Outcome]:
        left, right = (round(float(v) / self._unit) for v in self._speeds(action))
        alone = self._thinking_is_free
        limit = nullcontext() if alone else self._limit()
        with limit:
            outcome = self._driver.hold(left, right, self._period, roll_on=alone)
        left_way, right_way = (speed * self._unit * self._period for speed in (left, right))
        command = MotorCommand(
            "wheels",
            turn=(right_way - left_way) / self._drive.wheels.base,
            way=(left_way + right_way) / 2,
        )
        return command, outcome

    def _limit(self) -> AbstractContextManager[None]:
        return stopped_after(self._hardware.robot.port, self._period + LONGEST_HOLD)

    def _speeds(self, action: Any) -> NDArray[np.float32]:
        """Return the speeds of an action, which need not be of the space's own type of number."""
        try:
            given = np.asarray(action)
        except (TypeError, ValueError):  # such as lists of several lengths
            given = np.array(None)
        if given.dtype.kind in "iuf":
            with np.errstate(over="ignore"):  # infinity is out of bounds as well
                speeds = given.astype(np.float32)
            if self.action_space.contains(speeds):
                return speeds
        top = f"{self._top:g}"
        raise InvalidAction(
            f"the action {_shown(action)} is not two speeds from -{top} to {top} m/s"
        )


def graded(reinforcement: Reinforcement, command: MotorCommand, collided: bool) -> float:
    """Return what any arc earns: the paper's reinforcement at its three commands, else between.

    From straight on to a turn of 12 degrees it falls linearly, and it grows with the way, up to a
    command's 21 mm: who stands still or drives back earns nothing.
    """
    if collided:
        return reinforcement.collision
    turning = min(1.0, abs(command.turn / LEFT.turn))
    way = min(1.0, max(0.0, command.way / STRAIGHT.way))
    return way * (reinforcement.straight + turning * (reinforcement.turn - reinforcement.straight))


def _one_of(kind: type[_E], name: str) -> _E:
    try:
        return kind(name)
    except ValueError:
        raise MacorError(
            f"there is no {kind.__name__.lower()} {name!r}; there are {', '.join(kind)}"
        ) from None


def _pose_of(options: dict[str, Any] | None) -> Pose | None:
    """Return the pose that the options of a reset ask for."""
    if options is not None and not isinstance(options, dict):
        raise MacorError(f"the options of a reset are a dictionary, not {_shown(options)}")
    for name in options or {}:
        if name != "pose":
            raise MacorError(f"a reset has no option {_shown(name)}; there is 'pose'")
    given = (options or {}).get("pose")
    if given is None:
        return None
    try:
        x, y, heading = given
        if not all(isinstance(value, Real) for value in (x, y, heading)):
            raise ValueError
        return Pose(x=float(x), y=float(y), heading=float(heading))
    except (TypeError, ValueError, OverflowError):
        raise MacorError(
            f"the pose {_shown(given)} is not x, y and heading, in metres and radians"
        ) from None


def _shown(value: object) -> str:
    return printable(repr(value), _SHOWN)


def _rgb(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture in OpenCV's order of channels, turned to Gymnasium's."""
    return np.ascontiguousarray(image[..., ::-1])


for _name, _kind in (("Commands", CommandsEnv), ("Wheels", WheelsEnv)):
    gymnasium.register(
        f"khepera/{_name}-v0",
        entry_point=f"{_kind.__module__}:{_kind.__name__}",
        max_episode_steps=MAX_COMMANDS,
    )
