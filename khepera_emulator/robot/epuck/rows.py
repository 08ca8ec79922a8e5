"""Commands of binary rows: each adds its answer to the row's, or sets something."""

import struct
from collections.abc import Callable
from typing import Final

from khepera_protocol.epuck.codes import pack, unpack
from khepera_protocol.epuck.framing import Command
from khepera_protocol.epuck.packets import Actuators

from khepera_emulator.robot.epuck.packets import actuate, sense, show
from khepera_emulator.robot.epuck.panel import switched
from khepera_emulator.robot.epuck.robot import Robot
from khepera_emulator.robot.epuck.senses.motion import digits, spheric

_BODY, _FRONT = 8, 9
_SILENT_BYTE: Final = 0xFF
"""Reading of a bus on which nothing answers, as a byte (a choice)."""

_LAST_SAMPLE: Final = 99

_Answer = Callable[[Robot, bytes], bytes]


def carry_out(robot: Robot, command: Command) -> bytes:
    """Carry out a command; its answer goes to the row's, what is returned is sent at once."""
    name = command.code.name
    robot.panel.answers += _ANSWERS[name](robot, command.parameters)
    return robot.sound() if name == "U" and command.code.answer else b""


def _numbers(robot: Robot, parameters: bytes) -> list[int]:
    """Return two numbers as the robot's compiler puts them together."""
    return list(unpack(parameters, signed=not robot.choices.generation.unsigned_bytes))


def _acceleration(robot: Robot, _: bytes) -> bytes:
    return pack(digits(robot.motion.acceleration(), robot.model.one_g))


def _spheric(robot: Robot, _: bytes) -> bytes:
    return struct.pack("<3f", *spheric(robot.motion.acceleration(), robot.model.one_g))


def _battery(robot: Robot, _: bytes) -> bytes:
    if robot.choices.switches.first_revision:
        return pack([int(robot.battery() > robot.model.battery[1])])
    return pack([robot.battery()])


def _drive(robot: Robot, parameters: bytes) -> bytes:
    left, right = _numbers(robot, parameters)
    robot.drive(left, right)
    return b""


def _picture(robot: Robot, _: bytes) -> bytes:
    picture = robot.panel.picture
    head = bytes(value & 0xFF for value in (picture.mode, picture.width, picture.height))
    return head + robot.picture(picture)


def _led(robot: Robot, parameters: bytes) -> bytes:
    panel, (led, action) = robot.panel, parameters
    if led == _BODY:
        panel.body = switched(panel.body, action)
    elif led == _FRONT:
        panel.front = switched(panel.front, action)
    else:
        panel.switch(led, action)
    return b""


def _floor(robot: Robot, _: bytes) -> bytes:
    # the e-puck2's loop ends one cliff sensor early
    return pack(robot.ground()[: 4 if robot.choices.generation.bits > 16 else None])


def _counters(robot: Robot, parameters: bytes) -> bytes:
    robot.panel.positions[:] = _numbers(robot, parameters)
    for motor, value in zip(robot.motors, robot.panel.positions, strict=True):
        motor.counter = value
    return b""


def _sounds(robot: Robot, _: bytes) -> bytes:
    # the first generation's buffer has gone at once: here is the number of its last sample
    return bytes([_LAST_SAMPLE]) if not robot.choices.generation.unsigned_bytes else b""


def _temperature(robot: Robot, _: bytes) -> bytes:
    # the e-puck2's firmware asks for the wrong case
    known = not (robot.choices.generation.unsigned_bytes or robot.choices.switches.first_revision)
    return bytes([robot.temperature if known else 0])


def _actuators(robot: Robot, parameters: bytes) -> bytes:
    actuate(robot, Actuators.unpack(parameters))
    return b""


def _colours(robot: Robot, parameters: bytes) -> bytes:
    show(robot, parameters)
    return b""


def _magnetometer(_: Robot, __: bytes) -> bytes:
    return b"\0"


def _scanning(robot: Robot, parameters: bytes) -> bytes:
    robot.panel.scanning = parameters[0] in (1, 2)
    return b"\0"


def _ranging(robot: Robot, parameters: bytes) -> bytes:
    robot.panel.ranging = bool(parameters[0])
    return b"\0"


_ANSWERS: Final[dict[str, _Answer]] = {
    "a": _acceleration,
    "A": _spheric,
    "b": _battery,
    "D": _drive,
    "E": lambda robot, _: pack(robot.panel.speeds),
    "g": lambda robot, _: pack(robot.gyro()),
    "I": _picture,
    "L": _led,
    "M": _floor,
    "N": lambda robot, _: pack(robot.proximity()),
    "O": lambda robot, _: pack(robot.ambient()),
    "P": _counters,
    "Q": lambda robot, _: pack(motor.counter for motor in robot.motors),
    "t": _temperature,
    "u": lambda robot, _: pack(robot.volumes()[:3]),
    "U": _sounds,
    "W": lambda _, __: b"",
    "w": lambda _, __: b"",
    "Y": lambda _, __: bytes([_SILENT_BYTE]),
    "0xF8": lambda robot, _: sense(robot).pack(),
    "0xF7": _actuators,
    "0xF6": _colours,
    "0xF5": lambda robot, _: bytes([robot.pressed]),
    "0xF4": lambda robot, _: pack(robot.volumes()),
    "0xF3": lambda robot, _: pack([robot.distance()]),
    "0xF2": lambda _, __: bytes([0]),
    "0xF1": _magnetometer,
    "0xF0": _scanning,
    "0xEF": _ranging,
}
