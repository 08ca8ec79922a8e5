"""No way out of a drive leaves the robot driving.

Whatever drives does so within two nets:

* `Driver` (driver.py): whatever is raised while wheels turn (Ctrl-C, SIGTERM, SIGHUP, an error, a
  defect) leaves its methods after the robot stands. It drives arcs to a target, at whose end a
  robot comes to rest by itself; a speed is held for a time only, while the driver looks on.
* `LineClient` (robots/client.py): stops its robot when it is closed, when nobody refers to it any
  more, and when the interpreter ends.

What is left are ways out that no program sees: SIGKILL, SIGSTOP, a pulled cable (docs/safety.md).
"""

from collections.abc import Iterator
from contextlib import contextmanager

from macor_hil.errors import NotStoppedError, RobotError
from macor_hil.hardware.robots.robot import Robot
from macor_hil.safety.interruption import undisturbed


@contextmanager
def standing_on_failure(robot: Robot, way: float) -> Iterator[None]:
    """Stop the robot before anything that is raised within goes on; signals wait until it stands.

    Args:
        robot: what is driven within.
        way: metres that it may still drive if it cannot be stopped.

    Raises:
        NotStoppedError: the robot has not confirmed that it stands.
    """
    try:
        yield
    except NotStoppedError:
        raise  # who was within has tried
    except BaseException as error:
        with undisturbed():
            try:
                robot.halt()
            except RobotError as failure:
                first = str(error) if isinstance(error, RobotError) else str(failure)
                raise NotStoppedError(
                    f"{first}; the robot has NOT confirmed a stop: it may still drive to the end"
                    f" of its last command, {1000 * way:.0f} mm at most"
                ) from error
        raise
