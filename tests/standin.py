"""A robot without a camera or a serial line: views by rays over a floor plan, exact arcs."""

import numpy as np
from khepera_protocol.zenoh.payloads import Pose
from planning import moment

from khepera_emulator.arenas.arena import Arena
from khepera_emulator.models import KHEPERA
from khepera_emulator.routes.feelers import Feelers, Poses, solids_of
from khepera_emulator.routes.oracle import COLLISION
from khepera_emulator.senses.camera import HEIGHT
from khepera_emulator.world.floor_plan import FloorPlan
from khepera_emulator.world.free_space import random_pose
from khepera_emulator.world.outline import outline
from macor_hil.arrays import Array
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Experience, Moment
from macor_hil.mind.eyes.floor_profile import azimuths
from macor_hil.mind.eyes.sights import SECTORS
from macor_hil.mind.foresight.motions import moved

COLUMNS = 120
_STEPS = 4


class StandIn:
    """Stands, looks and drives in an arena.

    Attributes:
        pose: where it is, metres and radians.
    """

    def __init__(self, arena: Arena, seed: int = 1) -> None:
        self.arena = arena
        self.plan = FloorPlan(arena)
        self.feelers = Feelers(solids_of(outline(arena, KHEPERA)), KHEPERA, COLLISION, 0.0)
        self.rng = np.random.default_rng(seed)
        self.pose = np.zeros(3)
        self.arcs = np.array([_arc(each.way, each.turn) for each in COMMANDS])

    def put_down(self, pose: Pose | None = None) -> None:
        """Go somewhere, or to a pose."""
        if pose is None:
            pose = random_pose(
                self.arena.free,
                lambda at: self.plan.clearance(at.x, at.y) - KHEPERA.radius,
                self.rng,
            )
        self.pose = np.array([pose.x, pose.y, pose.heading])

    def look(self, command: int = 2) -> Moment:
        """Return what is seen; the colour of each sector is that of its middle."""
        angles = self.pose[2] + azimuths(COLUMNS)
        rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        away, _ = self.plan.cast(np.tile(self.pose[:2], (COLUMNS, 1)), rays)
        sights = np.zeros((SECTORS, 5))
        for sector in range(SECTORS):
            ray = sector * COLUMNS // SECTORS + COLUMNS // SECTORS // 2
            place = self.pose[:2] + away[ray] * rays[ray]
            hit = min(self.plan.boxes, key=lambda box: box.gap(*place))
            sights[sector, :3] = hit.colour[::-1]
        now = moment(command)
        floor = np.clip(HEIGHT / np.maximum(away, 1e-3), 0.04, 8.0)
        return Moment(now.raw, now.features, now.resonance, now.neuron, floor, sights)

    def drive(self, command: int) -> bool:
        """Drive a command; returns whether that ended in a collision."""
        way = np.array([moved(self.pose, part * self.arcs[command]) for part in _parts()])
        touched = self.feelers.touch(Poses(*way.T), np.zeros((1, 3)))[:, 0]
        self.pose = way[int(touched.argmax())] if touched.any() else way[-1]
        return bool(touched.any())

    def train(self, memory: object, commands: int) -> Array:
        """Let a memory learn random commands; returns the pose of each view that it keeps."""
        poses = []
        before = None
        for _ in range(commands):
            if before is None:
                self.put_down()
                before = self.look()
                poses.append(self.pose)
            command = int(self.rng.integers(len(COMMANDS)))
            collided = self.drive(command)
            after = self.look(command)
            poses.append(self.pose)
            experience = Experience(before, command, after, 0.0 if collided else 0.6, collided)
            memory.learn(experience)  # type: ignore[attr-defined]
            before = None if collided else after
        return np.array(poses)


def _parts() -> Array:
    return np.arange(1, _STEPS + 1) / _STEPS


def _arc(way: float, turn: float) -> tuple[float, float, float]:
    half = turn / 2
    chord = way * float(np.sinc(half / np.pi))
    return chord * float(np.cos(half)), chord * float(np.sin(half)), turn
