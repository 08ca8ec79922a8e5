"""Keys that drive a robot, read from a terminal."""

import os
from enum import Enum
from typing import Final

from khepera_protocol.system.waiting import input_waits


class Key(Enum):
    """The meaning of a key."""

    STRAIGHT = "straight"
    LEFT = "left"
    RIGHT = "right"
    BACK = "back"
    TURN_LEFT = "turn left"
    TURN_RIGHT = "turn right"
    STOP = "stop"
    END = "end"


HELP: Final = (
    "w or up: straight on, a d or left right: an arc, s or down: back the way it came, q e: turn on"
    " the spot; space: stop, x: end"
)

_KEYS: Final = {
    b"w": Key.STRAIGHT,
    b"a": Key.LEFT,
    b"d": Key.RIGHT,
    b"s": Key.BACK,
    b"q": Key.TURN_LEFT,
    b"e": Key.TURN_RIGHT,
    b" ": Key.STOP,
    b"x": Key.END,
    b"\x04": Key.END,
}
_ARROWS: Final = {b"A": Key.STRAIGHT, b"B": Key.BACK, b"C": Key.RIGHT, b"D": Key.LEFT}
_ESCAPES: Final = (b"\x1b[", b"\x1bO")
"""Beginnings of an arrow's sequence, whose third byte tells which."""

_MOST: Final = 4096


class HaltError(Exception):
    """A key has been pressed that stops the robot while it drives."""


class Keyboard:
    """The keys of a terminal that passes them on singly.

    Args:
        descriptor: of the terminal.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._begun = b""
        self._waiting: list[Key] = []

    def guard(self) -> None:
        """See that the robot may drive on.

        Raises:
            HaltError: a key stops it, or the terminal has gone.
        """
        self._waiting += self._read(0.0)
        if any(key in (Key.STOP, Key.END) for key in self._waiting):
            raise HaltError

    def wait(self, seconds: float) -> Key | None:
        """Wait for a time until a key is pressed; return the last one, or None.

        What ends the drive counts before all others, and what stops the robot before the rest.
        """
        pressed = self._waiting or self._read(seconds)
        self._waiting = []
        for key in (Key.END, Key.STOP):
            if key in pressed:
                return key
        return pressed[-1] if pressed else None

    def _read(self, seconds: float) -> list[Key]:
        """Return the keys that were pressed; a terminal that has gone presses END."""
        if not input_waits(self._descriptor, seconds):
            return []
        try:
            data = os.read(self._descriptor, _MOST)
        except OSError:
            data = b""
        if not data:
            return [Key.END]
        keys, self._begun = keys_of(self._begun + data)
        return keys


def keys_of(data: bytes) -> tuple[list[Key], bytes]:
    """Return the keys of bytes of a terminal, and the beginning of an arrow at their end."""
    keys: list[Key] = []
    while data:
        if data[:2] in _ESCAPES:
            if len(data) < 3:
                return keys, data
            key, data = _ARROWS.get(data[2:3]), data[3:]
        elif data == _ESCAPES[0][:1]:
            return keys, data
        else:
            key, data = _KEYS.get(data[:1].lower()), data[1:]
        if key is not None:
            keys.append(key)
    return keys, b""
