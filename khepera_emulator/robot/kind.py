"""Kinds of robots: whatever differs between one that is emulated and another, behind one door.

A kind is a folder beside this file and a line in `KINDS`; its models are lines in `models.MODELS`.
World, body, line, faults, ports, wire log, replay and side channel are the same for all.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Protocol

from khepera_protocol.registry import Registry
from khepera_protocol.serial.errors import RequestError
from khepera_protocol.text import quoted
from khepera_protocol.zenoh.payloads import Pose, WheelDrift

from khepera_emulator.doors import find_part
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.dialect import Dialect
from khepera_emulator.models import MODELS, Model, find_model
from khepera_emulator.robot.switches import switch_of
from khepera_emulator.turrets.radio import RadioMedium

if TYPE_CHECKING:  # options are read before a world is loaded
    import numpy as np

    from khepera_emulator.robot.ailments import Ailments
    from khepera_emulator.robot.rolling import Rolling
    from khepera_emulator.senses.reach import Reach
    from khepera_emulator.world.rays import Array
    from khepera_emulator.world.world import World

KINDS: Final = Registry(
    "kind of robot",
    "khepera_macor.kinds",
    {
        "khepera": "khepera_emulator.robot.khepera.kind:KIND",
        "epuck": "khepera_emulator.robot.epuck.kind:KIND",
    },
)


@dataclass(frozen=True, slots=True)
class Berth:
    """Place of a robot in its world, and what it is made from there.

    Attributes:
        world: where it is.
        model: which robot.
        pose: where it is put down.
        drift: what its counters do not see.
        rng: source of all its randomness.
        choices: of its firmware, as its kind reads them; None: the kind's own.
        turrets: classes of what is mounted on it.
        dead_man: seconds without a request after which it stops by itself; None: never.
        ailments: faults of its own; None: there are none.
        radio: the air of its world.
        number: of the robot in its world, from 1.
    """

    world: "World"
    model: Any
    pose: Pose
    drift: WheelDrift
    rng: "np.random.Generator"
    choices: Any = None
    turrets: tuple[Any, ...] = ()
    dead_man: float | None = None
    ailments: "Ailments | None" = None
    radio: RadioMedium = field(default_factory=RadioMedium)
    number: int = 1


@dataclass(frozen=True, slots=True)
class Console:
    """The line as a firmware sees it beside its replies.

    Attributes:
        on_rate: told the rate in bits a second that a request sets, to hold from after its reply.
        on_refusal: told each request that is refused, and why.
        on_later: told seconds after which the firmware says more, and the bytes; it carries out no
            request before.
    """

    on_rate: Callable[[int], None] = lambda _: None
    on_refusal: Callable[[bytes, RequestError], None] = lambda _, __: None
    on_later: Callable[[float, bytes], None] = lambda _, __: None


class Firmware(Protocol):
    """Interpreter of a robot's requests."""

    def execute(self, line: Any) -> bytes:
        """Carry out a request, as the robot's dialect cuts them; returns the reply."""


class Kind(Protocol):
    """A kind of robots. Its module is light: what robots are made of is imported when one is made.

    Attributes:
        title: its name in the plural, for messages.
        turrets: whether turrets can be mounted.
        switches: names of the choices of its firmware.
    """

    title: str
    turrets: bool
    switches: tuple[str, ...]

    def profiles(self, model: Any) -> tuple[str, ...]:
        """List the names of a model's firmwares, the usual one first; empty: there is one."""

    def choices(self, model: Any, items: Iterable[str], profile: str) -> Any:
        """Read the choices of a firmware.

        Args:
            model: of the robot.
            items: `NAME` or `NAME=VALUE` each.
            profile: one of the model's profiles; empty: the usual one.

        Raises:
            EmulatorError: an unknown name, or a value that does not fit.
        """

    def dialect(self, model: Any, choices: Any) -> Dialect:
        """Return how it speaks; `choices` may be None."""

    def robot(self, berth: Berth) -> "Rolling":
        """Make a robot."""

    def firmware(self, robot: Any, console: Console) -> Firmware:
        """Make the interpreter of a robot that `robot` has made."""

    def reach(self, model: Any, count: int, shades: "Array", margin: float) -> "Reach":
        """Return how far the front and side sensors of a model read a count, without noise.

        Args:
            model: of the robot.
            count: reading on the line.
            shades: brightness to infrared of S solids, 0 to 1.
            margin: metres that are added.
        """


def kind_of(model: Model) -> Kind:
    """Return the kind of a model.

    Raises:
        EmulatorError: there is none of that name.
    """
    return find_kind(model.kind)


def find_kind(name: str) -> Kind:
    """Return the kind of a name.

    Raises:
        EmulatorError: there is none.
    """
    kind: Kind = find_part(KINDS, name)
    return kind


def choose(models: Sequence[Model], items: Sequence[str], profile: str = "") -> list[Any]:
    """Read the choices of the firmwares of all models in a world.

    A switch or a profile that is another kind's does not concern a robot.

    Args:
        models: of the robots.
        items: `NAME` or `NAME=VALUE` each.
        profile: of those that have it; empty: each one's usual one.

    Raises:
        EmulatorError: a name that none of them knows, or a value that does not fit.
    """
    kinds = [kind_of(model) for model in models]
    profiles = [kind.profiles(model) for kind, model in zip(kinds, models, strict=True)]
    if profile and not any(profile in names for names in profiles):
        listed = ", ".join(dict.fromkeys(name for names in profiles for name in names))
        known = f"there are {listed}" if listed else f"{kinds[0].title} have one firmware"
        raise EmulatorError(f"unknown profile {quoted(profile)}: {known}")
    known_switches = {name for kind in kinds for name in kind.switches}
    made = []
    for kind, model, names in zip(kinds, models, profiles, strict=True):
        strange = known_switches.difference(kind.switches)
        own = [item for item in items if switch_of(item) not in strange]
        made.append(kind.choices(model, own, profile if profile in names else ""))
    return made


def all_switches() -> list[str]:
    """List the choices of all kinds of firmware."""
    return [name for kind in KINDS.names() for name in find_kind(kind).switches]


def all_profiles() -> list[str]:
    """List the profiles of all models of this program."""
    models = [find_model(name) for name in MODELS.names()]
    return list(dict.fromkeys(name for each in models for name in kind_of(each).profiles(each)))
