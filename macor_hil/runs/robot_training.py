"""Training on open hardware: with the emulator's reset, or as on a robot that nobody carries."""

from collections.abc import Callable

from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, limits_of
from macor_hil.hardware.devices import Hardware
from macor_hil.hardware.driver import Driver, DriveSettings, all_of
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.checkpoints import train_map
from macor_hil.runs.options import TrainOptions
from macor_hil.runs.recovery import Ask, TrainingRecovery
from macor_hil.runs.training import Recovery


def train_on(
    hardware: Hardware,
    options: TrainOptions,
    settings: MindSettings,
    check: Callable[[], None],
    progress: Callable[[int], None],
    ask: Ask | None,
) -> Brain:
    """Train a map to its end, from its checkpoint if there is one.

    Args:
        hardware: open.
        options: what is trained, where to, and how much.
        settings: what is learned by.
        check: raises where the training is to end.
        progress: hears how many commands have been driven in all.
        ask: asks an operator for help; None: there is none.

    Raises:
        MapError: see `train_map`.
        RobotError, CameraError, BenchError: the hardware or the emulator fails.
    """
    robot, place = hardware.robot, (options.map_file, settings, options.schedule, options.port)
    drive = DriveSettings(wheels=options.measured().wheels, speed=options.speed)
    eyes = CheckedCamera(hardware.camera, limits_of(build_brain(settings).eyes))
    if options.schedule.recovery is Recovery.RESET:
        return train_map(
            *place, (Driver(robot, drive, check, patient=True), eyes, hardware.bench), progress
        )
    with CameraWatch(eyes) as watch:
        driver = Driver(robot, drive, all_of(check, watch.guard))
        rescue = TrainingRecovery(robot, eyes, ask)
        return train_map(*place, (driver, eyes, None), progress, rescue, 1)
