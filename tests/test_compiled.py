"""Compiled forms give what plain forms give, bit for bit."""

import itertools
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
from as_type import as_type
from khepera_protocol.mirror import Mirror
from khepera_protocol.system import compiled
from khepera_protocol.system.compiled import ALWAYS, AUTO, NEVER, VARIABLE, Kernel, load
from khepera_protocol.zenoh.payloads import Pose, Reset

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.senses.renderers.skyline import Skyline
from khepera_emulator.world.floor_plan import FloorPlan
from macor_hil.commands import COMMANDS
from macor_hil.hardware.devices import Hardware, open_hardware
from macor_hil.hardware.driver import Driver, DriveSettings
from macor_hil.hardware.khepera import Khepera
from macor_hil.hardware.robots.robot import Arc
from macor_hil.mind.catalogue import build_brain

PATIENCE = 120.0

needs_numba = pytest.mark.skipif(not compiled.is_installed(), reason="Numba is not installed")


@pytest.fixture
def always(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, ALWAYS)


def state_of(hardware: Hardware) -> dict[str, Any]:
    """All that a robot, its line and its client remember."""
    emulator = hardware.robot.port.emulator
    robot, uart = emulator.robot, emulator.uart
    chassis = robot.chassis
    pushing = chassis.pushing
    return {
        "time": (emulator.now, emulator._fleet.now, emulator._fleet._ticks, robot.ticks),
        "place": (chassis.x, chassis.y, chassis.heading, chassis.ground_speed),
        "touch": (chassis.contact, robot.touched, chassis.free_way, chassis.sliding),
        "push": (pushing.tyres, pushing.walls, pushing.pressing, pushing.slipping),
        "wheels": robot.wheels,
        "scan": (robot.scan_pose, robot.scans, robot.heard_at),
        "line": (uart.receiver_free, uart.interpreter_free, uart.sender_free),
        "meter": hardware.robot.meter.read(),
        # blocks that were drawn ahead do not count
        "drawn": (robot.slips.left % 256, robot.infrared.noise.left % 64),
    }


def driven(hardware: Hardware, settings: DriveSettings, seed: int) -> Iterator[Any]:
    """Drive commands, and hold speeds, from several places."""
    assert hardware.bench is not None
    driver, rng = Driver(hardware.robot, settings), np.random.default_rng(seed)
    for episode in range(3):
        hardware.bench.reset(Reset(random=True, seed=episode))
        driver.start()
        for _ in range(12):
            outcome = driver.execute(COMMANDS[int(rng.integers(3))])
            yield outcome, state_of(hardware)
            if outcome.collided:
                break
        left, right = rng.integers(-20, 20, 2).tolist()
        yield driver.hold(left, right, 0.4), state_of(hardware)


ARC = Arc((20, 64, 20, 64), (50, 50), 1000, 0.3, 0.5)

WATCHING = DriveSettings()
PUSHING = DriveSettings(collision=5_000, patience=0.1)
"""Does not see walls, and so pushes them."""


@pytest.mark.long
@needs_numba
@pytest.mark.usefixtures("always")
@pytest.mark.parametrize(
    ("url", "settings"),
    [
        ("khepera://corridor?seed=1", WATCHING),
        ("khepera://corridor?seed=2&drift=strong", PUSHING),
        ("khepera://narrow-passage?seed=3&model=khepera2", WATCHING),
        ("khepera://narrow-passage?seed=4", PUSHING),
        ("khepera://maze?seed=5&baud=unpaced", PUSHING),
        ("khepera://lamp-room?seed=6", WATCHING),
        ("khepera://open-box?seed=7&drift=none", WATCHING),
    ],
)
def test_watching_a_robot(url: str, settings: DriveSettings) -> None:
    baud = 38_400 if "seed=6" in url else 9600
    with open_hardware(url, baud=baud) as compiled_one, open_hardware(url, baud=baud) as plain_one:
        plain = as_type(Khepera, plain_one.robot)
        plain._watch = plain._drive = None
        for seed, both in enumerate(
            zip(driven(compiled_one, settings, 1), driven(plain_one, settings, 1), strict=True)
        ):
            assert both[0] == both[1], seed


@pytest.mark.long
@needs_numba
@pytest.mark.usefixtures("always")
@pytest.mark.parametrize(
    "options",
    ["turret=gripper", "fault=drop:p=0.01", "dead-man=1", "robots=2", "baud=2400"],
)
def test_what_is_more_than_a_robot_among_walls_is_left_to_the_client(options: str) -> None:
    port: Any = serial.serial_for_url(f"khepera://corridor?{options}", timeout=1)
    with port:
        assert port.watch(1000, 0.1) is None
        assert port.drive(*ARC) is None


@pytest.mark.long
@needs_numba
@pytest.mark.usefixtures("always")
def test_a_line_that_is_not_silent_is_left_to_the_client() -> None:
    with open_hardware("khepera://corridor") as hardware:
        port = hardware.robot.port
        assert port.watch(1000, 0.1) is not None
        assert port.drive(*ARC) is not None
        port.write(b"H")
        assert port.watch(1000, 0.1) is None
        assert port.drive(*ARC) is None


@needs_numba
def test_distances_are_those_of_the_standard_library() -> None:
    own = load("khepera_emulator.robot.compiled.solids").hypot
    rng = np.random.default_rng(1)
    scale = 10.0 ** rng.integers(-12, 4, (20_000, 2))
    for a, b in (scale * rng.standard_normal((20_000, 2))).tolist():
        assert own(a, b) == hypot(a, b)
    for a, b in ((0.0, 0.0), (3e200, 4e200), (-3e-200, 4e-200), (0.0, -2.0)):
        assert own(a, b) == hypot(a, b)


@pytest.mark.long
@needs_numba
@pytest.mark.parametrize("arena", ["corridor", "maze", "narrow-passage", "s-curve"])
def test_pictures(arena: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mirror, loaded = Mirror(), load_arena(arena)
    renderer = Skyline(loaded, FloorPlan(loaded), 0.06, mirror.low, mirror.high)
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (40, 3)) * (0.3, 0.3, 7.0)
    for x, y, heading in places.tolist():
        pose = Pose(x=loaded.start.x + x, y=loaded.start.y + y, heading=heading)
        monkeypatch.setenv(VARIABLE, NEVER)
        plain = renderer.look(pose).picture
        monkeypatch.setenv(VARIABLE, ALWAYS)
        assert np.array_equal(renderer.look(pose).picture, plain)


@needs_numba
@pytest.mark.parametrize("arena", ["corridor", "lamp-room"])
def test_features(arena: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng, brain = np.random.default_rng(3), build_brain()
    with open_hardware(f"khepera://{arena}") as hardware:
        assert hardware.bench is not None
        images = []
        for _ in range(8):
            hardware.bench.reset(Reset(random=True))
            images.append(hardware.camera.grab().image)
    images += [rng.integers(0, 256, images[0].shape).astype(np.uint8) for _ in range(8)]
    images += [np.full(images[0].shape, level, np.uint8) for level in (0, 255)]
    for image in images:
        monkeypatch.setenv(VARIABLE, NEVER)
        plain = brain.look(image)
        monkeypatch.setenv(VARIABLE, ALWAYS)
        assert np.array_equal(brain.look(image), plain)


def test_a_process_loads_them_when_it_has_run_the_plain_forms_for_long(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(compiled, "is_installed", lambda: True)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    kernel = Kernel("some:function", 16)
    assert [kernel.is_due() for _ in range(18)] == [False] * 16 + [True] * 2
    monkeypatch.setitem(sys.modules, "numba", sys)
    kernel = Kernel("some:function", 16)
    assert [kernel.is_due() for _ in range(4)] == [False] * 2 + [True] * 2
    monkeypatch.setenv(VARIABLE, NEVER)
    assert not kernel.is_due()
    monkeypatch.setattr(compiled, "is_installed", lambda: False)
    monkeypatch.setenv(VARIABLE, ALWAYS)
    assert not kernel.is_due()


def test_a_robot_in_real_time_is_not_halted_by_loading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(compiled, "is_installed", lambda: True)
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    kernel = Kernel("some:function", 1_000)
    for pause, halted in ((0.1, False), (0.001, True)):
        clock = itertools.count(step=pause)
        due = False
        for now in itertools.islice(clock, 5_000):
            monkeypatch.setattr(compiled, "monotonic", partial(float, now))
            due |= kernel.is_due()
        assert due == halted


SUM = """
from khepera_protocol.system.compiled import compiled

@compiled
def total(numbers):
    return numbers.sum()
"""


@needs_numba
def test_machine_code_is_made_by_another_process_while_the_plain_form_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "summing.py").write_text(SUM)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv(VARIABLE, AUTO)
    kernel, numbers = Kernel("summing:total", 0), np.arange(4.0)
    assert not kernel.pays(numbers)
    assert kernel._maker is not None
    assert kernel._maker.wait(PATIENCE) == 0
    assert kernel.pays(numbers)
    assert kernel(numbers) == 6.0
    assert kernel._function.stats.cache_hits
    again = Kernel("summing:total", 0)
    assert again.pays(numbers)
    assert again._maker is None


def test_machine_code_older_than_a_source_is_taken_away(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").mkdir()
    index, newer = (tmp_path / "__pycache__" / f"{name}.nbi" for name in ("old", "new"))
    for file, moment in ((index, 1_000), (tmp_path / "part.py", 2_000), (newer, 3_000)):
        file.touch()
        os.utime(file, (moment, moment))
    compiled._forget_stale(tmp_path)
    assert newer.exists()
    assert not index.exists()


def test_programs_start_without_numba() -> None:
    code = (
        "import sys, macor_hil.cli.program, khepera_emulator.app.cli.program,"
        " khepera_emulator.robot.emulator, macor_hil.mind.eyes.floor;"
        " sys.exit('numba' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
