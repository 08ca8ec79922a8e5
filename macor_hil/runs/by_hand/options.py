"""Options of a drive by hand, each declared once."""

from pathlib import Path
from typing import Annotated

from khepera_protocol.options import Cli
from khepera_protocol.zenoh.config import CONTROLLER_ENDPOINT
from pydantic import Field

from macor_hil.hardware.cameras.camera_watch import DEFAULT_LIMIT
from macor_hil.hardware.options import DeviceOptions, DriveOptions


class TeleopOptions(DriveOptions, DeviceOptions):
    """A drive by hand: what to drive, who may watch, and where it is recorded."""

    record: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None, description="Record the drive; macor-hil learn trains a map from it."
    )
    listen: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(CONTROLLER_ENDPOINT,), description="Where watchers find this controller."
    )
    stop_key: Annotated[bool, Cli(flags=("--stop-key",))] = Field(
        default=False, description="Let whoever reaches macor/NAME/stop end the drive."
    )
    camera_limit: float = Field(
        default=DEFAULT_LIMIT,
        ge=0.0,
        description="Seconds of driving without a usable picture before the robot is stopped; 0:"
        " look only when it stands.",
    )
