"""Trainings under faults, and what they keep of what they have learned."""

import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import training_process
from rig import RELAYED, Controller, Rig

from macor_hil.mind.map_file import load_map
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.runs.learning.checkpoints import checkpoint_path

_SCRIPT: Final = training_process.__file__
_RANDOM: Final = 25
"""Commands learned from in real time; those in virtual time are more."""

_VIRTUAL: Final = 80
_HALF: Final = training_process.TUNING + 10
_PATIENCE: Final = 120.0


def lost_in_training(path: Path, port: str, trouble: str = "") -> str:
    """Transitions lost in a training in virtual time."""
    fields = {"path": str(path), "port": port, "random": _VIRTUAL}
    if trouble:
        fields["trouble"] = trouble
    run = _start(fields)
    said = _ended(run)
    path.unlink(missing_ok=True)
    checkpoint_path(path).unlink(missing_ok=True)
    return _lost(_VIRTUAL, said)


def kept_through(bench: Rig, befall: Callable[[], object]) -> str:
    """Transitions lost in a training on the robot of a rig that something befalls half-way."""
    path = bench.folder / "trained.npz"
    path.unlink(missing_ok=True)
    run = bench.start([sys.executable, _SCRIPT, json.dumps(_on(bench, path))])
    run.wait_for_steps(_HALF, _PATIENCE)
    befall()
    return _lost(_RANDOM, _ended(run))


def ended_row(bench: Rig, trained: Path, name: str) -> tuple[str, ...]:
    """End a live run and a training by a signal, and start others in their place."""
    bench.make_ready()
    number = signal.Signals[name]
    controller = bench.controller(trained, speed=2, planner="circle")
    controller.wait_for_steps(1)
    bench.wait_until_moving()
    os.kill(controller.process.pid, number)
    stood = f"{bench.time_to_stand():.2f} s"
    controller.end()
    begin = time.monotonic()
    other = bench.controller(trained, speed=2, planner="circle")
    bench.wait_until_moving()
    again = f"{time.monotonic() - begin:.1f} s"
    other.wait_for_steps(1)
    bench.make_ready()
    return stood, again, "1", _learned_by_two(bench, number), "another one went on"


def full_disk_row(folder: Path) -> tuple[str, ...]:
    """Run a training whose disk is full, and another one when there is room."""
    path = folder / "full.npz"
    fields = {"path": str(path), "port": "khepera://open-box?seed=1", "random": _VIRTUAL}
    first = _start({**fields, "trouble": "full disk"})
    words = _ended(first)
    lost = max(0, first.steps() - 1 - _kept(path))
    whole = _ended(_start(fields))
    how = "ended with an error" if "Error" in words else "ended without a word"
    learned = f"{lost} of {_VIRTUAL}" if whole == str(_VIRTUAL) else f"ended: {whole}"
    return "between commands", "when there is room", "1", learned, f"{how}, another one went on"


def _learned_by_two(bench: Rig, number: signal.Signals) -> str:
    path = bench.folder / "ended.npz"
    path.unlink(missing_ok=True)
    command = [sys.executable, _SCRIPT, json.dumps(_on(bench, path))]
    first = bench.start(command)
    first.wait_for_steps(_HALF, _PATIENCE)
    os.kill(first.process.pid, number)
    first.end()
    lost = max(0, first.steps() - 1 - _kept(path))
    whole = _ended(bench.start(command))
    return f"{lost} of {_RANDOM}" if whole == str(_RANDOM) else f"ended: {whole[:60]}"


def _on(bench: Rig, path: Path) -> dict[str, Any]:
    return {
        "path": str(path),
        "port": str(bench.link),
        "baud": bench.baud,
        "camera": f"zenoh:{RELAYED}" if bench.relay else "zenoh",
        "endpoint": bench.endpoint,
        "listen": bench.controller_endpoint,  # so that the relay finds it
        "zenoh_config": str(bench.router.client) if bench.router else None,
        "random": _RANDOM,
    }


def _start(fields: dict[str, Any]) -> Any:
    return Controller([sys.executable, _SCRIPT, json.dumps(fields)])


def _ended(run: Any) -> str:
    run.process.wait(_PATIENCE)
    said: str = run.end()
    run.close()
    return said


def _lost(learned: int, said: str) -> str:
    return f"{learned - int(said)} of {learned}" if said.isdecimal() else f"ended: {said[:60]}"


def _kept(path: Path) -> int:
    """Commands that the checkpoint knows of."""
    brain, _ = load_map(checkpoint_path(path))
    tuning: int = training_process.TUNING
    known = brain.memories["transitions"]
    assert isinstance(known, SensorimotorMap)
    return tuning + int(known.transitions().z.sum())
