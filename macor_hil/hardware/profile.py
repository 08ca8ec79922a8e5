"""The profile of one robot: what was measured on it, in a file with a version, replaced whole.

`macor-hil camera --calibrate` writes where the mirror lies in the picture, `macor-hil calibrate`
what the wheels' counts mean; drivers, odometry and eyes use them.
"""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from khepera_protocol.mirror import StoredMirror
from khepera_protocol.text import printable
from pydantic import TypeAdapter
from pydantic_core import from_json, to_json

from macor_hil.errors import ProfileError
from macor_hil.files import MIB, InputError, checked, read_bounded, write_atomically
from macor_hil.hardware.odometry import Wheels

FORMAT: Final = "khepera profile"
VERSION: Final = 1


@dataclass(frozen=True, slots=True)
class RobotProfile:
    """Measurements of one robot.

    Attributes:
        mirror: where the mirror lies in the camera's picture; None: as the map says.
        wheels: what the wheels' counts mean.
        notes: when and how something was measured, a line for each.
    """

    mirror: StoredMirror | None = None
    wheels: Wheels = field(default_factory=Wheels)
    notes: dict[str, str] = field(default_factory=dict)


_ADAPTER = TypeAdapter(RobotProfile)
_MOST_BYTES: Final = MIB


def load_profile(path: Path) -> RobotProfile:
    """Read a profile.

    Raises:
        ProfileError: no such file, no profile, one of another version, or one that no robot has.
    """
    try:
        data: Any = from_json(read_bounded(path, _MOST_BYTES))
    except FileNotFoundError:
        raise ProfileError(
            f"there is no profile {path}; measure the wheels with: macor-hil calibrate --profile"
            f" {path}, or the mirror with: macor-hil camera --calibrate --profile {path}"
        ) from None
    except ValueError as error:  # an InputError, or no JSON
        raise ProfileError(f"{path} is not a robot's profile: {error}") from None
    if not isinstance(data, dict) or data.pop("format", None) != FORMAT:
        raise ProfileError(f"{path} is not a robot's profile: it does not say that it is one")
    version = data.pop("version", None)
    if version != VERSION:
        raise ProfileError(
            f"{path} is a profile of version {printable(str(version), 20)}, this program reads"
            f" version {VERSION}"
        )
    try:
        return checked(_ADAPTER, data)
    except InputError as error:
        raise ProfileError(f"the profile {path} is damaged: {error}") from None


def save_profile(path: Path, profile: RobotProfile) -> None:
    """Write a profile; whoever reads the path sees the old one or the new one, whole.

    Raises:
        ProfileError: the file cannot be written, or no robot is as it says.
    """
    data = asdict(profile)
    try:
        checked(_ADAPTER, data)
    except InputError as error:
        raise ProfileError(f"{path} is not written, as no robot is like that: {error}") from None
    contents = {"format": FORMAT, "version": VERSION, **data}
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
