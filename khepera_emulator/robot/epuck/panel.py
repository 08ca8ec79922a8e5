"""State of an e-puck that power-on makes anew: lamps, camera, and the firmware's variables."""

from dataclasses import dataclass, field
from typing import Final

RING: Final = 8
"""LEDs around the robot; LED 0 is in front, and they go clockwise."""

GREY, COLOUR, YUV = 0, 1, 2
"""Modes of the camera: a byte a pixel, RGB565, two bytes a pixel."""

RED_SHARE: Final = 10
"""Percent of red that an RGB LED shows when it is switched as the others are."""


@dataclass(frozen=True, slots=True)
class Picture:
    """Parameters of the camera's pictures.

    Attributes:
        mode: one of the modes above.
        width, height: in pixels.
        zoom: pixels of the camera for one of the picture.
        left, top: of the window, in pixels of the camera; -1: in the middle.
    """

    mode: int = COLOUR
    width: int = 40
    height: int = 40
    zoom: int = 8
    left: int = -1
    top: int = -1

    @property
    def size(self) -> int:
        """Bytes of a picture."""
        return self.width * self.height * (1 if self.mode == GREY else 2)


@dataclass(slots=True)
class Panel:
    """State that a client can set beside the motors.

    The numbers of a request that lacks some are those of the one before.

    Attributes:
        ring: the eight LEDs.
        body, front: the other two.
        colours: percent of red, green and blue of the e-puck2's four RGB LEDs.
        picture: parameters of the camera.
        zeros: of the infrared sensors, taken by K.
        sound: that plays, as T calls it; 0: none.
        avoiding: whether it avoids obstacles by itself.
        ranging: whether the time of flight sensor measures.
        scanning: whether the infrared sensors do.
        remote: toggle, address and data of the last key of the infrared remote control.
        key: the last key that did something.
        speeds, positions, led, action, tune, bus: last numbers of D, P, L, B or F, T, and W or Y.
        answers: of the binary row that is being sent.
    """

    ring: list[bool] = field(default_factory=lambda: [False] * RING)
    body: bool = False
    front: bool = False
    colours: list[int] = field(default_factory=lambda: [0] * 12)
    picture: Picture = field(default_factory=Picture)
    zeros: tuple[float, ...] = (0.0,) * RING
    sound: int = 0
    avoiding: bool = False
    ranging: bool = True
    scanning: bool = True
    remote: tuple[int, int, int] = (0, 0, 0)
    key: int = 0
    speeds: list[int] = field(default_factory=lambda: [0, 0])
    positions: list[int] = field(default_factory=lambda: [0, 0])
    led: int = 0
    action: int = 0
    tune: int = 0
    bus: list[int] = field(default_factory=lambda: [0, 0, 0])
    answers: bytearray = field(default_factory=bytearray)

    def switch(self, led: int, action: int) -> None:
        """Switch an LED of the ring, all of them if there is no such, or toggle."""
        for number in (led,) if 0 <= led < RING else range(RING):
            self.ring[number] = switched(self.ring[number], action)
            if number % 2:
                # LED 1, 3, 5 and 7 of the ring are the first red of a triple on an e-puck2
                at = number // 2 * 3
                self.colours[at : at + 3] = [RED_SHARE if self.ring[number] else 0, 0, 0]

    def clear_ring(self) -> None:
        """Switch the eight LEDs off."""
        self.switch(RING, 0)


def switched(lit: bool, action: int) -> bool:
    """Return the state of an LED after an action: 0 off, 1 on, anything else toggles."""
    return not lit if action not in (0, 1) else bool(action)
