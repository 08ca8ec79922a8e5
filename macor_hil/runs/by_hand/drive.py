"""Effects of keys: commands that are told as decisions, and ways back after a collision."""

from collections.abc import Callable
from math import radians
from typing import Final

from macor_hil.commands import COMMANDS, MotorCommand
from macor_hil.hardware.cameras import Camera, Frame
from macor_hil.hardware.driver import Driver
from macor_hil.hardware.robots.robot import Robot
from macor_hil.runs.by_hand.keyboard import HELP, HaltError, Key, Keyboard
from macor_hil.runs.by_hand.teller import Teller

_LOOK: Final = 0.05
"""Seconds to wait for a key before other things are looked after."""

_ARCS: Final = {Key(command.name): command for command in COMMANDS}
_TURNS: Final = {Key.TURN_LEFT: radians(30.0), Key.TURN_RIGHT: radians(-30.0)}


class Drive:
    """A drive of one robot.

    Args:
        driver: of the robot; its guard is the keyboard's, among others.
        robot: the robot.
        camera: looked through before and after each command.
        teller: tells watchers.
        say: hears a line for each key.
    """

    def __init__(
        self,
        driver: Driver,
        robot: Robot,
        camera: Camera,
        teller: Teller,
        say: Callable[[str], None],
    ) -> None:
        self._driver = driver
        self._robot = robot
        self._camera = camera
        self._teller = teller
        self._say = say
        self._seen: Frame | None = None  # since the robot came to where it stands
        self._blocked = False

    def until_the_end(self, keyboard: Keyboard, look_after: Callable[[], None]) -> None:
        """Do what keys say until one ends it; meanwhile look after other things while it stands.

        Raises:
            RobotError, CameraError: the hardware fails; the robot has been stopped.
        """
        self._begin()
        self._say(HELP)
        while (key := keyboard.wait(_LOOK)) is not Key.END:
            look_after()
            try:
                self._do(key)
            except HaltError:
                self._begin()
                self._say("stopped")

    def _begin(self) -> None:
        """Begin where the robot stands, with nothing behind it."""
        self._teller.move_to(self._robot.counters())
        self._driver.start()
        self._teller.begin()
        self._seen = None

    def _do(self, key: Key | None) -> None:
        """Do what a key says.

        Raises:
            HaltError: a key has stopped the robot.
        """
        if key in _ARCS:
            self._go(_ARCS[key])
        elif key is Key.BACK or key in _TURNS:
            if key is Key.BACK:
                self._driver.back_off(1)
            else:
                self._driver.turn(_TURNS[key])
            self._teller.move_to(self._robot.counters())
            self._seen, self._blocked = None, False
            self._say(key.value)
        elif key is Key.STOP:
            self._robot.stop()

    def _go(self, command: MotorCommand) -> None:
        if self._blocked:
            self._say("something is in the way: s drives back, q and e turn on the spot")
            return
        before = self._seen or self._camera.grab()
        outcome = self._driver.execute(command)
        self._seen = self._camera.grab()
        decision = self._teller.count(command, before, outcome)
        self._blocked = outcome.collided
        end = "  COLLISION" if outcome.collided else ""
        self._say(f"{decision.sequence:3}  {command.name:8}  r {decision.reinforcement:.2f}{end}")
