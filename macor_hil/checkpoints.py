"""Training that survives being killed: checkpoints on the way, the map at the end.

With a bench that resets, a checkpoint after each session is enough for the same map, byte for byte.
A robot's commands cannot be driven again: there every command is kept as soon as it is learned.
"""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from macor_hil.bench import Bench
from macor_hil.cameras import Camera
from macor_hil.caretaker import Caretaker
from macor_hil.drive import Driver
from macor_hil.errors import MapError
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.settings import MindSettings
from macor_hil.training import Phase, Schedule, Session, Trainer


def checkpoint_path(path: Path) -> Path:
    """Where the checkpoint of a map in training lies: beside the map."""
    return path.with_name(f"{path.name}.part")


def train_map(
    path: Path,
    settings: MindSettings,
    schedule: Schedule,
    place: str,
    hardware: tuple[Driver, Camera, Bench | None],
    progress: Callable[[int], None],
    care: Caretaker | None = None,
    every: int = 0,
) -> Brain:
    """Train a map to its end, from its checkpoint if there is one.

    Args:
        path: the map's file, written when the training is complete.
        settings: what is learned, and how.
        schedule: how much is trained.
        place: what is trained on (the port); a checkpoint of another place is refused.
        hardware: driver and camera, and the bench of an emulated robot.
        progress: hears how many commands have been driven in all.
        care: gets robot and camera over failures, and asks for room on a full disk.
        every: commands from one checkpoint to the next within a session; 0: none within.

    Raises:
        MapError: the checkpoint belongs to another training, or a file cannot be written.
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    # compared as JSON gives it back: lists for tuples, plain strings for enumerations
    facts: dict[str, Any] = {"place": place, "schedule": _plain(asdict(schedule))}
    part = checkpoint_path(path)
    brain, first, done = build_brain(settings), 0, 0
    seen: list[list[float]] = []
    if part.exists():
        brain, first, done, seen = _resume(part, settings, facts)
    driver, camera, bench = hardware
    trainer = Trainer(brain, driver, camera, bench, schedule, care)
    trainer.seen = seen
    sessions = schedule.sessions()
    progress(sessions[first].start + done if first < len(sessions) else schedule.commands)

    def save(target: Path, sessions_done: int, commands_done: int = 0) -> None:
        state: dict[str, Any] = {"sessions": sessions_done}
        if commands_done:
            tuning = sessions[sessions_done].phase is Phase.TUNING
            state |= {"done": commands_done, "seen": trainer.seen if tuning else []}
        _save_with_a_hand(target, brain, {**facts, **state}, care)

    for session in sessions[first:]:

        def after(driven: int, session: Session = session) -> None:
            inside = driven - session.start
            if every and inside % every == 0 and inside < session.length:
                save(part, session.number, inside)
            progress(driven)

        trainer.run(session, after, done)
        done = 0
        save(part, session.number + 1)
    save(path, len(sessions))
    part.unlink()
    return brain


def _save_with_a_hand(
    path: Path, brain: Brain, training: dict[str, Any], care: Caretaker | None
) -> None:
    while True:
        try:
            save_map(path, brain, training)
        except MapError as error:
            if care is None:
                raise
            care.need_a_hand(f"{error}. The robot stands; make room, and it goes on", error)
        else:
            return


def _resume(
    part: Path, settings: MindSettings, facts: dict[str, Any]
) -> tuple[Brain, int, int, list[list[float]]]:
    """The brain, sessions done, commands done of the next one, and what was seen in tuning."""
    brain, training = load_map(part)
    same = {name: training.get(name) == value for name, value in facts.items()}
    same["settings"] = brain.settings == settings
    if not all(same.values()):
        other = ", ".join(name for name, equal in same.items() if not equal)
        raise MapError(
            f"the checkpoint {part} is of another training (its {other} differ); finish that one"
            " with its own options, or begin anew with --restart"
        )
    return brain, int(training["sessions"]), int(training.get("done", 0)), training.get("seen", [])


def _plain(value: dict[str, Any]) -> dict[str, Any]:
    return {name: str(item) if isinstance(item, str) else item for name, item in value.items()}
