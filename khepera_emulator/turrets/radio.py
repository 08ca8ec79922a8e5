"""The radio turret: up to 16 bytes from robot to robot.

A message is on the air for `AIR_TIME`. Then it lies in the receiver's buffer, or the sender's
status says that it failed: because nobody has that number, or because the receiver has not yet
read the message before. Reading takes the message out; an empty buffer reads as zeros.
"""

from typing import Final, NamedTuple

from khepera_protocol.serial.turrets import (
    RADIO_BYTES,
    RADIO_FAILED,
    RADIO_READY,
    RADIO_RECEIVED,
    TURRETS,
)

from khepera_emulator.errors import EmulatorError
from khepera_emulator.turrets.turret import Values

AIR_TIME: Final = 0.050
"""Seconds that a message takes (a choice): about 20 bytes at 4800 bits a second."""

HIGHEST_NUMBER: Final = 255

_EMPTY: Final = (0,) * (2 + RADIO_BYTES)


class RadioMedium:
    """The air that the robots of one world share."""

    def __init__(self) -> None:
        self._stations: dict[int, Radio] = {}

    def join(self, number: int, station: "Radio") -> None:
        """Let a station, or the one that takes its place after a reset, listen to a number.

        Raises:
            EmulatorError: no number of a robot.
        """
        if not 0 <= number <= HIGHEST_NUMBER:
            raise EmulatorError(f"a radio's number is 0 to {HIGHEST_NUMBER}, not {number}")
        self._stations[number] = station

    def leave(self, number: int) -> None:
        """Let nobody listen to a number any more."""
        self._stations.pop(number, None)

    def deliver(self, message: "RadioMessage") -> bool:
        """Bring a message to its receiver; False if there is none, or it takes no message."""
        station = self._stations.get(message.receiver)
        return station is not None and station.take(message)


class RadioMessage(NamedTuple):
    """Bytes on their way from one robot's number to another's."""

    sender: int
    receiver: int
    length: int
    data: tuple[int, ...]


class Radio:
    """The radio turret of one robot.

    Args:
        medium: the air.
        number: what other robots call this one.
    """

    kind = TURRETS["radio"]

    def __init__(self, medium: RadioMedium, number: int) -> None:
        self._medium = medium
        self._number = number
        medium.join(number, self)
        self.power_on()

    def power_on(self) -> None:
        """Begin with nothing received and nothing sent."""
        self._received: RadioMessage | None = None
        self._sending: RadioMessage | None = None
        self._sent_by = 0.0
        self._failed = False

    def step(self, now: float) -> None:
        """Deliver what has been on the air long enough."""
        if self._sending is not None and now >= self._sent_by:
            self._failed = not self._medium.deliver(self._sending)
            self._sending = None

    def take(self, message: RadioMessage) -> bool:
        """Receive a message; refused while one is unread, and while this radio itself sends."""
        if self._received is not None or self._sending is not None:
            return False
        self._received = message
        return True

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        """Carry out a message of the robot's."""
        match letter:
            case "B":
                return 1, 0
            case "F":
                return (self._status(),)
            case "R":
                return self._read()
            case _:
                self._send(arguments, now)
                return ()

    def _status(self) -> int:
        ready = 0 if self._sending else RADIO_READY
        received = RADIO_RECEIVED if self._received else 0
        return ready | received | (RADIO_FAILED if self._failed else 0)

    def _read(self) -> Values:
        message, self._received = self._received, None
        return _EMPTY if message is None else (message.sender, message.length, *message.data)

    def _send(self, arguments: Values, now: float) -> None:
        receiver, length, *data = arguments
        if self._sending is not None:
            self._failed = True  # still busy: the new message is lost
            return
        padded = (*data[:length], *(0,) * (RADIO_BYTES - length))
        self._sending = RadioMessage(self._number, receiver, length, padded)
        self._sent_by = now + AIR_TIME
        self._failed = False
