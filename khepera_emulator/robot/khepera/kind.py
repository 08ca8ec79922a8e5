"""The Khepera, as a kind of robots."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

from khepera_emulator.line.dialect import KHEPERA, Dialect
from khepera_emulator.robot.khepera.choices import Choices, option_names, parse_choices
from khepera_emulator.robot.kind import Berth, Console

if TYPE_CHECKING:
    from khepera_emulator.robot.khepera.firmware import Firmware
    from khepera_emulator.robot.khepera.robot import Robot
    from khepera_emulator.senses.reach import Reach
    from khepera_emulator.world.rays import Array


class KheperaKind:
    """Kheperas; see `robot.kind.Kind`."""

    title = "Kheperas"
    turrets = True
    switches = tuple(option_names())

    def profiles(self, model: Any) -> tuple[str, ...]:
        """List no firmwares: there is one."""
        del model
        return ()

    def choices(self, model: Any, items: Iterable[str], profile: str) -> Choices:
        """Read choices."""
        del model, profile
        return parse_choices(items)

    def dialect(self, model: Any, choices: Any) -> Dialect:
        """Return how it speaks."""
        del model, choices
        return KHEPERA

    def robot(self, berth: Berth) -> "Robot":
        """Make a robot."""
        from khepera_emulator.robot.khepera.equipment import Equipment
        from khepera_emulator.robot.khepera.robot import Robot

        choices = berth.choices or Choices()
        return Robot(
            berth.world,
            berth.model,
            berth.pose,
            berth.drift,
            berth.rng,
            Equipment(berth.turrets, choices, berth.radio, berth.number),
            berth.dead_man,
            berth.ailments,
        )

    def firmware(self, robot: "Robot", console: Console) -> "Firmware":
        """Make the interpreter of a robot."""
        from khepera_emulator.robot.khepera.firmware import Firmware

        return Firmware(robot, console.on_rate, console.on_refusal)

    def reach(self, model: Any, count: int, shades: "Array", margin: float) -> "Reach":
        """Return how far the front and side sensors read a count."""
        from khepera_emulator.senses.infrared import reach_of

        return reach_of(model, count, shades, margin)


KIND: Final = KheperaKind()
