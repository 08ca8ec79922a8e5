"""Parts of others in the emulator: turrets that are broken, models, ports and faults of a file."""

# ruff: noqa: ARG002 - the methods are those of a turret

from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import serial
from khepera_protocol.serial.commands import Field
from khepera_protocol.serial.turrets import TURRETS, TurretKind, TurretMessage, turret_kind

import khepera_emulator  # noqa: F401 - registers khepera://
from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.checks import CheckError, check_turret
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.fault import find_kind
from khepera_emulator.models import find_model
from khepera_emulator.ports.opening import open_port
from khepera_emulator.robot.emulator import Emulator
from khepera_emulator.robot.options import RobotOptions
from khepera_emulator.robot.setup import Setup
from khepera_emulator.turrets.catalogue import TURRET_CLASSES, find_turrets
from khepera_emulator.turrets.turret import Values

READ = TurretMessage("R", "Read", (Field("which", 0, 3),), (Field("value", 0, 9),))


def kind(name: str = "mine", number: int | None = 40, *messages: TurretMessage) -> TurretKind:
    return turret_kind(name, "Mine", number, "a test", *(messages or (READ,)))


class Sound:
    """A turret that does as it should."""

    kind = kind()

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self.time = 0.0

    def power_on(self) -> None:
        self.time = 0.0

    def step(self, now: float) -> None:
        self.time = now

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (int(self._rng.integers(10)),)


class TooGreat(Sound):
    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (10,)


class TooMany(Sound):
    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (1, 2)


class NoNumbers(Sound):
    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (0.5,)  # type: ignore[return-value]


class OfItsOwnChance(Sound):
    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (int(np.random.default_rng().integers(10)),)


class CountsSteps(Sound):
    steps = 0

    def step(self, now: float) -> None:
        self.steps += 1

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        return (self.steps % 10,)


class RemembersAll(Sound):
    asked: list[str] = []

    def answer(self, letter: str, arguments: Values, now: float) -> Values:
        self.asked.append(letter)
        return (len(self.asked) % 10,)


class NoKind:
    kind = "mine"


class Deaf(Sound):
    answer = None  # type: ignore[assignment]


class BadBus:
    kind = turret_kind("mine", "Mine", None, "a test")

    def power_on(self) -> None: ...

    def step(self, now: float) -> None: ...

    def read_bus(self, address: int) -> int | None:
        return 256

    def write_bus(self, address: int, data: int) -> None: ...

    def analogue(self, channel: int) -> int | None:
        return None


def of_kind(**values: Any) -> Any:
    return type("Mine", (Sound,), {"kind": kind(**values)})


@pytest.mark.parametrize("name", TURRET_CLASSES.builtin)
def test_bundled_turrets_pass_the_check(name: str) -> None:
    check_turret(TURRET_CLASSES.find(name))


def test_a_sound_turret_passes_the_check() -> None:
    check_turret(Sound)


@pytest.mark.parametrize(
    ("turret", "says"),
    [
        (TooGreat, "T,40,R,0 is answered 10 as value, not 0 to 9"),
        (TooMany, "T,40,R,0 is answered with 2 values, not 1"),
        (NoNumbers, "T,40,R,0 is answered 0.5 as value"),
        (OfItsOwnChance, "after a seeded reset it answers otherwise"),
        (CountsSteps, "where time passes in small steps it answers otherwise"),
        (RemembersAll, "after a seeded reset it answers otherwise"),
        (NoKind, "its attribute `kind` is not a TurretKind"),
        (Deaf, "with a number it needs `answer`"),
        (BadBus, "at the address 0 it reads 256, no byte"),
        (of_kind(number=2), "its number 2 is that of the turret 'k213'"),
        (of_kind(number=256), "its number 256 is not 0 to 255"),
        (of_kind(name="My turret"), "its name 'My turret' is not made of small letters"),
        (of_kind(number=None), "without a number nobody can send it messages"),
        (
            type(
                "Mine",
                (Sound,),
                {"kind": TurretKind("m", "", 9, MappingProxyType({"r": READ}), "")},
            ),
            "the message 'r' is not stored by its own capital letter",
        ),
    ],
)
def test_a_broken_turret_fails_the_check(turret: Any, says: str) -> None:
    with pytest.raises(CheckError) as caught:
        check_turret(turret)
    assert says in str(caught.value)


def test_chance_of_bundled_turrets_does_not_depend_on_those_of_others() -> None:
    def image(*turrets: Any) -> bytes:
        robot = Emulator(Setup(load_arena("open-box"), seed=1, baud=None, turrets=turrets))
        robot.write(b"T,2,N\n")
        robot.advance(0.0)
        robot.close()
        return robot.read()

    (k213,) = find_turrets(["k213"])
    assert image(k213).startswith(b"t,2,n,")
    assert image(k213) == image(Sound, k213) == image(k213, Sound)


PARTS = """
from dataclasses import replace
from khepera_protocol.serial.turrets import TURRETS
from khepera_emulator.line.fault import Victim
from khepera_emulator.models import KHEPERA
from khepera_emulator.ports.pty import PtyPort
from khepera_emulator.turrets.general_io import GeneralIO

HEAVY = replace(KHEPERA, name="heavy", mass=0.2, versions=("9.99", "5.00"))


class Shout:
    victim, keys, once = Victim.REPLY, ("p", "n"), False

    def change(self, reply, share, fault):
        return reply.upper(), "louder"


class Terminal(PtyPort):
    pass


class Arm(GeneralIO):
    kind = TURRETS["gripper"]
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "parts.py"
    path.write_text(PARTS)
    return str(path)


def test_models_and_faults_of_a_file_make_a_robot(file: str) -> None:
    options = RobotOptions(model=f"{file}:HEAVY", fault=(f"{file}:Shout:p=1,n=1",), baud="unpaced")
    robot = Emulator(options.setup())
    for expected in (b"B,9.99,5.00\r\n", b"b,9.99,5.00\r\n"):
        robot.write(b"B\n")
        robot.advance(0.0)
        assert robot.read() == expected
    robot.close()


def test_a_port_of_a_file_is_opened(file: str) -> None:
    port = open_port(port=f"{file}:Terminal")
    assert port.url.startswith("/dev/")
    port.close()
    with pytest.raises(EmulatorError, match="a terminal has no address, not 'x'"):
        open_port(port=f"{file}:Terminal=x")


def test_two_turrets_with_one_number_are_refused(file: str) -> None:
    with pytest.raises(EmulatorError, match="twice"):
        find_turrets(["gripper", f"{file}:Arm"])
    Sound.kind = kind("mine", 1)
    try:
        with pytest.raises(EmulatorError, match="both answer to number 1"):
            find_turrets(["gripper", f"{__name__}:Sound"])
    finally:
        Sound.kind = kind()


@pytest.mark.parametrize(
    "option", ["turret={}:Arm", "model={}:HEAVY", "fault={}:Shout:p=1", "turret=json:decoder"]
)
def test_a_url_runs_no_code_that_is_not_allowed(file: str, option: str) -> None:
    url = "khepera://open-box?" + option.format(file)
    with pytest.raises(serial.SerialException, match=r"it uses code of its own, .*--allow"):
        serial.serial_for_url(url)


@pytest.mark.parametrize(
    ("option", "name"),
    [("turret={}", "{}:Arm"), ("model={}", "{}:HEAVY"), ("fault={}:p=1", "{}:Shout")],
)
def test_a_url_runs_code_that_is_allowed(file: str, option: str, name: str) -> None:
    name = name.format(file)
    url = "khepera://open-box?" + option.format(name)
    port: Any = serial.serial_for_url(url, do_not_open=True)
    port.allowed = [name]
    port.open()
    port.close()


def test_what_is_no_part_is_told() -> None:
    for find, name, says in (
        (find_model, "json:decoder", "is not a robot model"),
        (find_kind, "json:decoder", "is not a kind of fault"),
        (lambda name: find_turrets([name]), "json:decoder", "is not a turret"),
        (lambda name: open_port(port=name), "json:decoder", "is not a port"),
        (lambda name: open_port(port=name), "telnet", "no kind of port 'telnet'; there are"),
    ):
        with pytest.raises(EmulatorError, match=says):
            find(name)


def test_every_bundled_kind_of_turret_has_its_class() -> None:
    found = {name: TURRET_CLASSES.find(name).kind for name in TURRET_CLASSES.builtin}
    assert found == dict(TURRETS)
