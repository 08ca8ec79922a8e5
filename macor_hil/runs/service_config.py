"""What a live run is told, and what comes of it."""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from khepera_protocol.zenoh.payloads import CONTROLLER_ENDPOINT, DEFAULT_ENDPOINT, Pose

from macor_hil.hardware.cameras.watchdog import DEFAULT_LIMIT
from macor_hil.hardware.driver import DriveSettings
from macor_hil.runs.trials import MAX_COMMANDS


@dataclass(frozen=True, slots=True)
class ServiceConfig:
    """What to drive, with what, and who may watch.

    Attributes:
        port: serial device or pySerial URL.
        map_file: what has been learned.
        camera: see `macor_hil.hardware.devices.open_hardware`.
        baud: rate of the serial line, bits a second.
        planner: a name in `PLANNERS`.
        commands: commands after which the run ends.
        robot: its name in Zenoh keys.
        listen: Zenoh endpoints where watchers find the controller.
        connect: Zenoh endpoints of the emulator and other peers. With neither of them, and no
            `zenoh_config`, there is no Zenoh session at all.
        seed: of the random commands where the map knows of none.
        start: where odometry begins.
        drive: how commands are driven, and the wheels that odometry counts with.
        profile: what was measured on this robot; its wheels and mirror count instead of those of
            `drive` and of the map.
        zenoh_config: Zenoh's own configuration, instead of `listen` and `connect`.
        stop_key: whether whoever reaches the stop key may end the run.
        camera_limit: seconds of driving without a usable picture; 0: look only when standing.
        planner_limit: seconds of planning after which watchers are told that it takes long.
        recovery: seconds to go on trying when robot or camera fail; 0: a failure ends the run.
    """

    port: str
    map_file: Path
    camera: str = "auto"
    baud: int = 9600
    planner: str = "anticipative"
    commands: int = MAX_COMMANDS
    robot: str = "khepera"
    listen: tuple[str, ...] = (CONTROLLER_ENDPOINT,)
    connect: tuple[str, ...] = (DEFAULT_ENDPOINT,)
    seed: int = 1
    start: Pose = field(default_factory=lambda: Pose(x=0.0, y=0.0, heading=0.0))
    drive: DriveSettings = field(default_factory=DriveSettings)
    profile: Path | None = None
    zenoh_config: Path | None = None
    stop_key: bool = False
    camera_limit: float = DEFAULT_LIMIT
    planner_limit: float = 0.5
    recovery: float = 30.0


class Ending(StrEnum):
    """Why a run ended, where nothing failed."""

    COMMANDS = "all commands driven"
    COLLISION = "collision"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class RunReport:
    """What came of a run.

    Attributes:
        ending: why it ended.
        commands: how many were driven, a colliding one included.
        reinforcement: their sum.
        signal: what interrupted it, such as SIGTERM or the stop key; empty otherwise.
        recoveries: failures of robot or camera that it got over; each cost a command.
    """

    ending: Ending
    commands: int
    reinforcement: float
    signal: str = ""
    recoveries: int = 0

    @property
    def collided(self) -> bool:
        """Whether a collision ended the run."""
        return self.ending is Ending.COLLISION
