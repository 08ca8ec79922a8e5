"""Plain arenas work where PyBullet is not there: CPython 3.14, and processors without a wheel."""

import sys
from collections import namedtuple
from pathlib import Path

import pytest
import serial
from in_process import open_robot
from khepera_protocol.zenoh.payloads import Reset
from other_system import train_and_drive

import khepera_emulator
from khepera_emulator.errors import EmulatorError
from khepera_emulator.world import bullet

NEEDY = {
    "toys": "the arena has things to push",
    "corridor?robots=2": "robots in one arena push each other",
    "corridor?physics=pybullet": "with `physics` set to `pybullet` a robot is a rigid body",
}
"""Robots that need PyBullet, and what is said where there is none."""

BY_PYBULLET = (
    "khepera_emulator.body.rigid_body",
    "khepera_emulator.senses.renderers.faces",
    "khepera_emulator.world.dynamics",
    "khepera_emulator.world.things",
)
"""Modules that import it."""


@pytest.fixture(autouse=True)
def _hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have no PyBullet: importing it, or what imports it, fails as if it were not installed."""
    for module in ("pybullet", *BY_PYBULLET):
        monkeypatch.setitem(sys.modules, module, None)


def test_these_modules_import_it() -> None:
    root = Path(khepera_emulator.__file__).parent.parent
    files = {".".join(f.relative_to(root).with_suffix("").parts): f for f in root.rglob("*.py")}
    found = {
        name
        for name, file in files.items()
        if name.startswith("khepera_emulator.") and "\nimport pybullet\n" in file.read_text()
    }
    assert found == set(BY_PYBULLET)


@pytest.mark.parametrize("arena", ["corridor", "lamp-room"])
def test_a_robot_drives_and_sees(arena: str) -> None:
    with open_robot(f"khepera://{arena}?seed=1", timeout=1) as port:
        port.write(b"D,20,20\n")
        assert port.readline() == b"d\r\n"
        port.emulator.advance(10.0)
        port.write(b"N\n")
        assert max(map(int, port.readline().split(b",")[1:])) > 300
        assert port.emulator.truth().touched
        assert port.emulator.mirror_image().any()
        port.emulator.reset(Reset(seed=2))
        assert not port.emulator.truth().touched


@pytest.mark.parametrize("url", NEEDY)
def test_what_can_be_pushed_says_in_a_sentence_what_is_missing(url: str) -> None:
    with pytest.raises(serial.SerialException) as said:
        open_robot(f"khepera://{url}")
    sentence = f"khepera://{url}: {NEEDY[url]}, for which PyBullet is missing; "
    assert str(said.value).startswith(sentence)
    assert str(said.value).removeprefix(sentence)


Version = namedtuple("Version", "major minor")


@pytest.mark.parametrize(
    ("version", "system", "processor", "has_one"),
    [
        ((3, 11), "linux", "x86_64", True),
        ((3, 13), "linux", "x86_64", True),
        ((3, 12), "darwin", "arm64", True),
        ((3, 14), "linux", "x86_64", False),
        ((3, 13), "linux", "aarch64", False),
    ],
)
def test_the_advice_is_one_that_helps(
    monkeypatch: pytest.MonkeyPatch,
    version: tuple[int, int],
    system: str,
    processor: str,
    has_one: bool,
) -> None:
    monkeypatch.setattr(sys, "version_info", Version(*version))
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(bullet, "machine", lambda: processor)
    with pytest.raises(EmulatorError) as said:
        bullet.load_physics("the arena has things to push")
    assert ("install the extra 'emulator'" in str(said.value)) == has_one
    assert (f"there is none for CPython 3.{version[1]} on" in str(said.value)) != has_one


@pytest.mark.long
def test_a_map_is_trained_and_drives(tmp_path: Path) -> None:
    train_and_drive(tmp_path)
