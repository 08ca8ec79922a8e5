"""The interpreters of an e-puck: text and binary rows on the line, packets on WiFi.

No I/O. Numbers that a request lacks are those of the request before, as on the robot.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from khepera_protocol.epuck import letters
from khepera_protocol.epuck.framing import Command, Sign
from khepera_protocol.epuck.letters import Line
from khepera_protocol.epuck.wifi import EMPTY, HEIGHT, PICTURE, SENSORS, WIDTH, WifiRequest
from khepera_protocol.serial.errors import RequestError

from khepera_emulator.robot.epuck import packets, rows
from khepera_emulator.robot.epuck.panel import COLOUR, Picture, switched
from khepera_emulator.robot.epuck.robot import Robot
from khepera_emulator.robot.epuck.senses.motion import digits
from khepera_emulator.robot.epuck.texts import (
    battery_line,
    help_lines,
    line,
    remote_line,
    version_lines,
)
from khepera_emulator.robot.kind import Console

_HARDWARE: Final = 0xFFF7
"""Number of the hardware that V tells: what an e-puck2 always says (a choice for the others)."""

_BUS_SILENT: Final = -1
"""Reading of a bus on which nothing answers (a choice)."""


class SerialFirmware:
    """Interpreter of one robot's line.

    Args:
        robot: what it reads and drives.
        console: the line beside the replies.
    """

    def __init__(self, robot: Robot, console: Console) -> None:
        self._robot = robot
        self._console = console
        self._generation = robot.choices.generation
        self._texts: dict[str, Callable[[Line], bytes]] = {
            "A": lambda _: line("a", *digits(robot.motion.acceleration(), robot.model.one_g)),
            "B": self._switch_body,
            "b": lambda _: self._tell_battery(),
            "C": lambda _: line("c", robot.choices.switches.selector),
            "D": self._drive,
            "E": lambda _: line("e", *robot.panel.speeds),
            "F": self._switch_front,
            "G": lambda _: remote_line(robot.panel.remote),
            "g": lambda _: line("g", *robot.gyro()),
            "H": lambda _: help_lines(
                self._generation, first_revision=robot.choices.switches.first_revision
            ),
            "I": lambda _: self._tell_picture(),
            "J": self._set_picture,
            "K": lambda _: self._calibrate(),
            "L": self._switch_led,
            "M": lambda _: line("m", *robot.ground()),
            "N": lambda _: line("n", *robot.proximity()),
            "O": lambda _: line("o", *robot.ambient()),
            "P": self._set_counters,
            "Q": lambda _: line("q", *(motor.counter for motor in robot.motors)),
            "R": lambda _: self._reset(),
            "S": lambda _: self._stop(),
            "T": self._play,
            "U": lambda _: line("u", *robot.volumes()[:3]),
            "V": lambda _: version_lines(self._generation, _HARDWARE),
            "W": self._write_bus,
            "X": self._count_off,
            "Y": self._read_bus,
            "Z": lambda _: b"",
        }

    def greeting(self) -> bytes:
        """Return what the robot says when it is switched on."""
        return letters.GREETING

    def execute(self, request: Line | Command | Sign) -> bytes:
        """Carry out a line, a command of a row, or the end of one; returns what is said at once."""
        if isinstance(request, Line):
            return self._answer(request)
        panel = self._robot.panel
        if isinstance(request, Command):
            return rows.carry_out(self._robot, request)
        if request is Sign.RESTART:
            self._robot.power_on()
            return self.greeting()
        said = bytes(panel.answers)
        panel.answers.clear()
        return said

    def _answer(self, request: Line) -> bytes:
        generation = self._generation
        letter = request.letter
        if letter not in generation.small:
            letter = letter.upper() if letter.isascii() else letter
        if letter in generation.silent:
            return b""
        if letter not in generation.letters:
            why = f"{generation.title} has no {letter!r}"
            self._console.on_refusal(request.text, RequestError(letters.NOT_FOUND, why))
            return line(letters.NOT_FOUND)
        return self._texts[letter](request)

    def _numbers(self, request: Line, letter: str, held: list[int]) -> list[int]:
        """Read numbers into those of the request before."""
        found = request.numbers(letter, len(held), self._generation.bits)
        held[: len(found)] = found
        return held

    def _action(self, request: Line, letter: str) -> int:
        panel = self._robot.panel
        (panel.action,) = self._numbers(request, letter, [panel.action])
        return panel.action

    def _switch_body(self, request: Line) -> bytes:
        panel = self._robot.panel
        panel.body = switched(panel.body, self._action(request, "B"))
        return line("b")

    def _switch_front(self, request: Line) -> bytes:
        panel = self._robot.panel
        panel.front = switched(panel.front, self._action(request, "F"))
        return line("f")

    def _switch_led(self, request: Line) -> bytes:
        panel = self._robot.panel
        panel.led, panel.action = self._numbers(request, "L", [panel.led, panel.action])
        panel.switch(panel.led, panel.action)
        return line("l")

    def _tell_battery(self) -> bytes:
        robot = self._robot
        _, empty, full = robot.model.battery
        if robot.choices.switches.first_revision:
            return line("b", int(robot.battery() > empty))
        return battery_line(robot.battery(), empty, full, generation=self._generation)

    def _drive(self, request: Line) -> bytes:
        left, right = self._numbers(request, "D", list(self._robot.panel.speeds))
        self._robot.drive(left, right)
        return line("d")

    def _set_counters(self, request: Line) -> bytes:
        robot = self._robot
        positions = self._numbers(request, "P", robot.panel.positions)
        for motor, value in zip(robot.motors, positions, strict=True):
            motor.counter = value
        return line("p")

    def _stop(self) -> bytes:
        robot = self._robot
        for motor in robot.motors:
            motor.drive(0)
        robot.panel.clear_ring()
        return line("s")

    def _tell_picture(self) -> bytes:
        picture = self._robot.panel.picture
        return line("i", picture.mode, picture.width, picture.height, picture.zoom, picture.size)

    def _set_picture(self, request: Line) -> bytes:
        panel, generation = self._robot.panel, self._generation
        before = panel.picture
        held = [before.mode, before.width, before.height, before.zoom]
        held += [-1, -1] if generation.window else []
        wanted = Picture(*self._numbers(request, "J", held))
        good = wanted.width > 0 and wanted.height > 0 and wanted.zoom > 0
        if not good or wanted.size > generation.most_picture:
            zoom = wanted.zoom if wanted.zoom > 0 else Picture().zoom
            wanted = replace(Picture(), zoom=zoom, left=wanted.left, top=wanted.top)
        panel.picture = wanted
        return line("j")

    def _calibrate(self) -> bytes:
        self._robot.calibrate()
        self._robot.panel.clear_ring()
        self._console.on_later(self._generation.calibration, line(letters.CALIBRATED))
        return line(letters.CALIBRATING)

    def _reset(self) -> bytes:
        self._robot.power_on()
        return line("r") + self.greeting()

    def _play(self, request: Line) -> bytes:
        panel = self._robot.panel
        (panel.tune,) = self._numbers(request, "T", [panel.tune])
        panel.sound = panel.tune if panel.tune in range(1, 6) else 0
        return line("t")

    def _count_off(self, request: Line) -> bytes:
        positions = self._robot.panel.positions
        (count,) = self._numbers(request, "X", [positions[0]])
        count = min(max(count, 0), self._generation.longest - len("x,\r\n"))
        positions[0] = 0
        return line("x", "1" * count)

    def _write_bus(self, request: Line) -> bytes:
        self._numbers(request, "W", self._robot.panel.bus)
        return line("w")

    def _read_bus(self, request: Line) -> bytes:
        bus = self._robot.panel.bus
        bus[:2] = self._numbers(request, "Y", bus[:2])
        bus[2] = _BUS_SILENT
        return line("y", *bus[:2]) + line("y", bus[2])


class WifiFirmware:
    """Interpreter of one e-puck2's packets on WiFi.

    Args:
        robot: what it reads and drives.
    """

    _PICTURE: Final = Picture(COLOUR, WIDTH, HEIGHT, 4)

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def execute(self, request: WifiRequest | Sign) -> bytes:
        """Carry out a packet; returns those that answer it: a picture, sensors, or an empty one."""
        robot = self._robot
        if not isinstance(request, WifiRequest):
            robot.power_on()
            return b""
        packets.actuate(robot, request.actuators)
        said = b""
        if request.pictures:
            said += bytes([PICTURE]) + robot.picture(self._PICTURE)
        if request.sensors:
            sensors = packets.sense(robot, last=int(robot.pressed))
            said += bytes([SENSORS]) + sensors.pack() + b"\0"
        return said or bytes([EMPTY])
