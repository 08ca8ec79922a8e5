"""Leaving a robot standing, whatever happened."""

from types import TracebackType
from typing import Self

from macor_hil.commands import COMMANDS
from macor_hil.errors import RobotError
from macor_hil.interruption import Interruption
from macor_hil.robot import Khepera


class Standstill:
    """A context that leaves the robot standing; signals wait until it stands.

    Raises:
        RobotError: on the way out, if the robot has not confirmed that it stands.
    """

    def __init__(self, robot: Khepera, interruption: Interruption) -> None:
        self._robot = robot
        self._interruption = interruption

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        _: type[BaseException] | None,
        error: BaseException | None,
        __: TracebackType | None,
    ) -> None:
        self._interruption.hold()
        try:
            self._robot.halt()
        except RobotError as failure:
            way = max(command.way for command in COMMANDS)
            first = str(error) if isinstance(error, RobotError) else str(failure)
            raise RobotError(
                f"{first}; the robot has NOT confirmed a stop: it may still drive to the end of"
                f" its last command, {1000 * way:.0f} mm at most"
            ) from error
        finally:
            self._interruption.release()
