"""All sensors and all actuators of an e-puck2 at once."""

from typing import Final

from khepera_protocol.epuck.letters import wrapped
from khepera_protocol.epuck.packets import Actuators, AllSensors, Behaviour, Sound

from khepera_emulator.robot.epuck.panel import switched
from khepera_emulator.robot.epuck.robot import Robot
from khepera_emulator.robot.epuck.senses import ground
from khepera_emulator.robot.epuck.senses.motion import spheric

ONE_G: Final = 768
"""Digits of 1 g where the offsets are removed."""

_TUNES: Final = {
    Sound.MARIO: 1,
    Sound.UNDERWORLD: 2,
    Sound.STAR_WARS: 3,
    Sound.HIGH_TONE: 4,
    Sound.LOW_TONE: 5,
    Sound.STOP: 0,
}
"""Numbers that T has for the sounds; of several the last one plays."""

_FIELD: Final = (20.0, 0.0, -40.0)
"""Magnetic field in uT: the same everywhere (a choice)."""


def sense(robot: Robot, last: int = 0) -> AllSensors:
    """Read all sensors."""
    felt = robot.motion.acceleration()
    x, y, z = (int(ONE_G * value) for value in felt)
    left, right = (wrapped(motor.counter, 16) for motor in robot.motors)
    floor = robot.ground()
    volumes = robot.volumes()
    return AllSensors(
        acceleration=(x, y, z),
        tilt=spheric(felt, ONE_G),
        gyro=robot.gyro(),
        magnetic=_FIELD,
        temperature=robot.temperature,
        proximity=robot.proximity(),
        ambient=robot.ambient(),
        distance=robot.distance(),
        volumes=volumes,
        steps=(left, right),
        battery=robot.battery(),
        card=0,
        remote=robot.panel.remote,
        selector=robot.choices.switches.selector,
        ground=(floor[0], floor[1], floor[2]),
        ground_ambient=(ground.AMBIENT,) * 3 if robot.choices.switches.ground else (0, 0, 0),
        last=last,
    )


def actuate(robot: Robot, wanted: Actuators) -> None:
    """Set all actuators."""
    panel = robot.panel
    if wanted.behaviour & Behaviour.CALIBRATE:
        robot.calibrate()
    robot.avoid_obstacles(bool(wanted.behaviour & Behaviour.AVOID))
    # the firmware puts the two bytes together without a sign
    left, right = (value & 0xFFFF for value in wanted.wheels)
    if wanted.behaviour & Behaviour.STEPS:
        panel.speeds[:] = left, right
        for motor, value in zip(robot.motors, (left, right), strict=True):
            motor.counter = value
    else:
        robot.drive(left, right)
    for bit, led in enumerate((0, 2, 4, 6)):
        panel.ring[led] = bool(wanted.leds >> bit & 1)
    panel.body = switched(panel.body, wanted.leds >> 4 & 1)
    panel.front = switched(panel.front, wanted.leds >> 5 & 1)
    show(robot, wanted.colours)
    for flag, tune in _TUNES.items():
        if wanted.sound & flag:
            panel.sound = tune


def show(robot: Robot, colours: tuple[int, ...] | bytes) -> None:
    """Set the four RGB LEDs, percent of red, green and blue each."""
    panel = robot.panel
    panel.colours[:] = colours
    for number in range(4):
        panel.ring[2 * number + 1] = any(panel.colours[3 * number : 3 * number + 3])
