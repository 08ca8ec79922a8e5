"""The longest drive and the shortest way that are possible, by searches over an arena's floor plan.

The poses that one command leads to, then those after two, three ... are found layer by layer. Of
a layer only so many poses are kept: one in each cell (a square of floor and a small range of
headings), with cells as small as that allows. Every drive that is found is a true one, so that the
search ends as soon as one has all commands that were asked for. It is also certain that no drive is
longer if nothing but equal poses was ever merged. Otherwise wider layers are searched, and what the
widest ones leave open is told.

A shortest way to a region is found layer by layer, too; each small cell is passed once.

This is ground truth, for scoring: the controller must not ask it for commands to drive.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, pi
from typing import Final, NamedTuple

import numpy as np
from khepera_protocol.registry import is_own_code
from khepera_protocol.serial.units import PULSE
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.payloads import Outline, Pose, WheelDrift

from khepera_emulator.errors import EmulatorError
from khepera_emulator.models import MODELS, Model, find_model
from khepera_emulator.routes.feelers import Feelers, Flags, Indices, Poses, solids_of
from khepera_emulator.world.rays import Array

Ways = tuple[float, float]
"""Ways that a command turns the left and the right wheel, in metres as the encoders count them."""

PAPER_COMMANDS: Final[tuple[Ways, ...]] = (
    (193 * PULSE, 332 * PULSE),
    (332 * PULSE, 193 * PULSE),
    (262 * PULSE, 262 * PULSE),
)
"""The paper's commands: 2.1 cm, turning 12, -12 or 0 degrees, in whole encoder counts."""

COLLISION: Final = 1000
"""Reading of a Khepera's front or side sensor from which on the controller has collided."""

MARGIN: Final = 0.002
"""Metres that drives keep beyond what counts as a collision: six times what the noise of the
sensors is worth, and what the wheels' slip adds from one command to the next."""

WIDTHS: Final = (64, 512, 4096)
"""Poses that are kept of a layer: in a first search, and in further ones if it leaves something
open. The first takes about 30 ms for 40 commands, the last a third of a second."""

_SAMPLE: Final = 0.0055
"""Metres between the poses of a command that are looked at, at most."""

_SMALLEST: Final = 1e-6
"""Metres: side of the cells that merge equal poses only."""

_FINEST: Final = 0.5e-3
"""Metres: side of the next larger cells; from there on it is doubled."""

_HASH: Final = np.array([1_000_003, 998_244_353, 2_147_483_647])
"""Primes that make one number of a cell's three; who shares it by chance is seen to be lost."""

_WAY: Final = 0.006
"""Metres: side of the cells in which a shortest way passes once."""

_LEVER: Final = 0.1
"""Metres: a cell is as many radians wide as its side over this."""

_EQUAL: Final = 1e-9
"""Metres and radians by which equal poses may differ: sums depend on their order so much."""


@dataclass(frozen=True, slots=True)
class LongestDrive:
    """The longest drive that was found from a pose.

    Attributes:
        commands: of the drive, as indices.
        asked: how many commands were asked for, at most.
        exact: whether it is certain that no drive is longer. Otherwise one may be, by a command
            or two.
    """

    commands: tuple[int, ...]
    asked: int
    exact: bool

    @property
    def length(self) -> int:
        """Number of commands without a collision."""
        return len(self.commands)


class _Layer(NamedTuple):
    """Poses that as many commands lead to, with the pose before each and the command from it."""

    poses: Poses
    before: Indices
    command: Indices

    def take(self, numbers: Indices) -> "_Layer":
        """Return some of them."""
        return _Layer(self.poses.take(numbers), self.before[numbers], self.command[numbers])


class Oracle:
    """Search for what is possible in an arena for one robot.

    Args:
        outline: the arena, with all things where they are; they count as standing still.
        commands: what the robot can do.
        drift: of the robot's wheels, without its slip; None: wheels that are as they should be.
        collision: proximity reading that counts as a collision, as the robot's line has it.
        margin: metres that drives keep beyond it.

    Raises:
        EmulatorError: the robot of the outline is not known.
    """

    def __init__(
        self,
        outline: Outline,
        commands: Sequence[Ways] = PAPER_COMMANDS,
        drift: WheelDrift | None = None,
        collision: int = COLLISION,
        margin: float = MARGIN,
    ) -> None:
        model = _model_of(outline)
        self._feelers = Feelers(solids_of(outline), model, collision, margin)
        arcs = [_arc(ways, model.wheel_base, drift) for ways in commands]
        self._samples = np.concatenate(arcs)
        self._firsts = np.cumsum([0, *map(len, arcs[:-1])])
        self._ends = np.array([arc[-1] for arc in arcs])

    def longest_drive(
        self, pose: Pose, commands: int, widths: Sequence[int] = WIDTHS
    ) -> LongestDrive:
        """Find the longest drive from a pose.

        Args:
            pose: where the robot stands.
            commands: length at which the search ends.
            widths: poses kept of a layer, search by search.
        """
        start = Poses(*(np.array([value]) for value in (pose.x, pose.y, pose.heading)))
        best = LongestDrive((), commands, exact=False)
        if self._feelers.touch(start, np.zeros((1, 3))).any():
            return LongestDrive((), commands, exact=True)
        for width in widths:
            layers, whole = self._search(start, commands, width)
            exact = whole or len(layers) == commands
            if exact or len(layers) > best.length:
                best = LongestDrive(_way_to(layers, 0), commands, exact)
            if exact:
                break
        return best

    def shortest_way(
        self, pose: Pose, holds: Callable[[Poses], Flags], commands: int
    ) -> tuple[int, ...] | None:
        """Find the shortest way to a region, up to merging poses of the same small cell.

        Args:
            pose: where the robot stands.
            holds: tells which poses are in the region.
            commands: length at which the search ends.

        Returns:
            Its commands, none if the robot is there already; None: there is no way.
        """
        start = Poses(*(np.array([value]) for value in (pose.x, pose.y, pose.heading)))
        if holds(start).any():
            return ()
        if self._feelers.touch(start, np.zeros((1, 3))).any():
            return None
        layers: list[_Layer] = []
        poses, visited = start, np.sort(_cells(start, _WAY))
        while len(layers) < commands and len(poses.x):
            reached = self._drive(poses)
            keys, first = np.unique(_cells(reached.poses, _WAY), return_index=True)
            new = ~np.isin(keys, visited, assume_unique=True)
            layers.append(reached.take(first[new]))
            there = np.flatnonzero(holds(layers[-1].poses))
            if len(there):
                return _way_to(layers, int(there[0]))
            poses, visited = layers[-1].poses, np.concatenate([visited, keys[new]])
        return None

    def _search(self, start: Poses, commands: int, width: int) -> tuple[list[_Layer], bool]:
        """Find the layers of poses, up to a number of commands, and whether they are whole."""
        layers: list[_Layer] = []
        poses, whole, cell = start, True, _SMALLEST
        while len(layers) < commands:
            reached = self._drive(poses)
            if not len(reached.before):
                break
            layer, cell, lost = _thin_out(reached, width, cell)
            layers.append(layer)
            poses, whole = layer.poses, whole and not lost
        return layers, whole

    def _drive(self, poses: Poses) -> _Layer:
        """Drive every command from every pose; those that collide lead nowhere."""
        touched = self._feelers.touch(poses, self._samples)
        collided = np.logical_or.reduceat(touched, self._firsts, axis=1)
        command, before = np.nonzero(~collided.T)
        ahead, left, turn = self._ends[command].T
        x, y, heading = poses.take(before)
        c, s = np.cos(heading), np.sin(heading)
        reached = Poses(x + c * ahead - s * left, y + s * ahead + c * left, heading + turn)
        return _Layer(reached, before, command)


def _model_of(outline: Outline) -> Model:
    """Return the robot that an outline names; where it names none, one of its kind as wide.

    A name from a sample never loads code that is not installed.
    """
    name, radius = outline.robot_model, outline.robot_radius
    if not is_own_code(name) and name in MODELS.names():
        return find_model(name)
    models = [find_model(each) for each in MODELS.names()]
    for model in models:
        if model.kind == outline.robot_kind and abs(model.radius - radius) < _EQUAL:
            return model
    raise EmulatorError(
        f"no known robot is the {quoted(name or outline.robot_kind)} with a radius of {radius} m;"
        f" there are {', '.join(f'{model.name} ({model.radius} m)' for model in models)}"
    )


def _arc(ways: Ways, base: float, drift: WheelDrift | None) -> Array:
    """Return poses along a command, as seen from its beginning; the last one is its end.

    Shape (K, 3): metres ahead and to the left, radians turned.
    """
    left, right = ways
    if drift is not None:
        left, right, base = left * drift.left_scale, right * drift.right_scale, drift.wheel_base
    way, turn = (left + right) / 2, (right - left) / base
    count = max(1, ceil(max(abs(left), abs(right)) / _SAMPLE))
    part = np.arange(1, count + 1) / count
    half = part * turn / 2
    chord = part * way * np.sinc(half / pi)
    return np.stack([chord * np.cos(half), chord * np.sin(half), part * turn], axis=1)


def _thin_out(layer: _Layer, width: int, cell: float) -> tuple[_Layer, float, bool]:
    """Keep one pose in each cell.

    Args:
        layer: poses.
        width: how many are kept at most.
        cell: side of the cells of the layer before.

    Returns:
        The poses, the side of the cells that made them so few, and whether one was lost that is
        not the same as the one kept for it.
    """
    x, y, heading = layer.poses
    heading = heading % (2 * pi)
    places = np.stack([x, y, heading * _LEVER])
    cell = max(cell / 2, _FINEST) if len(x) > width else _SMALLEST
    while True:
        keys = _cells(layer.poses, cell)
        _, kept, own = np.unique(keys, return_index=True, return_inverse=True)
        if len(kept) <= width:
            break
        cell = max(2 * cell, _FINEST)
    away = np.abs(places - places[:, kept[own]])
    return layer.take(kept), cell, bool((away > _EQUAL).any())


def _cells(poses: Poses, cell: float) -> Indices:
    """Return a number for the cell of each pose; that two share one by chance is unlikely."""
    places = np.stack([poses.x, poses.y, poses.heading % (2 * pi) * _LEVER])
    cells: Indices = _HASH @ np.floor(places / cell).astype(np.int64)
    return cells


def _way_to(layers: Sequence[_Layer], at: int) -> tuple[int, ...]:
    """Return the commands that lead to a pose of the last layer."""
    commands = []
    for layer in reversed(layers):
        commands.append(int(layer.command[at]))
        at = int(layer.before[at])
    return tuple(reversed(commands))
