"""The e-puck, as a kind of robots."""

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from khepera_protocol.epuck.framing import RequestSplitter, Sign
from khepera_protocol.epuck.units import BAUD
from khepera_protocol.epuck.wifi import WIFI, WifiSplitter

from khepera_emulator.line.clock import on_grid
from khepera_emulator.line.dialect import Dialect
from khepera_emulator.robot.epuck.choices import SWITCHES, Choices, parse_choices
from khepera_emulator.robot.kind import Berth, Console, Firmware

if TYPE_CHECKING:
    from khepera_emulator.robot.epuck.robot import Robot
    from khepera_emulator.senses.reach import Reach
    from khepera_emulator.world.rays import Array

_BUSY: Final = on_grid(50e-6)
"""Seconds between a request and its reply (a choice): the firmware waits for bytes in a loop."""

_SEND_LIMIT: Final = 1 << 16
"""Bytes of replies: those of a row come as one, with every picture that it asks for."""

_RECEIVE_LIMIT: Final = 64
"""Bytes of the firmware's ring."""

_WIFI_BUSY: Final = on_grid((22 + 103) * 10 / BAUD)
"""Seconds before an answer: meanwhile the WiFi side asks the main processor on a line inside."""

_WIFI_RATE: Final = 4_000_000
"""Bits a second, of which ten make a byte: ten pictures a second (a choice)."""

_WIFI_RECEIVE_LIMIT: Final = 2048
_WIFI_SEND_LIMIT: Final = 1 << 20


class EpuckKind:
    """E-pucks; see `robot.kind.Kind`."""

    title = "e-pucks"
    turrets = False
    switches = SWITCHES

    def profiles(self, model: Any) -> tuple[str, ...]:
        """List the names of a model's firmwares."""
        profiles: tuple[str, ...] = model.profiles
        return profiles

    def choices(self, model: Any, items: Iterable[str], profile: str) -> Choices:
        """Read choices."""
        return parse_choices(model, items, profile)

    def dialect(self, model: Any, choices: Any) -> Dialect:
        """Return how it speaks."""
        choices = choices or parse_choices(model)
        if choices.wifi:
            return Dialect(
                splitter=WifiSplitter,
                restart=Sign.RESTART,
                first_rate=_WIFI_RATE,
                stop=1,
                busy=_WIFI_BUSY,
                receive_limit=_WIFI_RECEIVE_LIMIT,
                send_limit=_WIFI_SEND_LIMIT,
                serial=False,
                name=WIFI,
            )
        generation = choices.generation
        return Dialect(
            splitter=partial(RequestSplitter, generation.codes, generation.longest),
            restart=Sign.RESTART,
            first_rate=BAUD,
            stop=1,
            busy=_BUSY,
            receive_limit=_RECEIVE_LIMIT,
            send_limit=_SEND_LIMIT,
            name=generation.name,
        )

    def robot(self, berth: Berth) -> "Robot":
        """Make a robot."""
        from khepera_emulator.robot.epuck.robot import Robot

        return Robot(berth, berth.choices or parse_choices(berth.model))

    def firmware(self, robot: "Robot", console: Console) -> Firmware:
        """Make the interpreter of a robot."""
        from khepera_emulator.robot.epuck.firmware import SerialFirmware, WifiFirmware

        if robot.choices.wifi:
            return WifiFirmware(robot)
        return SerialFirmware(robot, console)

    def reach(self, model: Any, count: int, shades: "Array", margin: float) -> "Reach":
        """Return how far the front and side sensors read a count."""
        from khepera_emulator.robot.epuck.senses.proximity import reach_of

        return reach_of(model, count, shades, margin)


KIND: Final = EpuckKind()
