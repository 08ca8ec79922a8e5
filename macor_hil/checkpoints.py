"""Training that survives being killed: a checkpoint after each session, the map at the end."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from macor_hil.bench import Bench
from macor_hil.brain import Brain, Settings
from macor_hil.cameras import Camera
from macor_hil.drive import Driver
from macor_hil.errors import MapError
from macor_hil.map_file import load_map, save_map
from macor_hil.training import Schedule, Trainer


def checkpoint_path(path: Path) -> Path:
    """Where the checkpoint of a map in training lies: beside the map."""
    return path.with_name(f"{path.name}.part")


def train_map(
    path: Path,
    settings: Settings,
    schedule: Schedule,
    place: str,
    hardware: tuple[Driver, Camera, Bench | None],
    progress: Callable[[int], None],
) -> Brain:
    """Train a map to its end, from its checkpoint if there is one.

    Args:
        path: the map's file, written when the training is complete.
        settings: what is learned, and how.
        schedule: how much is trained.
        place: what is trained on (the port); a checkpoint of another place is refused.
        hardware: driver and camera, and the bench of an emulated robot.
        progress: hears how many commands have been driven in all.

    Raises:
        MapError: the checkpoint belongs to another training, or a file cannot be written.
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    # compared as JSON gives it back: lists for tuples, plain strings for enumerations
    facts: dict[str, Any] = {"place": place, "schedule": _plain(asdict(schedule))}
    part = checkpoint_path(path)
    brain, first = Brain(settings), 0
    if part.exists():
        brain, first = _resume(part, settings, facts)
    driver, camera, bench = hardware
    trainer = Trainer(brain, driver, camera, bench, schedule)
    sessions = schedule.sessions()
    progress(sessions[first].start if first < len(sessions) else schedule.commands)
    for session in sessions[first:]:
        trainer.run(session, progress)
        save_map(part, brain, {**facts, "sessions": session.number + 1})
    save_map(path, brain, {**facts, "sessions": len(sessions)})
    part.unlink()
    return brain


def _resume(part: Path, settings: Settings, facts: dict[str, Any]) -> tuple[Brain, int]:
    brain, training = load_map(part)
    same = {name: training.get(name) == value for name, value in facts.items()}
    same["settings"] = brain.settings == settings
    if not all(same.values()):
        other = ", ".join(name for name, equal in same.items() if not equal)
        raise MapError(
            f"the checkpoint {part} is of another training (its {other} differ); finish that one"
            " with its own options, or begin anew with --restart"
        )
    return brain, int(training["sessions"])


def _plain(value: dict[str, Any]) -> dict[str, Any]:
    return {name: str(item) if isinstance(item, str) else item for name, item in value.items()}
