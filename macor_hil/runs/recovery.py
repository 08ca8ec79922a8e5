"""Keeps a training on a robot going: waits for robot and camera, and asks for a hand."""

from collections.abc import Callable
from typing import Final

from macor_hil.errors import CameraError, MacorError, RobotError
from macor_hil.hardware.cameras.checks import CheckedCamera, is_hopeless
from macor_hil.hardware.khepera import Khepera

Ask = Callable[[str], None]
"""Shows what a hand is needed for, and returns when that has been done."""

_PAUSE: Final = 0.2


class Caretaker:
    """Gets a robot in training over what befalls it.

    Args:
        robot, camera: what fails.
        ask: asks an operator; None: there is none, and what needs a hand is an error.
        patience: seconds to wait before a hand is asked for.
    """

    def __init__(
        self, robot: Khepera, camera: CheckedCamera, ask: Ask | None = None, patience: float = 30.0
    ) -> None:
        self._robot = robot
        self._camera = camera
        self._ask = ask
        self._patience = patience

    def get_over(self, error: RobotError | CameraError) -> None:
        """Stop the robot, and wait until it and its camera work again.

        Raises:
            RobotError, CameraError: they do not, and nobody can help; or the camera never worked.
        """
        if is_hopeless(error, self._camera):
            raise error
        while True:
            try:
                self._robot.recover(self._patience)
                self._wait_for_a_picture()
            except (RobotError, CameraError) as still:
                self.need_a_hand(f"{error}. It did not go away by itself: {still}", still)
            else:
                return

    def need_a_hand(self, what: str, failure: MacorError) -> None:
        """Have an operator see to something.

        Raises:
            MacorError: there is no operator: the failure that was given.
        """
        if self._ask is None:
            raise failure
        self._ask(what)

    def stuck(self) -> None:
        """Driving back does not free the robot.

        Raises:
            RobotError: nobody can help.
        """
        what = "the robot touches something wherever it turns; put it on free floor"
        self.need_a_hand(what, RobotError(what))

    def _wait_for_a_picture(self) -> None:
        deadline = self._robot.clock() + self._patience
        while True:
            try:
                self._camera.grab()
            except CameraError:
                if self._robot.clock() > deadline:
                    raise
                self._robot.wait(_PAUSE)
            else:
                return
