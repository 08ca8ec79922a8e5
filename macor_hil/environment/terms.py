"""Terms that environments of one robot and of many have in common."""

from enum import StrEnum
from numbers import Real
from typing import Any, Final, TypeVar

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from khepera_protocol.mirror import Mirror
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import Pose
from numpy.typing import NDArray

from macor_hil.arrays import Array
from macor_hil.commands import COMMANDS, LEFT, STRAIGHT, MotorCommand
from macor_hil.errors import MacorError
from macor_hil.hardware.driver import DriveSettings
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.eyes.unwrap import PanoramaSize, Unwrapper
from macor_hil.mind.reinforcement import Reinforcement

_SHOWN: Final = 60
"""Characters of a value that an error shows."""

_HIGHEST: Final = 1023
"""Greatest reading of a sensor."""

_E = TypeVar("_E", bound=StrEnum)


class Observation(StrEnum):
    """Kinds of observations."""

    FIELDS = "fields"
    """Mean colours of the receptive fields, in [0, 1]: shape (sectors * 3,), float32."""
    PANORAMA = "panorama"
    """The unwrapped picture, red, green and blue: shape (32, 120, 3), uint8."""
    MIRROR = "mirror"
    """The camera's picture, red, green and blue: shape (160, 160, 3), uint8."""
    PROXIMITY = "proximity"
    """The proximity sensors, 0 far to 1023 near: shape (8,), float32; no picture is taken."""


class Start(StrEnum):
    """Places where an emulated robot is put at the begin of an episode."""

    RANDOM = "random"
    """A free place, as in the paper's training."""
    ARENA = "arena"
    """Near the arena's own start, as in `macor-hil trials`."""


class Views:
    """Observations of a kind, made of pictures.

    Args:
        kind: name of one of `Observation`.
        fields: the receptive fields; None: untuned ones.

    Attributes:
        pictures: whether pictures are what is observed.
        space: of the observations.

    Raises:
        MacorError: there is no such kind.
    """

    def __init__(self, kind: str, fields: ReceptiveFields | None) -> None:
        self._kind = one_of(Observation, kind)
        self._fields = fields or ReceptiveFields()
        mirror = Mirror()
        self._unwrap = Unwrapper(mirror, PanoramaSize())
        self.pictures = self._kind is not Observation.PROXIMITY
        self.space = _space_of(self._kind, self._fields, mirror)

    def of(self, image: NDArray[np.uint8]) -> NDArray[Any]:
        """Return what is observed in a picture of the mirror."""
        if self._kind is Observation.MIRROR:
            return rgb(image)
        panorama = self._unwrap(image)
        if self._kind is Observation.PANORAMA:
            return rgb(panorama)
        return self._fields(panorama).astype(np.float32)


def _space_of(kind: Observation, fields: ReceptiveFields, mirror: Mirror) -> spaces.Box:
    if kind is Observation.FIELDS:
        return spaces.Box(0.0, 1.0, (fields.size,), np.float32)
    if kind is Observation.PROXIMITY:
        return spaces.Box(0.0, float(_HIGHEST), (8,), np.float32)
    size = PanoramaSize()
    picture = mirror.height, mirror.width
    shape = picture if kind is Observation.MIRROR else (size.rows, size.columns)
    return spaces.Box(0, 255, (*shape, 3), np.uint8)


def command_of(action: Any) -> int:
    """Return the number of a command.

    Raises:
        InvalidAction: it is none.
    """
    if not spaces.Discrete(len(COMMANDS)).contains(action):
        raise InvalidAction(
            f"the action {shown(action)} is none of 0 (left), 1 (right) and 2 (straight on)"
        )
    return int(action)


class WheelSpeeds:
    """Wheel speeds as actions: m/s outside, counts / 10 ms inside.

    Args:
        drive: how the robot is driven.

    Attributes:
        period: seconds that an action takes: those of a command of the paper at full speed.
        space: of the actions.
    """

    def __init__(self, drive: DriveSettings) -> None:
        self._base = drive.wheels.base
        self._unit = drive.wheels.left / 0.010  # m/s of one count / 10 ms
        top = np.float32(drive.speed * self._unit)
        self._top = float(top)
        self.period = STRAIGHT.way / self._top
        self.space = spaces.Box(-top, top, (2,), np.float32)

    def counts(self, action: Any) -> tuple[int, int]:
        """Return the speeds of an action, which need not be of the space's own type of number.

        Raises:
            InvalidAction: it is not in the space.
        """
        counts = self._counts(action, (2,))
        if counts is None:
            top = f"{self._top:g}"
            raise InvalidAction(
                f"the action {shown(action)} is not two speeds from -{top} to {top} m/s"
            )
        left, right = counts.tolist()
        return left, right

    def all_counts(self, actions: Any, robots: int) -> NDArray[np.int64]:
        """Return the speeds of an action of each robot, shape (robots, 2).

        Raises:
            InvalidAction: one of them is not in the space.
        """
        counts = self._counts(actions, (robots, 2))
        if counts is None:
            raise InvalidAction(
                f"the actions {shown(actions)} are not {robots} times two speeds from"
                f" -{self._top:g} to {self._top:g} m/s"
            )
        return counts

    def _counts(self, action: Any, shape: tuple[int, ...]) -> NDArray[np.int64] | None:
        """Return speeds of a shape in counts / 10 ms; None: the action is none within bounds."""
        try:
            given = np.asarray(action)
        except (TypeError, ValueError):  # such as lists of several lengths
            return None
        if given.dtype.kind not in "iuf" or given.shape != shape:
            return None
        with np.errstate(over="ignore"):  # infinity is out of bounds as well
            speeds = given.astype(np.float32)
        if not (np.abs(speeds) <= self.space.high).all():
            return None
        counts: NDArray[np.int64] = np.rint(speeds.astype(float) / self._unit).astype(np.int64)
        return counts

    def worth(self, speeds: NDArray[np.int64], reinforcement: Reinforcement) -> Array:
        """Return what `graded` does of many arcs that end without a collision, shape (N,).

        Args:
            speeds: of both wheels, counts / 10 ms, shape (N, 2).
            reinforcement: what commands earn.
        """
        left, right = (speeds * self._unit * self.period).T
        turning = np.minimum(1.0, np.abs((right - left) / self._base / LEFT.turn))
        way = np.minimum(1.0, np.maximum(0.0, (left + right) / 2 / STRAIGHT.way))
        straight, turn = reinforcement.straight, reinforcement.turn
        worth: Array = way * (straight + turning * (turn - straight))
        return worth

    def arc(self, left: int, right: int) -> MotorCommand:
        """Return the arc that speeds in counts / 10 ms come to."""
        left_way, right_way = (speed * self._unit * self.period for speed in (left, right))
        return MotorCommand(
            "wheels", turn=(right_way - left_way) / self._base, way=(left_way + right_way) / 2
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


def one_of(kind: type[_E], name: str) -> _E:
    """Return the member of a kind by its name.

    Raises:
        MacorError: there is none.
    """
    try:
        return kind(name)
    except ValueError:
        raise MacorError(
            f"there is no {kind.__name__.lower()} {name!r}; there are {', '.join(kind)}"
        ) from None


def pose_of(options: dict[str, Any] | None) -> Pose | None:
    """Return the pose that the options of a reset ask for."""
    if options is not None and not isinstance(options, dict):
        raise MacorError(f"the options of a reset are a dictionary, not {shown(options)}")
    for name in options or {}:
        if name != "pose":
            raise MacorError(f"a reset has no option {shown(name)}; there is 'pose'")
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
            f"the pose {shown(given)} is not x, y and heading, in metres and radians"
        ) from None


def shown(value: object) -> str:
    """Return a value as an error shows it."""
    return printable(repr(value), _SHOWN)


def rgb(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture in OpenCV's order of channels, turned to Gymnasium's."""
    return np.ascontiguousarray(image[..., ::-1])
