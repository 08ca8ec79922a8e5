"""The same room in another simulator: IR-SIM with a robot of eight beams, against a whole Khepera.

IR-SIM is optional (`pip install ir-sim`); without it there is no such row.
"""

import os
from collections.abc import Mapping
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np
from figures import Figure
from khepera_protocol.zenoh.payloads import Reset
from simulation import AT_WALL, SPOT, STEP, ask

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.robot.emulator import Emulator, Setup

_STEPS = 300

# The box of a metre, the robot 20 mm before its wall, turning on the spot; beams as far as the
# infrared sensors of a Khepera reach beyond its body.
_ROOM = f"""
world: {{height: 2, width: 2, offset: [-1, -1], step_time: {STEP}, sample_time: {STEP},
        collision_mode: unobstructed}}
robot:
  - kinematics: {{name: diff}}
    shape: {{name: circle, radius: 0.0275}}
    state: [{AT_WALL.x}, {AT_WALL.y}, {AT_WALL.heading}]
    sensors:
      - {{name: lidar2d, number: 8, angle_range: 6.283, range_min: 0, range_max: 0.0705}}
obstacle:
  - shape: {{name: linestring, vertices: [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5],
             [-0.5, -0.5]]}}
    state: [0, 0, 0]
"""


class Peer:
    """Steps of 20 ms with all eight sensors."""

    def __init__(self, stack: ExitStack) -> None:
        self._emulator = Emulator(Setup(load_arena("open-box"), baud=None))
        stack.callback(self._emulator.close)
        self._other = _open_room() if find_spec("irsim") else None

    def round(self) -> dict[str, float]:
        """Measure steps a second of processor time, of both."""
        emulator = self._emulator
        emulator.reset(Reset(pose=AT_WALL, seed=1))
        emulator.write(SPOT)
        emulator.advance(emulator.now + 1.0)
        emulator.read()
        start = process_time()
        for _ in range(_STEPS):
            ask(emulator)
            emulator.advance(emulator.now + STEP)
            emulator.read()
        found = {"own": _STEPS / (process_time() - start)}
        if self._other is not None:
            turn = np.array([[0.0], [1.2]])
            start = process_time()
            for _ in range(_STEPS):
                self._other.step(turn)
                self._other.get_lidar_scan()
            found["other"] = _STEPS / (process_time() - start)
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Both, and their ratio."""
        if "other" not in medians:
            return []
        own, other = medians["own"], medians["other"]
        return [
            Figure(
                "steps of 20 ms a second, at a wall, eight sensors read over the protocol",
                f"{own:,.0f}",
                f"IR-SIM with eight beams {other:,.0f}",
                f"{own / other:.1f}",
            )
        ]


def _open_room() -> Any:
    """Open the room in IR-SIM, without a window and its remarks on missing ones."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    with (
        Path(os.devnull).open("w") as nowhere,
        redirect_stdout(nowhere),
        redirect_stderr(nowhere),
        TemporaryDirectory() as folder,
    ):
        import irsim

        room = Path(folder) / "room.yaml"
        room.write_text(_ROOM)
        return irsim.make(str(room), display=False, log_level="ERROR")
