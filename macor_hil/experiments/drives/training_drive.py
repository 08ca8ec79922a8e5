"""Recordings: one training drive of a seed, kept once for all systems that learn from it.

Driving is what costs. A recording holds what came from the eyes (untuned features of every
frame) and what went to the motors, over a whole training drive; every system of the seed learns
from it afterwards. The drive is that of `macor_hil.runs.training`: random commands, then, in
section 3.1, commands selected reactively by the map learned so far, that of Fuzzy ART. Both
sections' drives begin with the same random commands, which are driven once for both.
"""

import io
import logging
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, TypeAdapter

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.commands import COMMANDS
from macor_hil.errors import MapError
from macor_hil.experiments.results.code_digest import digest
from macor_hil.experiments.results.store import key_of
from macor_hil.files import MIB, InputError, checked, read_arrays, read_bounded, write_atomically
from macor_hil.hardware.devices import Hardware, open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain, whereabouts
from macor_hil.mind.experience import Seen
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MindSettings, Part
from macor_hil.runs.training import Schedule, Trainer

_log = logging.getLogger(__name__)

_MOST_BYTES: Final = 256 * MIB
_MOST_RAW: Final = 10.0
_SECONDS: Final = TypeAdapter(Annotated[float, Field(ge=0.0, le=1e9)])

_Count = Annotated[int, Field(ge=1)]

PUT_DOWN: Final = -1
"""Stands for the command of a frame that was seen where the robot had been put down."""

_KEPT_EVERY: Final = 4
"""Sessions after which what was driven is kept, so that an interrupted drive goes on from there."""


def _enough_to_drive() -> MindSettings:
    """Return the default eyes, and of memories the reactive one and that which tuning places."""
    return MindSettings(memories={name: Part(name) for name in ("transitions", "graded")})


@dataclass(frozen=True)
class Drive:
    """The training drive that is recorded (section 3.2)."""

    arena: str = "corridor"
    """The arena of the drive."""
    drift: str = "default"
    """The spread of the robots' wheels; each seed is another robot."""
    model: str = "khepera"
    """The robot: a model that comes with the emulator, or `file.py:MODEL`."""
    baud: _Count = 9600
    """Rate of its serial line, bits a second; an e-puck's is 115200."""
    tuning: _Count = 400
    """Commands driven first to tune the receptive fields; not recorded."""
    random: _Count = 13_000
    """Randomly selected commands."""
    reactive: Annotated[int, Field(ge=0)] = 0
    """Reactively selected commands after them."""
    brain: MindSettings = field(default_factory=_enough_to_drive)
    """Eyes, and what selects reactively; other systems learn from the recording."""

    def port(self, seed: int, arena: str = "") -> str:
        """Port of the robot of a seed, in the arena of the drive or another one."""
        place = arena or self.arena
        return f"khepera://{place}?seed={seed}&drift={self.drift}&model={self.model}"

    def robot(self, seed: int, arena: str = "") -> AbstractContextManager[Hardware]:
        """Open the robot of a seed; see `port` and `open_hardware`."""
        return open_hardware(self.port(seed, arena), baud=self.baud)

    def schedule(self, seed: int) -> Schedule:
        """Return the commands of a seed."""
        return Schedule(self.tuning, self.random, self.reactive, seed=seed)

    @property
    def uses(self) -> tuple[str, ...]:
        """Parts that are found by name, as `module:Class` or `file.py:Class`."""
        model = (self.model,) if ":" in self.model else ()
        return (*whereabouts(self.brain), *model)

    @property
    def beginning(self) -> "Drive | None":
        """The drive that this one goes on from, which others go on from, too."""
        shared = replace(self, random=SHARED, reactive=0)
        return shared if shared != self and self.random >= SHARED else None


SHARED: Final = 11_000
"""Random commands that longer drives of a robot have in common: whole sessions."""

SECTION_31: Final = Drive(random=11_000, reactive=2_000)
"""The drive of figures 2 to 4: "ca. 11000 randomly selected and about 2000 reactively selected"."""


QUICK_DRIVE: Final = Drive(tuning=100, random=1_500)
"""The drive of all quick experiments."""


@dataclass(frozen=True)
class Recording:
    """A training drive: T frames in their order.

    Attributes:
        brain: the controller that drove, with its tuned receptive fields and what it learned.
        raw: untuned features of every frame, shape (T, M).
        commands: index of the command that led to each frame, or PUT_DOWN, shape (T,).
        collided: whether that command ended in a collision, shape (T,).
        robot_seconds: how long the whole drive took the robot, on its own clock.
    """

    brain: Brain
    raw: Array
    commands: Indices
    collided: Mask
    robot_seconds: float

    @property
    def inputs(self) -> Array:
        """Array x of every frame, tuned, shape (T, M)."""
        return self.brain.eyes.tuned(self.raw)

    def reinforcement(self, earns: Reinforcement) -> Array:
        """Return what each frame's command earns, shape (T,); 0 where the robot was put down."""
        table = np.array([[earns(motor, hit) for hit in (False, True)] for motor in COMMANDS])
        driven = self.commands != PUT_DOWN
        return np.where(driven, table[self.commands, self.collided.astype(int)], 0.0)

    def frames_of(self, commands: int) -> int:
        """Return the number of frames up to the one after so many commands, that one included."""
        driven = np.cumsum(self.commands != PUT_DOWN)
        return min(int(np.searchsorted(driven, commands)) + 1, len(driven))

    def seen(self, frames: int | None = None) -> Iterator[Seen]:
        """Yield the drive's first frames; None: all."""
        return islice(_seen(self.raw, self.commands, self.collided), frames)

    def first(self, commands: int) -> "Recording":
        """Return the beginning of the drive, so many commands long."""
        end = self.frames_of(commands)
        return replace(
            self,
            raw=self.raw[:end],
            commands=self.commands[:end],
            collided=self.collided[:end],
            robot_seconds=self.robot_seconds * end / len(self.commands),
        )


def record(
    drive: Drive, seed: int, beginning: Recording | None = None, part: "_Part | None" = None
) -> Recording:
    """Drive a training over a `khepera://` port in virtual time and record it.

    A session depends on nothing but its number and the brain it starts with, so that a drive that
    goes on from a recorded beginning is the same as one driven in one go.

    Args:
        drive: what is driven.
        seed: of robot and training.
        beginning: the recording of the drive's beginning.
        part: keeps what is driven, and goes on from what was kept.

    Raises:
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    seen: list[Seen] = []
    brain = build_brain(drive.brain) if beginning is None else beginning.brain
    schedule = drive.schedule(seed)
    sessions = schedule.sessions()
    if beginning is not None and drive.beginning is not None:
        sessions = sessions[len(drive.beginning.schedule(seed).sessions()) :]
    done, seconds = 0, 0.0
    if part and (kept := part.load()):
        brain, seen, done, seconds = kept
    with drive.robot(seed) as hardware:
        if done:  # the time to open the port counts once
            seconds -= hardware.robot.clock()
        trainer = Trainer(
            brain,
            Driver(hardware.robot),
            hardware.camera,
            hardware.bench,
            schedule,
            witness=seen.append,
        )
        for number, session in enumerate(sessions[done:], done + 1):
            trainer.run(session, lambda _: None)
            if part and number % _KEPT_EVERY == 0 and number < len(sessions):
                part.save(brain, seen, number, seconds + hardware.robot.clock())
        seconds += hardware.robot.clock()
    driven = Recording(brain, **_arrays(seen), robot_seconds=round(seconds, 3))
    return driven if beginning is None else _joined(beginning, driven)


def _joined(beginning: Recording, rest: Recording) -> Recording:
    return Recording(
        rest.brain,
        np.concatenate([beginning.raw, rest.raw]),
        np.concatenate([beginning.commands, rest.commands]),
        np.concatenate([beginning.collided, rest.collided]),
        round(beginning.robot_seconds + rest.robot_seconds, 3),
    )


def _seen(raw: Array, commands: Indices, collided: Mask) -> Iterator[Seen]:
    for x, a, hit in zip(raw, commands.tolist(), collided.tolist(), strict=True):
        yield Seen(x, None if a == PUT_DOWN else a, hit)


def _arrays(seen: list[Seen]) -> dict[str, Any]:
    """Features, what led to them, and whether that was a collision."""
    return {
        "raw": np.array([each.raw for each in seen]),
        "commands": np.array(
            [PUT_DOWN if each.command is None else each.command for each in seen], dtype=np.int64
        ),
        "collided": np.array([each.collided for each in seen], dtype=np.bool_),
    }


class _Part:
    """The beginning of a recording whose drive has not come to its end.

    Args:
        path: where; two files with other ends are written.
    """

    def __init__(self, path: Path) -> None:
        self._map = path.with_suffix(".part.map.npz")
        self._frames = path.with_suffix(".part.frames.npz")

    def save(self, brain: Brain, seen: list[Seen], sessions: int, seconds: float) -> None:
        """Keep what was driven in so many sessions, which took the robot some seconds."""
        write_atomically(self._frames, _archive(_arrays(seen)), MapError)
        # last, and with the number of frames: later ones may be there from a kill in between
        facts = {"sessions": sessions, "seconds": seconds, "frames": len(seen)}
        save_map(self._map, brain, facts)

    def load(self) -> tuple[Brain, list[Seen], int, float] | None:
        """Return what was kept: brain, frames, sessions driven, and seconds; None if nothing was.

        Raises:
            MapError: it is damaged.
        """
        if not self._map.exists():
            return None
        brain, facts = load_map(self._map)
        try:
            frames, sessions, seconds = (facts[name] for name in ("frames", "sessions", "seconds"))
            raw, commands, collided = read_frames(self._frames, brain.eyes.raw_size)
        except (KeyError, TypeError) as error:
            raise MapError(f"{self._map} is damaged ({error}); take it away") from None
        # later ones may be there from a kill in between
        seen = list(islice(_seen(raw, commands, collided), frames))
        return brain, seen, sessions, seconds

    def remove(self) -> None:
        """Take the files away: the recording is there."""
        self._map.unlink(missing_ok=True)
        self._frames.unlink(missing_ok=True)


def _archive(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


class Recordings:
    """Recordings in a folder, made when they are asked for and not there.

    The folder's name holds a digest of settings and code: other settings, or other code, never
    find these recordings.

    Args:
        folder: where all recordings are kept.
        drive: what is recorded.
    """

    def __init__(self, folder: Path, drive: Drive) -> None:
        self.drive = drive
        self.beginnings = None if drive.beginning is None else Recordings(folder, drive.beginning)
        self.key = key_of(drive, digest(record, [drive.arena], drive.uses))
        self.folder = folder / self.key

    @property
    def arenas(self) -> Path:
        """Folder beside all recordings for files of arenas."""
        return self.folder.parent.parent / "arenas"

    def of(self, drive: Drive) -> "Recordings":
        """Return the recordings of another drive, kept beside these."""
        return Recordings(self.folder.parent, drive)

    def has(self, seed: int) -> bool:
        """Return whether the recording of a seed is there."""
        return self._frames(seed).exists()

    def make(self, seed: int) -> None:
        """Record a seed's training drive if it is not there, from where it was interrupted."""
        if not self.has(seed):
            beginning = None if self.beginnings is None else self.beginnings[seed]
            part = _Part(self.folder / f"seed-{seed:04}.npz")
            self._save(seed, record(self.drive, seed, beginning, part))
            part.remove()

    def __getitem__(self, seed: int) -> Recording:
        """Return the recording of a seed, the same whether it was there or is made now."""
        self.make(seed)
        try:
            return self._load(seed)
        except MapError as error:
            _log.warning("%s; it is driven again", error)
            self._frames(seed).unlink(missing_ok=True)
            self.make(seed)
            return self._load(seed)

    def _load(self, seed: int) -> Recording:
        """Read a recording that is there.

        Raises:
            MapError: it is damaged.
        """
        brain, facts = load_map(self._map(seed))
        try:
            seconds = checked(_SECONDS, facts.get("robot_seconds"))
        except InputError as error:
            raise MapError(f"{self._map(seed)} is damaged: its time {error}") from None
        return Recording(brain, *read_frames(self._frames(seed), brain.eyes.raw_size), seconds)

    def _save(self, seed: int, recording: Recording) -> None:
        facts = {"port": self.drive.port(seed), "robot_seconds": recording.robot_seconds}
        save_map(self._map(seed), recording.brain, facts)
        arrays = {
            "raw": recording.raw,
            "commands": recording.commands,
            "collided": recording.collided,
        }
        # last: a recording is there when its frames are
        write_atomically(self._frames(seed), _archive(arrays), MapError)

    def _map(self, seed: int) -> Path:
        return self.folder / f"seed-{seed:04}.map.npz"

    def _frames(self, seed: int) -> Path:
        return self.folder / f"seed-{seed:04}.frames.npz"


Frames = tuple[Array, Indices, Mask]
"""Untuned features, commands and collisions; see `Recording`."""


def read_frames(path: Path, features: int) -> Frames:
    """Read frames of so many features each.

    Raises:
        MapError: the file is not there or damaged, or no drive can have given such frames.
    """
    try:
        arrays = read_arrays(read_bounded(path, _MOST_BYTES), _MOST_BYTES)
        raw, commands, collided = (arrays[name] for name in ("raw", "commands", "collided"))
        _check_frames(features, raw, commands, collided)
    except KeyError as error:
        raise MapError(f"the recording {path} is damaged: it has no {error}") from None
    except (OSError, InputError) as error:
        raise MapError(f"the recording {path} is damaged: {error}") from None
    return raw, commands, collided


def _check_frames(features: int, raw: Array, commands: Indices, collided: Mask) -> None:
    """Refuse frames that no drive can have given.

    Raises:
        InputError: they are of other shapes or kinds, or not possible.
    """
    count = len(commands) if commands.ndim else 0
    shapes = (count, features), (count,), (count,)
    kinds = "fib"
    for array, shape, kind in zip((raw, commands, collided), shapes, kinds, strict=True):
        if array.shape != shape or array.dtype.kind != kind:
            raise InputError(f"it has frames of {array.dtype} and shape {array.shape}")
    if not (np.abs(raw) <= _MOST_RAW).all():
        raise InputError("a feature is out of its bounds")
    if not ((commands >= PUT_DOWN) & (commands < len(COMMANDS))).all():
        raise InputError("a command is none of the controller's")
