"""A robot in ROS 2 that is driven by ROS: its sensors are asked here, and `cmd_vel` moves it.

This program is then the client of the robot's serial line, and never beside a controller: it does
not begin while one of that robot's name is there, and while one comes the robot stands. Needs the
extra 'ros'.
"""

import time
from contextlib import ExitStack
from math import inf
from typing import Final, Self

import zenoh
from khepera_protocol.zenoh.keys import CONTROLLER_ALIVE

from macor_hil.errors import TelemetryError
from macor_hil.hardware.devices import robot_at
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.options import LineOptions
from macor_hil.hardware.robots.form import Reading
from macor_hil.hardware.robots.robot import Robot
from macor_hil.hardware.standstill import standing_on_failure
from macor_hil.runs.by_hand.rolling import LIMIT, Rolling
from macor_hil.safety.interruption import signals_taken_over
from macor_hil.telemetry.ros2.bridge import Bridge
from macor_hil.telemetry.ros2.messages import Frames
from macor_hil.telemetry.ros2.rmw_zenoh import namespace_of
from macor_hil.telemetry.ros2.twists import Twists

FARTHEST: Final = 0.1
"""Metres that a robot rolls within the limit."""

_BATTERY: Final = 5.0
"""Seconds between two questions for the battery."""

_A_MOMENT: Final = 0.03
"""Seconds for which samples are forwarded between two looks at the robot."""


def drive(
    session: zenoh.Session,
    name: str,
    domain: int,
    frames: Frames,
    line: LineOptions,
    settings: DriveSettings,
) -> None:
    """Be a robot's node in ROS 2 until Ctrl-C; the robot stands afterwards.

    Args:
        session: an open session.
        name: the robot's name in Zenoh keys; also the namespace of the topics.
        domain: ROS_DOMAIN_ID.
        frames: names of the robot's frames.
        line: its serial line.
        settings: how it is driven.

    Raises:
        TelemetryError: a controller drives the robot, or name or domain cannot be used.
        RobotError: the robot is not there, or fails. If it could not be stopped, the message says
            so.
    """
    twists = Twists(namespace_of(name))
    with ExitStack() as stack:
        interruption = stack.enter_context(signals_taken_over())
        bridge = stack.enter_context(Bridge(session, name, domain, frames, twists, settings.wheels))
        controllers = stack.enter_context(_Controllers(session, name))
        if controllers.there:
            raise TelemetryError(
                f"a controller drives {name}; end it first, or watch it without --drive"
            )
        robot = stack.enter_context(robot_at(line))
        node = _DrivenRobot(robot, bridge, twists, controllers, settings)
        try:
            # the inner one: the robot is stopped first
            with standing_on_failure(robot, FARTHEST):
                while True:
                    interruption.check()
                    node.turn()
        except KeyboardInterrupt:
            pass  # the way to end it


class _Controllers:
    """The controllers of a robot's name, known as soon as they come; use as a context.

    Attributes:
        there: whether there is one.
    """

    def __init__(self, session: zenoh.Session, name: str) -> None:
        key = CONTROLLER_ALIVE.of(name)
        self.there = any(True for _ in session.liveliness().get(key))
        self._subscriber = session.liveliness().declare_subscriber(key, self._meet, history=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._subscriber.undeclare()

    def _meet(self, token: zenoh.Sample) -> None:
        self.there = token.kind == zenoh.SampleKind.PUT


class _DrivenRobot:
    """A robot whose sensors are asked again and again, and that is moved in between."""

    def __init__(
        self,
        robot: Robot,
        bridge: Bridge,
        twists: Twists,
        controllers: _Controllers,
        settings: DriveSettings,
    ) -> None:
        self._robot = robot
        self._bridge = bridge
        self._twists = twists
        self._controllers = controllers
        self._rolling = Rolling(robot, settings)
        bridge.meet(robot.kind)
        self._asked_battery = -inf

    def turn(self) -> None:
        """Look, tell, and drive on as far as somebody says so.

        Raises:
            RobotError: the robot does not answer.
        """
        proximity = self._rolling.look()
        self._hear()
        counted = self._robot.clock()  # what is asked besides takes its time
        told = Reading(proximity=proximity, counters=self._rolling.roll())
        if (now := time.monotonic()) - self._asked_battery > _BATTERY:
            self._asked_battery = now
            told = told._replace(battery=self._robot.battery())
        self._bridge.sense(told, counted)
        while self._bridge.forward(0.0) and time.monotonic() - now < _A_MOMENT:
            pass

    def _hear(self) -> None:
        twist = self._twists.latest()
        if self._controllers.there:
            self._rolling.stop()
        elif twist is not None and time.monotonic() - twist.came < LIMIT:
            self._rolling.go(twist.forward, twist.turning)
