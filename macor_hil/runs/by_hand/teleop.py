"""A drive by keys: each is one of the controller's own commands, told as its decisions are.

While the robot drives, the terminal is asked between any two requests: the stop key and a terminal
that has gone stop it at once, as signals and a failing camera do. Every other key waits until the
command has ended; of several the last one counts. A robot without keys stands.

What is told can be recorded and learned from (`recorded_drives`): a drive is as good as any.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import zenoh
from khepera_protocol.mirror import Mirror
from khepera_protocol.system.single_keys import single_keys

from macor_hil.commands import LONGEST_WAY
from macor_hil.errors import MacorError
from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.checked_camera import AHEAD, CheckedCamera, limits_for
from macor_hil.hardware.devices import hardware_at
from macor_hil.hardware.driver import Driver, all_of
from macor_hil.hardware.standstill import standing_on_failure
from macor_hil.runs.by_hand.drive import Drive
from macor_hil.runs.by_hand.keyboard import Keyboard
from macor_hil.runs.by_hand.options import TeleopOptions
from macor_hil.runs.by_hand.rolling import ALONE
from macor_hil.runs.by_hand.teller import Teller
from macor_hil.safety.claim import claim
from macor_hil.safety.interruption import Interruption, signals_taken_over
from macor_hil.telemetry.publisher import Publisher, PublishingCamera
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import stop_key

if TYPE_CHECKING:
    from macor_hil.telemetry.recordings.recorder import LiveRecorder

_REST: Final = 0.3
"""Seconds within which the last samples of a drive come to its recording."""

_PATIENCE: Final = 2.0
"""Seconds that a recording may take to be there for pictures."""


@dataclass(frozen=True, slots=True)
class DriveReport:
    """Outcome of a drive.

    Attributes:
        commands: how many were driven, to their end or to a collision.
        signal: what interrupted it, such as SIGTERM or the stop key; empty: a key of the terminal.
        samples: how many were recorded; None: it was not recorded.
    """

    commands: int
    signal: str
    samples: int | None


def teleop(options: TeleopOptions, terminal: int, say: Callable[[str], None]) -> DriveReport:
    """Drive a robot by the keys of a terminal until its end key; the robot stands afterwards.

    Args:
        options: what to drive.
        terminal: its descriptor.
        say: hears what was driven, a line each.

    Raises:
        MacorError: it is no terminal, or Zenoh, robot, camera or recording fail. If the robot
            could not be stopped, the message says so.
    """
    measured = options.measured()
    mirror = measured.mirror or Mirror()
    settings = options.drive_settings(measured.wheels)
    with (
        signals_taken_over() as interruption,
        _keys_of(terminal) as keyboard,
        open_session(options.listen, options.connect, options.zenoh_config) as session,
        _recording(options, session) as recorder,
    ):
        with (
            Publisher(session, options.robot) as publisher,
            _stop_key(options, session, interruption),
            hardware_at(options, session) as hardware,
        ):
            if recorder:
                _wait_until_heard(publisher, recorder)
            mirrored = not options.camera_address.needs_client
            limits = limits_for(mirror) if mirrored else AHEAD
            camera = CheckedCamera(hardware.camera, limits)
            teller = Teller(publisher, options, settings.wheels, mirror)
            with (
                CameraWatch(camera, options.camera_limit) as watch,
                teller.telling(hardware.robot),
            ):
                drive = Drive(
                    Driver(
                        hardware.robot,
                        settings,
                        all_of(interruption.check, watch.guard, publisher.check, keyboard.guard),
                        alone=ALONE,
                    ),
                    hardware.robot,
                    PublishingCamera(camera, publisher.frame),
                    teller,
                    say,
                )

                def look_after() -> None:
                    interruption.check()
                    publisher.check()
                    if recorder:
                        recorder.take(0.0)

                try:
                    # the inner one: the robot is stopped first
                    with standing_on_failure(hardware.robot, LONGEST_WAY):
                        drive.until_the_end(keyboard, look_after)
                except KeyboardInterrupt:
                    teller.ending = f"interrupted by {interruption.name}"
        if recorder:
            recorder.take(_REST)
        samples = recorder.recorded.samples if recorder else None
        return DriveReport(teller.driven, interruption.name, samples)


@contextmanager
def _keys_of(terminal: int) -> Iterator[Keyboard]:
    with ExitStack() as stack:
        try:
            stack.enter_context(single_keys(terminal))
        except OSError as error:
            raise MacorError(
                f"the keys that drive are read from a terminal: {error.strerror or error}"
            ) from None
        yield Keyboard(terminal)


@contextmanager
def _recording(options: TeleopOptions, session: zenoh.Session) -> Iterator["LiveRecorder | None"]:
    if options.record is None:
        yield None
        return
    from macor_hil.telemetry.recordings.recorder import LiveRecorder

    with (
        claim(options.record),
        LiveRecorder(session, options.robot, options.record) as recorder,
    ):
        yield recorder


def _wait_until_heard(publisher: Publisher, recorder: "LiveRecorder") -> None:
    """Wait, for a while, until the recording gets pictures: nobody takes them before."""
    end = time.monotonic() + _PATIENCE
    while not publisher.seen and time.monotonic() < end:
        recorder.take(_REST / 10)


def _stop_key(
    options: TeleopOptions, session: zenoh.Session, interruption: Interruption
) -> AbstractContextManager[object]:
    if not options.stop_key:
        return nullcontext()
    return stop_key(session, options.robot, interruption.ask)
