"""A training on a robot as a process of its own: `python training_process.py JSON`.

The JSON text holds `path` of the map, `port`, how many commands are `random`, and where they are
wanted `baud`, `camera`, Zenoh's `listen`, the emulator's `endpoint`, `zenoh_config`, and half-way
`trouble`: `full disk` (no file can grow) or `clock jump`. A line `step` is printed at the beginning
and for each command; at the end how many transitions the map holds, or the error.
"""

import json
import resource
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from as_type import as_type

from macor_hil.errors import MacorError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, limits_for
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.checkpoints import train_map
from macor_hil.runs.recovery import TrainingRecovery
from macor_hil.runs.training import Recovery, Schedule
from macor_hil.telemetry.session import open_session

TUNING = 15


def no_room() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))


def jump() -> None:
    read = time.time
    time.time = lambda: read() + 3600.0


TROUBLES = {"full disk": no_room, "clock jump": jump}


def train(
    path: str,
    port: str,
    *,
    random: int,
    trouble: str = "",
    baud: int = 9600,
    camera: str = "auto",
    **zenoh: str,
) -> Brain:
    schedule = Schedule(TUNING, random, 0, session=60, recovery=Recovery.BACK)
    settings = MindSettings()
    half = TUNING + random // 2

    def progress(done: int) -> None:
        print("step", flush=True)
        if trouble and done == half:
            TROUBLES[trouble]()

    with ExitStack() as stack:
        session = None
        if not PortAddress.parse(port).embedded:
            file = Path(zenoh["zenoh_config"]) if zenoh.get("zenoh_config") else None
            session = stack.enter_context(
                open_session([zenoh["listen"]], [zenoh["endpoint"]], file)
            )
        hardware = stack.enter_context(open_hardware(port, camera, baud=baud, session=session))
        eyes = CheckedCamera(hardware.camera, limits_for(settings.mirror))
        watch = stack.enter_context(CameraWatch(eyes))
        devices = Driver(hardware.robot, guard=watch.guard), eyes, None
        rescue = TrainingRecovery(hardware.robot, eyes)
        return train_map(Path(path), settings, schedule, "here", devices, progress, rescue, 1)


def main() -> None:
    try:
        brain = train(**json.loads(sys.argv[1]))
        known = as_type(SensorimotorMap, brain.memories["transitions"])
        print(int(known.transitions().z.sum()), flush=True)
    except MacorError as error:
        print(f"{type(error).__name__}: {error}", flush=True)


if __name__ == "__main__":
    main()
