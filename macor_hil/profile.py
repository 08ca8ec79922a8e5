"""The profile of one robot: what was measured on it, in a file with a version, replaced whole.

`macor-hil camera --calibrate` writes where the mirror lies in the picture, `macor-hil calibrate`
what the wheels' counts mean; drivers, odometry and eyes use them.
"""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json, to_json

from macor_hil.errors import ProfileError
from macor_hil.mind.map_file import write_atomically
from macor_hil.odometry import Wheels
from protocol.mirror import Mirror

FORMAT: Final = "khepera profile"
VERSION: Final = 1


@dataclass(frozen=True, slots=True)
class RobotProfile:
    """What was measured on one robot.

    Attributes:
        mirror: where the mirror lies in the camera's picture; None: as the map says.
        wheels: what the wheels' counts mean.
        notes: when and how something was measured, a line for each.
    """

    mirror: Mirror | None = None
    wheels: Wheels = field(default_factory=Wheels)
    notes: dict[str, str] = field(default_factory=dict)


_ADAPTER = TypeAdapter(RobotProfile)


def load_profile(path: Path) -> RobotProfile:
    """Read a profile.

    Raises:
        ProfileError: no such file, no profile, or one of another version.
    """
    try:
        data: Any = from_json(path.read_bytes())
    except FileNotFoundError:
        raise ProfileError(
            f"there is no profile {path}; measure the robot with: macor-hil calibrate --profile"
            f" {path}"
        ) from None
    except (OSError, ValueError) as error:
        raise ProfileError(f"{path} is not a robot's profile: {error}") from None
    if not isinstance(data, dict) or data.pop("format", None) != FORMAT:
        raise ProfileError(f"{path} is not a robot's profile: it does not say that it is one")
    version = data.pop("version", None)
    if version != VERSION:
        raise ProfileError(
            f"{path} is a profile of version {version}, this program reads version {VERSION}"
        )
    try:
        profile = _ADAPTER.validate_python(data)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ProfileError(f"the profile {path} is damaged: {place}: {first['msg']}") from None
    wheels = profile.wheels
    if min(wheels.left, wheels.right, wheels.base) <= 0.0:
        raise ProfileError(f"the profile {path} is damaged: its wheels have no size")
    return profile


def save_profile(path: Path, profile: RobotProfile) -> None:
    """Write a profile; whoever reads the path sees the old one or the new one, whole.

    Raises:
        ProfileError: the file cannot be written.
    """
    contents = {"format": FORMAT, "version": VERSION, **asdict(profile)}
    write_atomically(path, to_json(contents, indent=2) + b"\n", ProfileError)


def change_profile(path: Path, note: tuple[str, str], **changes: Any) -> RobotProfile:
    """Replace parts of a profile, which need not be there yet, and note why.

    Raises:
        ProfileError: what is there is no profile, or cannot be written.
    """
    old = load_profile(path) if path.exists() else RobotProfile()
    new = replace(old, notes={**old.notes, note[0]: note[1]}, **changes)
    save_profile(path, new)
    return new
