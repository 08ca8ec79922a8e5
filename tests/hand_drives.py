"""Drives by somebody else than the controller: keys of a terminal, twists of a ROS node."""

import threading
import time
from pathlib import Path

import zenoh
from drives import MACOR_HIL, Drive
from emulator_process import PATIENCE, free_endpoint
from khepera_protocol.zenoh.keys import CONTROLLER_ALIVE
from rig import RELAYED, Rig
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.telemetry.ros2.messages import cdr, header, twist
from macor_hil.telemetry.ros2.twists import Twists
from macor_hil.telemetry.session import open_session

DOMAIN = 7

TOPICS = [topic for topic, _ in Twists("/khepera").heard()]
FORWARD, TURNING = 0.1, 0.5


def teleop(bench: Rig, *more: str, port: str | Path | None = None) -> Drive:
    """A drive by keys on a terminal of its own, whose robot stands and waits for them."""
    line = ["--port", str(port or bench.link), "--baud", str(bench.baud)]
    pictures = ["--camera", f"zenoh:{RELAYED}" if bench.relay else "zenoh"]
    ends = ["--connect", bench.endpoint, "--listen", bench.controller_endpoint]
    drive = Drive(bench.controllers, [*MACOR_HIL, "teleop", *line, *pictures, *ends, *more])
    drive.wait_for(b"x: end")
    return drive


def driven_by_ros(bench: Rig, *more: str, port: str | Path | None = None) -> Drive:
    """A robot that hears ROS."""
    line = ["--port", str(port or bench.link), "--baud", str(bench.baud), "--domain", str(DOMAIN)]
    command = [*MACOR_HIL, "ros2", "--drive", *line, "--connect", bench.endpoint, *more]
    return Drive(bench.controllers, command)


class Joystick:
    """A ROS node that says where to go, in the same Zenoh network."""

    def __init__(
        self,
        session: zenoh.Session,
        stamped: bool = False,
        motion: tuple[float, float] = (FORWARD, TURNING),
    ) -> None:
        said = twist(*motion)
        message = ros.geometry_msgs__msg__TwistStamped(header(1, "base_link"), said)
        self._key = TOPICS[stamped].key(DOMAIN)
        self._data, self._session = cdr(message if stamped else said), session

    def push(self, bench: Rig) -> None:
        """Say it until the robot moves."""
        end = time.monotonic() + PATIENCE
        while bench.truth()[1] < 0.05:
            self.say()
            assert time.monotonic() < end, "the robot does not move"

    def say(self) -> None:
        time.sleep(0.02)  # as fast as a joystick
        self._session.put(self._key, self._data)


class HeldJoystick:
    """A joystick that is held, on a rig, until it is let go or the rig is made ready."""

    def __init__(self, bench: Rig, motion: tuple[float, float]) -> None:
        self._context = open_session([free_endpoint()], [bench.endpoint])
        self._session = self._context.__enter__()
        self._joystick = Joystick(self._session, motion=motion)
        self._controller: zenoh.LivelinessToken | None = None
        self._held = True
        self._hand = threading.Thread(target=self._hold)
        self._hand.start()
        bench.controllers.append(self)

    def let_go(self) -> None:
        """Say nothing more."""
        self._held = False
        self._hand.join()

    def join_a_controller(self) -> None:
        """Let a controller of that robot be there until the end."""
        key = CONTROLLER_ALIVE.of("khepera")
        self._controller = self._session.liveliness().declare_token(key)

    def close(self) -> None:
        self.let_go()
        self._context.__exit__(None, None, None)

    def _hold(self) -> None:
        while self._held:
            self._joystick.say()
