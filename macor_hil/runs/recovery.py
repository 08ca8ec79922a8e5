"""Waiting for robot and camera: until they are there, and until they work again."""

import time
from collections.abc import Callable
from typing import Final, TypeVar

from macor_hil.errors import CameraError, MacorError, RobotError, is_lost
from macor_hil.hardware.cameras.checked_camera import CheckedCamera, is_hopeless
from macor_hil.hardware.robots.robot import Robot

_T = TypeVar("_T")

Ask = Callable[[str], None]
"""Shows what an operator is needed for, and returns when that has been done."""

_SLICE: Final = 1.0
"""Seconds of waiting for the robot between two looks at whether the program is to end."""

_PAUSE: Final = 0.2

_LONGEST_PAUSE: Final = 30.0
"""Seconds between two attempts of a run that never gives up."""


def wait_until_both_work(
    robot: Robot,
    camera: CheckedCamera,
    patience: float,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Stop the robot, and wait until it and its camera work again.

    Args:
        robot: client of the serial line.
        camera: of the robot.
        patience: seconds to go on trying.
        check: raises where the program is to end.

    Raises:
        RobotError, CameraError: they do not work in time.
    """
    deadline = robot.clock() + patience
    for attempt in (lambda: robot.recover(_SLICE), camera.grab):
        while not _works(attempt, camera, last=robot.clock() > deadline, check=check):
            robot.wait(_PAUSE)


def _works(
    attempt: Callable[[], object], camera: CheckedCamera, *, last: bool, check: Callable[[], None]
) -> bool:
    """Try something; what fails for the last time, or cannot come to work, is raised."""
    check()
    try:
        attempt()
    except (RobotError, CameraError) as error:
        if last or not (is_lost(error) or camera.worked):
            raise
        return False
    return True


def wait_for(
    attempt: Callable[[], _T],
    patience: float,
    check: Callable[[], None],
    missing: Callable[[str], object],
) -> _T:
    """Wait for a device that is not there yet.

    Args:
        attempt: opens it.
        patience: seconds to go on trying.
        check: raises where the program is to end.
        missing: told why it is not there, whenever that changes.

    Raises:
        RobotError, CameraError: it does not come in time, or will never fit.
    """
    deadline, said = time.monotonic() + patience, ""
    while True:
        check()
        try:
            return attempt()
        except (RobotError, CameraError) as error:
            if not is_lost(error) or time.monotonic() >= deadline:
                raise
            if str(error) != said:
                said = str(error)
                missing(said)
        time.sleep(_PAUSE)


def pause(seconds: float, check: Callable[[], None]) -> None:
    """Let time pass while the robot stands.

    Args:
        seconds: how long.
        check: raises where the program is to end.
    """
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        check()
        time.sleep(_PAUSE)


def longer_and_longer(attempt: int) -> float:
    """Return seconds to stand before an attempt, from 1 on: twice as many each time, to a limit."""
    # the exponent has a limit, too: attempts go on for weeks
    return min(2.0 ** min(attempt, 10), _LONGEST_PAUSE)


class TrainingRecovery:
    """Recovery of a training: it waits for robot and camera, and asks an operator for help.

    Args:
        robot, camera: what fails.
        ask: asks an operator; None: there is none, and what needs one is an error.
        patience: seconds to wait before an operator is asked.
    """

    def __init__(
        self, robot: Robot, camera: CheckedCamera, ask: Ask | None = None, patience: float = 30.0
    ) -> None:
        self._robot = robot
        self._camera = camera
        self._ask = ask
        self._patience = patience

    def recover(self, error: RobotError | CameraError) -> None:
        """Stop the robot, and wait until it and its camera work again.

        Raises:
            RobotError, CameraError: they do not, and nobody can help; or the camera never worked.
        """
        if is_hopeless(error, self._camera):
            raise error
        while True:
            try:
                wait_until_both_work(self._robot, self._camera, self._patience)
            except (RobotError, CameraError) as still:
                self.ask_for_help(f"{error}. It did not go away by itself: {still}", still)
            else:
                return

    def ask_for_help(self, what: str, failure: MacorError) -> None:
        """Have an operator see to something.

        Raises:
            MacorError: there is no operator: the failure that was given.
        """
        if self._ask is None:
            raise failure
        self._ask(what)

    def free(self) -> None:
        """Have a robot freed that touches something wherever it turns.

        Raises:
            RobotError: nobody can help.
        """
        what = "the robot touches something wherever it turns; put it on free floor"
        self.ask_for_help(what, RobotError(what))
