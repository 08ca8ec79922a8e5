"""Recordings: one training drive of a seed, kept once for all systems that learn from it.

Driving is what costs. A recording holds what came from the eyes (untuned features of every
frame) and what went to the motors, over a whole training drive; every system of the seed learns
from it afterwards. The drive is that of `macor_hil.training`: random commands, then, in section
3.1, commands selected reactively by the map learned so far, that of Fuzzy ART. Both sections'
drives begin with the same random commands, which are driven once for both.
"""

import io
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from macor_hil.agent import Seen
from macor_hil.arrays import Array, Indices, Mask
from macor_hil.commands import COMMANDS
from macor_hil.drive import Driver
from macor_hil.experiments.results import key_of
from macor_hil.experiments.sources import digest
from macor_hil.hardware import open_hardware
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.map_file import load_map, save_map, write_atomically
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.mind.settings import MindSettings
from macor_hil.training import Schedule, Trainer

PUT_DOWN: Final = -1
"""Stands for the command of a frame that was seen where the robot had been put down."""

_NO_PART: Final = (
    "macor_hil/clustering/clusterer",
    "macor_hil/clustering/neural_gas",
    "macor_hil/planners/__init__",
    "macor_hil/trials",
    "macor_hil/planners/expected",
    "macor_hil/planners/q_learning",
)
"""Code that learns from recordings and has no part in making them."""


@dataclass(frozen=True)
class Drive:
    """The training drive that is recorded (section 3.2)."""

    arena: str = "corridor"
    """Where it is driven."""
    drift: str = "default"
    """How much the robots' wheels differ; each seed is another robot."""
    tuning: int = 400
    """Commands driven first to tune the receptive fields; not recorded."""
    random: int = 13_000
    """Randomly selected commands."""
    reactive: int = 0
    """Reactively selected commands after them."""
    brain: MindSettings = field(default_factory=MindSettings)
    """Eyes, and the Fuzzy ART that selects reactively."""

    def port(self, seed: int) -> str:
        """Port of the robot of a seed."""
        return f"khepera://{self.arena}?seed={seed}&drift={self.drift}"

    def schedule(self, seed: int) -> Schedule:
        """What is driven for a seed."""
        return Schedule(self.tuning, self.random, self.reactive, seed=seed)

    @property
    def beginning(self) -> "Drive | None":
        """The drive that this one goes on from, which others go on from, too."""
        shared = replace(self, random=SHARED, reactive=0)
        return shared if shared != self and self.random >= SHARED else None


SHARED: Final = 11_000
"""Random commands that longer drives of a robot have in common: whole sessions."""

SECTION_31: Final = Drive(random=11_000, reactive=2_000)
"""The drive of figures 2 to 4: "ca. 11000 randomly selected and about 2000 reactively selected"."""


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
        """What each frame's command earns, shape (T,); 0 where the robot was put down."""
        table = np.array([[earns(motor, hit) for hit in (False, True)] for motor in COMMANDS])
        driven = self.commands != PUT_DOWN
        return np.where(driven, table[self.commands, self.collided.astype(int)], 0.0)

    def frames_of(self, commands: int) -> int:
        """Number of frames up to the one after so many commands, that one included."""
        driven = np.cumsum(self.commands != PUT_DOWN)
        return min(int(np.searchsorted(driven, commands)) + 1, len(driven))

    def first(self, commands: int) -> "Recording":
        """The beginning of the drive, so many commands long."""
        end = self.frames_of(commands)
        return replace(
            self,
            raw=self.raw[:end],
            commands=self.commands[:end],
            collided=self.collided[:end],
            robot_seconds=self.robot_seconds * end / len(self.commands),
        )


def record(drive: Drive, seed: int, beginning: Recording | None = None) -> Recording:
    """Drive a training over a `khepera://` port in virtual time and record it.

    A session depends on nothing but its number and the brain it starts with, so that a drive that
    goes on from a recorded beginning is the same as one driven in one go.

    Args:
        drive: what is driven.
        seed: of robot and training.
        beginning: the recording of the drive's beginning.

    Raises:
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    seen: list[Seen] = []
    brain = build_brain(drive.brain) if beginning is None else beginning.brain
    schedule = drive.schedule(seed)
    sessions = schedule.sessions()
    if beginning is not None and drive.beginning is not None:
        sessions = sessions[len(drive.beginning.schedule(seed).sessions()) :]
    with open_hardware(drive.port(seed)) as hardware:
        trainer = Trainer(
            brain,
            Driver(hardware.robot),
            hardware.camera,
            hardware.bench,
            schedule,
            witness=seen.append,
        )
        for session in sessions:
            trainer.run(session, lambda _: None)
        seconds = hardware.robot.clock()
    driven = Recording(
        brain,
        np.array([each.raw for each in seen]),
        np.array([PUT_DOWN if e.command is None else e.command for e in seen], dtype=np.int64),
        np.array([each.collided for each in seen], dtype=np.bool_),
        round(seconds, 3),
    )
    return driven if beginning is None else _joined(beginning, driven)


def _joined(beginning: Recording, rest: Recording) -> Recording:
    return Recording(
        rest.brain,
        np.concatenate([beginning.raw, rest.raw]),
        np.concatenate([beginning.commands, rest.commands]),
        np.concatenate([beginning.collided, rest.collided]),
        round(beginning.robot_seconds + rest.robot_seconds, 3),
    )


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
        self.key = key_of(drive, digest([drive.arena], _NO_PART))
        self.folder = folder / self.key

    def has(self, seed: int) -> bool:
        """Whether the recording of a seed is there."""
        return self._frames(seed).exists()

    def make(self, seed: int) -> None:
        """Record a seed's training drive if it is not there."""
        if not self.has(seed):
            beginning = None if self.beginnings is None else self.beginnings[seed]
            self._save(seed, record(self.drive, seed, beginning))

    def __getitem__(self, seed: int) -> Recording:
        """The recording of a seed, the same whether it was there or is made now."""
        self.make(seed)
        brain, facts = load_map(self._map(seed))
        with np.load(self._frames(seed), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        return Recording(brain, robot_seconds=facts["robot_seconds"], **arrays)

    def _save(self, seed: int, recording: Recording) -> None:
        facts = {"port": self.drive.port(seed), "robot_seconds": recording.robot_seconds}
        save_map(self._map(seed), recording.brain, facts)
        buffer = io.BytesIO()
        np.savez(
            buffer,
            raw=recording.raw,
            commands=recording.commands,
            collided=recording.collided,
        )
        # last: a recording is there when its frames are
        write_atomically(self._frames(seed), buffer.getvalue())

    def _map(self, seed: int) -> Path:
        return self.folder / f"seed-{seed:04}.map.npz"

    def _frames(self, seed: int) -> Path:
        return self.folder / f"seed-{seed:04}.frames.npz"
