"""Training that survives being killed: checkpoints on the way, the map at the end.

With a bench that resets, a checkpoint after each session is enough for the same map, byte for byte.
A robot's commands cannot be driven again: there every command is kept as soon as it is learned.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field, TypeAdapter

from macor_hil.errors import MapError
from macor_hil.files import InputError, checked
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.cameras import Camera
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain, memory_for, own_code
from macor_hil.mind.map_file import load_map, save_map
from macor_hil.mind.planners.reactive import Reactive
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.recovery import TrainingRecovery
from macor_hil.runs.training import Schedule, Session, SessionKind, Trainer

_FACTS: Final = {"place": "port", "drive": "wheels or speeds"}
"""Names of facts that a training must have in common with its checkpoint."""
_Feature = Annotated[float, Field(ge=-10.0, le=10.0)]


@dataclass(frozen=True, slots=True)
class _Progress:
    """Progress of the training of a checkpoint; the bounds are those of files.

    Attributes:
        sessions: that are done.
        done: commands of the next one that are driven.
        seen: features that have been seen in tuning, while that is the next one.
    """

    sessions: Annotated[int, Field(ge=0)]
    done: Annotated[int, Field(ge=0)] = 0
    seen: list[list[_Feature]] = field(default_factory=list)


_PROGRESS: Final = TypeAdapter(_Progress)


def checkpoint_path(path: Path) -> Path:
    """Return the path of the checkpoint of a map in training: beside the map."""
    return path.with_name(f"{path.name}.part")


def train_map(
    path: Path,
    settings: MindSettings,
    schedule: Schedule,
    place: str,
    hardware: tuple[Driver, Camera, Bench | None],
    progress: Callable[[int], None],
    rescue: TrainingRecovery | None = None,
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
        rescue: recovers robot and camera from failures, and asks for room on a full disk.
        every: commands from one checkpoint to the next within a session; 0: none within.

    Raises:
        MapError: the checkpoint belongs to another training or another way of driving (wheels,
            speed), or a file cannot be written.
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    # compared as JSON gives it back: lists for tuples, plain strings for enumerations
    driver, camera, bench = hardware
    facts: dict[str, Any] = {
        "place": place,
        "schedule": _plain(asdict(schedule)),
        "drive": asdict(driver.settings),
    }
    part = checkpoint_path(path)
    brain, first, done = build_brain(settings), 0, 0
    if schedule.reactive:
        memory_for(brain, Reactive())  # refused now, and not after all the random commands
    seen: list[list[float]] = []
    if part.exists():
        brain, first, done, seen = _resume(part, settings, schedule, facts)
    trainer = Trainer(brain, driver, camera, bench, schedule, rescue)
    trainer.seen = seen
    sessions = schedule.sessions()
    progress(sessions[first].start + done if first < len(sessions) else schedule.commands)

    def save(target: Path, sessions_done: int, commands_done: int = 0) -> None:
        state: dict[str, Any] = {"sessions": sessions_done}
        if commands_done:
            tuning = sessions[sessions_done].kind is SessionKind.TUNING
            state |= {"done": commands_done, "seen": trainer.seen if tuning else []}
        _save_with_help(target, brain, {**facts, **state}, rescue)

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


def commands_kept(path: Path, schedule: Schedule, allowed: Collection[str] = ()) -> int:
    """Return how many commands of a training are in the checkpoint of a map; 0 without one.

    Args:
        path: the map's file.
        schedule: how much is trained.
        allowed: see `load_map`.

    Raises:
        MapError: what is there is no checkpoint.
    """
    part = checkpoint_path(path)
    if not part.exists():
        return 0
    _, training = load_map(part, allowed)
    sessions, first = schedule.sessions(), int(training["sessions"])
    if first >= len(sessions):
        return schedule.commands
    return sessions[first].start + int(training.get("done", 0))


def _save_with_help(
    path: Path, brain: Brain, training: dict[str, Any], rescue: TrainingRecovery | None
) -> None:
    while True:
        try:
            save_map(path, brain, training)
        except MapError as error:
            if rescue is None:
                raise
            rescue.ask_for_help(f"{error}. The robot stands; make room, and it goes on", error)
        else:
            return


def _resume(
    part: Path, settings: MindSettings, schedule: Schedule, facts: dict[str, Any]
) -> tuple[Brain, int, int, list[list[float]]]:
    """Return the brain, sessions done, commands done of the next, and features seen in tuning."""
    brain, training = load_map(part, own_code(settings))
    same = {name: training.get(name) == value for name, value in facts.items()}
    same["settings"] = brain.settings == settings
    if not all(same.values()):
        other = ", ".join(_FACTS.get(name, name) for name, equal in same.items() if not equal)
        raise MapError(
            f"the checkpoint {part} is of another training (its {other} differ); finish that one"
            " with its own options and --profile, or begin anew with --restart"
        )
    given = {name: value for name, value in training.items() if name not in facts}
    try:
        progress = checked(_PROGRESS, given)
        _check_fits(progress, schedule.sessions(), brain.eyes.raw_size)
    except InputError as error:
        raise MapError(
            f"the checkpoint {part} is damaged: {error}; begin anew with --restart"
        ) from None
    return brain, progress.sessions, progress.done, progress.seen


def _check_fits(progress: _Progress, sessions: Sequence[Session], features: int) -> None:
    """Refuse progress that no training of these sessions can have made.

    Raises:
        InputError: it does not fit.
    """
    done, seen = progress.done, progress.seen
    session = sessions[progress.sessions] if progress.sessions < len(sessions) else None
    tuning = session is not None and session.kind is SessionKind.TUNING
    if progress.sessions > len(sessions) or done >= (session.length if session else 1):
        raise InputError("it has driven more than is to be driven")
    if len(seen) != (done if tuning else 0) or any(len(row) != features for row in seen):
        raise InputError("what was seen in tuning does not fit what was driven")


def _plain(value: dict[str, Any]) -> dict[str, Any]:
    return {name: str(item) if isinstance(item, str) else item for name, item in value.items()}
