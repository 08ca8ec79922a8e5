"""Options of a robot's serial line, camera and wheels, each declared once."""

from pathlib import Path
from typing import Annotated, Final

from khepera_protocol.options import Cli
from khepera_protocol.zenoh.config import DEFAULT_ENDPOINT
from pydantic import BaseModel, ConfigDict, Field

from macor_hil.hardware.address import DEFAULT_PORT, DEFAULT_SEED, PortAddress
from macor_hil.hardware.cameras.catalogue import AUTO, CAMERAS, CameraAddress
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.profile import RobotProfile, load_profile
from macor_hil.hardware.robots.robot import RobotKind

_DRIVE: Final = DriveSettings()


class Options(BaseModel):
    """Options that do not change once they are given."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class LineOptions(Options):
    """The serial line."""

    port: str = Field(
        default=DEFAULT_PORT,
        description="Serial device or pySerial URL; khepera://ARENA is a robot in-process.",
    )
    baud: int = Field(default=9600, ge=1200, description="Rate of the serial line, bits a second.")
    robot_kind: RobotKind = Field(
        default=RobotKind.AUTO,
        description="Kind of robot at the port; auto: whichever answers (an e-puck's line is at"
        " --baud 115200).",
    )

    @property
    def address(self) -> PortAddress:
        """The port's address."""
        return PortAddress.parse(self.port)


class ZenohConfigOptions(Options):
    """A configuration file of Zenoh."""

    zenoh_config: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None,
        description="Zenoh's own configuration (JSON5), for routers, TLS and access control;"
        " overrides --listen and --connect. Examples: docs/zenoh.",
    )


class ZenohOptions(ZenohConfigOptions):
    """The robot's name, and how its emulator is reached."""

    robot: Annotated[str, Cli(metavar="NAME")] = Field(
        default="khepera", description="The robot's name in Zenoh keys."
    )
    connect: Annotated[tuple[str, ...], Cli(metavar="ENDPOINT")] = Field(
        default=(DEFAULT_ENDPOINT,), description="Zenoh peers, there now or later."
    )


class DeviceOptions(ZenohOptions, LineOptions):
    """A robot's serial line and its camera."""

    camera: Annotated[str, Cli(names=CAMERAS.names)] = Field(
        default=AUTO,
        description="auto, port, zenoh\\[:KEY], video:DEVICE, video:FILE or images:FOLDER;"
        " kinds are {names}; or a class of your own.",
    )

    @property
    def camera_address(self) -> CameraAddress:
        """The camera's address.

        Raises:
            CameraError: there is no such kind of camera.
        """
        return CameraAddress.parse(self.camera, self.address)


class SpeedOptions(Options):
    """Speed of a robot."""

    speed: int = Field(
        default=_DRIVE.speed,
        ge=1,
        le=127,
        description="Greatest speed of a wheel, counts / 10 ms (8 mm/s each).",
    )


class ProfileOptions(Options):
    """Profile of a robot."""

    profile: Annotated[Path | None, Cli(metavar="FILE")] = Field(
        default=None,
        description="What was measured on this robot: its wheels, its camera's mirror.",
    )

    def measured(self) -> RobotProfile:
        """Read the profile; without one a robot is as it is delivered.

        Raises:
            ProfileError: the file cannot be used.
        """
        return load_profile(self.profile) if self.profile else RobotProfile()


class DriveOptions(ProfileOptions, SpeedOptions):
    """Settings of the driver."""

    acceleration: int = Field(
        default=_DRIVE.acceleration,
        ge=1,
        le=255,
        description="Acceleration of a wheel, in the units of the command J.",
    )
    infrared: int = Field(
        default=_DRIVE.collision,
        ge=1,
        le=1023,
        description="Proximity reading from which on the robot stops: it counts as touching.",
    )

    def drive_settings(self, wheels: Wheels) -> DriveSettings:
        """Return settings of the driver of a robot with these wheels."""
        return DriveSettings(wheels, self.speed, self.acceleration, self.infrared)


class SeedOptions(Options):
    """The seed."""

    seed: int = Field(default=DEFAULT_SEED, ge=0, description="Seed of all random choices.")
