"""The moves of a calibration that were driven and measured, kept until its end.

A hand with a ruler makes these numbers: what was measured before a Ctrl-C is not measured again.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import from_json, to_json

from macor_hil.errors import CalibrationError
from macor_hil.files import write_atomically
from macor_hil.hardware.calibration.course import Run
from macor_hil.hardware.odometry import Wheels

_MOST_BYTES: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class CalibrationPlan:
    """A plan of moves, and the robot that drives them.

    Attributes:
        port: of the robot.
        side: of the squares, metres.
        runs: how often each move is driven.
        speed: greatest speed of a wheel.
        wheels: assumed until others are found.
    """

    port: str
    side: float
    runs: int
    speed: int
    wheels: Wheels


@dataclass(frozen=True, slots=True)
class _Kept:
    course: CalibrationPlan
    runs: Annotated[list[Run], Field(max_length=1000)]


_ADAPTER: Final = TypeAdapter(_Kept)


class Measured:
    """The runs of a course, in a file beside the profile; use them from `runs`.

    Args:
        profile: where the result will be written.
        course: what is driven.

    Attributes:
        path: of the file.
        course: what is driven.
        runs: that were measured, in their order.

    Raises:
        CalibrationError: the file that is there is of another course, or damaged.
    """

    def __init__(self, profile: Path, course: CalibrationPlan) -> None:
        self.path = measured_path(profile)
        self.runs: list[Run] = []
        self.course = course
        if self.path.exists():
            self.runs = self._load()

    def add(self, run: Run) -> None:
        """Keep a run.

        Raises:
            CalibrationError: the file cannot be written.
        """
        self.runs.append(run)
        kept = {"course": asdict(self.course), "runs": [asdict(each) for each in self.runs]}
        write_atomically(self.path, to_json(kept, indent=1) + b"\n", CalibrationError)

    def close(self) -> None:
        """Take the file away: the profile has all of it."""
        self.path.unlink(missing_ok=True)

    def _load(self) -> list[Run]:
        try:
            with self.path.open("rb") as file:
                kept = _ADAPTER.validate_python(from_json(file.read(_MOST_BYTES)))
        except (OSError, ValueError) as error:
            what = error.errors()[0]["msg"] if isinstance(error, ValidationError) else error
            raise CalibrationError(
                f"the measured moves in {self.path} cannot be read: {what}; begin anew with"
                " --restart"
            ) from None
        if kept.course != self.course:
            raise CalibrationError(
                f"the measured moves in {self.path} are of another course (port, side, runs, speed"
                " or wheels); finish that one with its own options, or begin anew with --restart"
            )
        return kept.runs


def measured_path(profile: Path) -> Path:
    """Return where measured moves are kept: beside the profile."""
    return profile.with_name(f"{profile.name}.part")
