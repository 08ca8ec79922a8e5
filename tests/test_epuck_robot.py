"""An emulated e-puck: motors, sensors, lamps, camera, both firmwares' ways, WiFi."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
from in_process import open_robot
from khepera_protocol.epuck import codes
from khepera_protocol.epuck.letters import GREETING, reply_numbers
from khepera_protocol.epuck.packets import Actuators, AllSensors, Behaviour
from khepera_protocol.epuck.units import STEP
from khepera_protocol.epuck.wifi import PICTURE, SENSORS, WifiReader, WifiRequest
from khepera_protocol.zenoh.payloads import Pose, Reset

from khepera_emulator.arenas.arena import load_arena
from khepera_emulator.errors import EmulatorError
from khepera_emulator.ports.protocol_khepera import Serial
from khepera_emulator.robot.emulator import Emulator
from khepera_emulator.robot.epuck.avoidance import avoid
from khepera_emulator.robot.epuck.models import EPUCK2, PLACES, ring
from khepera_emulator.robot.epuck.steppers import Stepper, real_speed
from khepera_emulator.robot.options import RobotOptions
from khepera_emulator.robot.setup import Setup

MODELS = ["epuck", "epuck2"]
ROOM = Pose(x=0.0, y=0.0, heading=0.0)


@contextmanager
def puck(model: str = "epuck2", arena: str = "open-box", **options: Any) -> Iterator[Serial]:
    """A robot in the middle of a room; its line takes its time."""
    more = "".join(f"&{name.replace('_', '-')}={value}" for name, value in options.items())
    url = f"khepera://{arena}?model={model}&seed=1&drift=none{more}"
    with open_robot(url, baudrate=115_200, timeout=2.0) as port:
        if arena == "open-box":
            port.emulator.reset(Reset(pose=ROOM))
        yield port


def ask(port: Serial, line: str) -> bytes:
    port.write(line.encode() + b"\r")
    return port.read_until(b"\n")


def numbers(port: Serial, letter: str) -> tuple[int, ...]:
    return reply_numbers(letter, ask(port, letter)[:-2])


def row(port: Serial, *commands: Any, size: int) -> bytes:
    port.write(codes.row(*commands))
    return port.read(size)


def pass_time(port: Serial, seconds: float) -> None:
    port.emulator.advance(port.now + seconds)


def sensors(port: Serial) -> AllSensors:
    return AllSensors.unpack(row(port, 0xF8, size=103))


class TestMotors:
    @pytest.mark.parametrize(
        ("speed", "slow", "fast"),
        [(600, 625.0, 602.41), (900, 909.09, 909.09), (1000, 1000.0, 1000.0), (1, 1.0, 1.0)],
    )
    def test_real_speeds_are_those_of_a_timer(self, speed: int, slow: float, fast: float) -> None:
        assert real_speed(speed, fast_timer=False) == pytest.approx(slow, abs=0.01)
        assert real_speed(speed, fast_timer=True) == pytest.approx(fast, abs=0.01)
        assert real_speed(-speed, fast_timer=True) == pytest.approx(-fast, abs=0.01)
        assert real_speed(0, fast_timer=True) == 0.0

    @pytest.mark.parametrize(("model", "limit"), [("epuck", 1000), ("epuck2", 1100)])
    def test_speeds_are_limited_and_read_back_as_they_were_sent(
        self, model: str, limit: int
    ) -> None:
        with puck(model) as port:
            assert ask(port, "D,3000,-3000") == b"d\r\n"
            assert numbers(port, "E") == (3000, -3000)
            left, right = port.emulator.robot.motors
            assert (left.speed, right.speed) == (limit, -limit)

    @pytest.mark.parametrize("model", MODELS)
    def test_steps_are_counted_as_they_are_made(self, model: str) -> None:
        with puck(model) as port:
            ask(port, "D,500,250")
            pass_time(port, 1.0)
            left, right = numbers(port, "Q")
            assert left == pytest.approx(500, abs=6)
            assert right == pytest.approx(250, abs=4)
            pose = port.emulator.truth().pose
            way = (left + right) / 2 * STEP
            assert np.hypot(pose.x, pose.y) == pytest.approx(way, rel=0.08)
            assert pose.heading == pytest.approx(-(left - right) * STEP / 0.053, abs=0.01)

    def test_counters_go_on_at_a_wall(self) -> None:
        with puck() as port:
            ask(port, "D,1000,1000")
            pass_time(port, 8.0)
            truth = port.emulator.truth()
            assert truth.contact
            before, _ = numbers(port, "Q")
            pass_time(port, 1.0)
            after, _ = numbers(port, "Q")
            assert after - before == pytest.approx(1000, abs=12)
            assert port.emulator.truth().pose.x == pytest.approx(truth.pose.x, abs=1e-3)

    def test_p_sets_the_counters_and_moves_nothing(self) -> None:
        with puck() as port:
            assert ask(port, "P,5000,-5000") == b"p\r\n"
            pass_time(port, 0.5)
            assert numbers(port, "Q") == (5000, -5000)
            assert port.emulator.truth().pose == ROOM

    @pytest.mark.parametrize(("model", "wraps"), [("epuck", True), ("epuck2", False)])
    def test_counters_wrap_at_the_width_of_the_robots_int(self, model: str, wraps: bool) -> None:
        with puck(model) as port:
            ask(port, "P,32767,0")
            ask(port, "D,100,0")
            pass_time(port, 0.1)
            left, _ = numbers(port, "Q")
            assert (left < 0) is wraps

    def test_a_stepper_counts_what_it_was_told(self) -> None:
        motor = Stepper(limit=1000, bits=16, fast_timer=False)
        motor.drive(250)
        for _ in range(100):
            motor.step(0.01)
        assert motor.counter == 250
        motor.drive(-250)
        for _ in range(200):
            motor.step(0.01)
        assert motor.counter == -250

    def test_a_weak_motor_loses_steps_that_are_counted(self) -> None:
        with puck(fault="weak-motor:wheel=left,part=0.5") as port:
            ask(port, "D,400,400")
            pass_time(port, 0.5)
            left, right = numbers(port, "Q")
            assert left == right
            assert port.emulator.truth().pose.heading == pytest.approx(0.243, abs=0.01)

    def test_a_dead_man_stops_it(self) -> None:
        with puck(dead_man=0.5) as port:
            ask(port, "D,400,400")
            pass_time(port, 2.0)
            there = port.emulator.truth().pose
            pass_time(port, 1.0)
            assert port.emulator.truth().pose == there
            assert there.x == pytest.approx(0.5 * 400 * STEP, abs=0.003)


class TestInfrared:
    def test_the_zero_is_taken_off_by_k(self) -> None:
        with puck() as port:
            before = numbers(port, "N")
            assert all(8 <= count <= 60 for count in before)
            started = port.now
            assert ask(port, "K").startswith(b"k, Starting calibration")
            assert port.read_until(b"\n") == b"k, Calibration finished\r\n"
            assert port.now - started == pytest.approx(1.5, abs=0.02)
            assert all(count <= 12 for count in numbers(port, "N"))

    def test_requests_wait_for_the_end_of_k(self) -> None:
        with puck() as port:
            port.write(b"K\rC\r")
            lines = [port.read_until(b"\n") for _ in range(3)]
            assert [line[:1] for line in lines] == [b"k", b"k", b"c"]
            assert port.now > 1.5

    def test_sensors_stand_clockwise_from_the_front_right(self) -> None:
        with puck() as port:
            ask(port, "K")
            port.read_until(b"\n")
            scene = port.emulator.robot.chassis.scene
            (free,), _ = scene.cast(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]))
            for sensor, heading in ((0, 15), (1, 45), (2, 90), (5, -90), (7, -15)):
                # turned so that the sensor looks along the x axis, at the wall there
                pose = Pose(x=free - 0.045, y=0.0, heading=heading * pi / 180)
                port.emulator.reset(Reset(pose=pose))
                counts = numbers(port, "N")
                assert max(range(8), key=counts.__getitem__) == sensor

    def test_a_white_wall_reads_as_in_the_table(self) -> None:
        with puck() as port:
            response = port.emulator.robot.ring.response
            for gap, count in ((0.005, 2133), (0.010, 1466), (0.030, 235), (0.070, 67)):
                assert response(gap) == pytest.approx(count, abs=1)
            assert response(0.2) == 0.0

    def test_a_touched_wall_saturates_whatever_its_colour(self) -> None:
        with puck(arena="corridor") as port:  # its walls are yellow
            ask(port, "D,500,500")
            while not port.emulator.truth().contact:
                pass_time(port, 0.01)
            assert max(numbers(port, "N")) > 1500

    @pytest.mark.parametrize("name", PLACES)
    def test_places_can_be_chosen(self, name: str) -> None:
        with puck(firmware=f"places={name}") as port:
            assert port.emulator.robot.model.sensor_bearings == ring(name)
            assert degrees(ring(name)[0]) == pytest.approx(-PLACES[name][0])

    def test_light_lowers_the_ambient_reading(self) -> None:
        with puck(arena="lamp-room") as port:
            lamp = load_arena("lamp-room").lamp[0].centre
            dark = numbers(port, "O")
            port.emulator.reset(Reset(pose=Pose(x=lamp[0] - 0.08, y=lamp[1], heading=0.0)))
            bright = numbers(port, "O")
            assert min(bright) < 1500 < max(bright)
            assert min(dark) > 2 * min(bright)

    def test_a_dirty_sensor_reads_less(self) -> None:
        with puck(fault="dead-sensor:sensor=3") as port:
            assert numbers(port, "N")[3] == 0
            assert numbers(port, "N")[2] > 0

    def test_an_epuck2_can_switch_them_off(self) -> None:
        with puck() as port:
            assert row(port, (0xF0, b"\0"), size=1) == b"\0"
            assert numbers(port, "N") == (0,) * 8
            row(port, (0xF0, b"\1"), size=1)
            assert max(numbers(port, "N")) > 0


class TestMotion:
    @pytest.mark.parametrize(("model", "one_g"), [("epuck", 800), ("epuck2", 750)])
    def test_gravity_and_tilt_are_felt(self, model: str, one_g: int) -> None:
        with puck(model) as port:
            x, y, z = numbers(port, "A")
            assert (x, y) == pytest.approx((2048, 2048), abs=15)
            assert z == pytest.approx(2048 + one_g, abs=15)
            port.emulator.robot.motion.tilt.pitch = pi / 6
            _, y, z = numbers(port, "A")
            assert y == pytest.approx(2048 + one_g / 2, abs=15)
            assert z == pytest.approx(2048 + one_g * 0.866, abs=15)

    def test_starts_and_bumps_are_felt(self) -> None:
        with puck() as port:
            ask(port, "D,1000,1000")
            felt = []
            while port.now < 8.0 and not port.emulator.truth().contact:
                felt.append(port.emulator.robot.motion._ahead)
                pass_time(port, 0.01)
            assert max(felt[:5]) > 5.0
            assert max(map(abs, felt[10:])) < 5.0
            bump = []
            for _ in range(5):
                bump.append(port.emulator.robot.motion._ahead)
                pass_time(port, 0.01)
            assert min(bump) < -3.0

    def test_turns_are_felt(self) -> None:
        with puck() as port:
            ask(port, "D,-300,300")
            pass_time(port, 0.5)
            *_, z = numbers(port, "g")
            rate = 2 * 303.03 * STEP / 0.053
            assert z / 131 == pytest.approx(degrees(rate), rel=0.08)
            ask(port, "D,0,0")
            pass_time(port, 0.5)
            assert abs(numbers(port, "g")[2]) < 131

    def test_a_first_revision_has_no_gyroscope(self) -> None:
        with puck("epuck", firmware="first-revision") as port:
            ask(port, "D,-300,300")
            pass_time(port, 0.2)
            assert numbers(port, "g") == (0, 0, 0)
            assert ask(port, "b") == b"b,1\r\n"
            assert row(port, "b", size=2) == b"\1\0"

    def test_the_inclination_is_the_firmwares(self) -> None:
        with puck() as port:
            port.emulator.robot.motion.tilt.roll = pi / 2
            length, orientation, inclination = np.frombuffer(row(port, "A", size=12), "<f4")
            assert length == pytest.approx(750, rel=0.05)
            assert orientation == pytest.approx(90.0, abs=2.0)
            assert inclination == pytest.approx(90.0, abs=2.0)


class TestOtherSenses:
    def test_time_of_flight_is_the_way_to_the_wall(self) -> None:
        with puck() as port:
            (found,) = codes.unpack(row(port, 0xF3, size=2))
            scene = port.emulator.robot.chassis.scene
            free, _ = scene.cast(np.array([[0.033, 0.0]]), np.array([[1.0, 0.0]]))
            assert found == pytest.approx(1000 * free[0], rel=0.1)
            assert codes.unpack(row(port, 0xF3, size=2)) == (found,)  # ten times a second
            row(port, (0xEF, b"\0"), size=1)
            pass_time(port, 1.0)
            assert codes.unpack(row(port, 0xF3, size=2)) == (found,)

    def test_ground_sensors_see_what_is_painted(self, tmp_path: Path) -> None:
        arena = tmp_path / "line.toml"
        arena.write_text(
            'version = 1\ntitle = "a line"\nfloor = [1.0, 1.0, 1.0]\nstart = {x = 0.0, y = 0.0}\n'
            "free = {points = [[-0.1, 0.0], [0.1, 0.0]], half_width = 0.05}\n"
            "[[paint]]\npoints = [[-1.0, 0.0], [1.0, 0.0]]\nwidth = 0.01\n"
        )
        with puck(arena=str(arena), firmware="ground") as port:
            left, middle, right, *_ = numbers(port, "M")
            assert middle < 250
            assert min(left, right) > 850
        with puck(arena=str(arena)) as port:
            assert numbers(port, "M") == (0,) * 5

    def test_keys_of_a_remote_control_drive_it(self) -> None:
        with puck() as port:
            robot = port.emulator.robot
            robot.press_key(2)
            assert numbers(port, "E") == (600, 600)
            robot.press_key(1, address=3)  # of another device
            assert numbers(port, "E") == (600, 600)
            robot.press_key(6)
            assert numbers(port, "E") == (600, -600)
            assert ask(port, "G") == b"g IR check : 0x1, address : 0x0, data : 0x6\r\n"
            robot.press_key(5)
            assert numbers(port, "E") == (0, 0)

    def test_the_battery_runs_empty_by_its_fault(self) -> None:
        with puck(fault="empty-battery:at=0,for=10") as port:
            before = numbers(port, "b")
            pass_time(port, 5.0)
            assert numbers(port, "b") < before

    def test_the_selector_is_where_it_was_set(self) -> None:
        with puck(firmware="selector=8") as port:
            assert numbers(port, "C") == (8,)
            assert sensors(port).selector == 8

    def test_all_sensors_are_those_of_the_other_requests(self) -> None:
        with puck(firmware="ground") as port:
            ask(port, "P,70000,-5")
            found = sensors(port)
            assert found.steps == (70000 - 65536, -5)
            assert found.battery == numbers(port, "b")[0]
            assert found.acceleration[2] == pytest.approx(768, abs=15)
            assert found.temperature == 27
            assert all(300 < value < 600 for value in found.ground)


class TestLamps:
    def test_actions_are_off_on_and_toggle(self) -> None:
        with puck() as port:
            panel = port.emulator.robot.panel
            for request, lit in (("B,1", True), ("B,2", False), ("B,2", True), ("B,0", False)):
                ask(port, request)
                assert panel.body is lit
            ask(port, "L,9,1")
            assert panel.ring == [True] * 8
            ask(port, "L,3,0")
            assert panel.ring.count(True) == 7
            ask(port, "F,1")
            ask(port, "S")
            assert panel.ring == [False] * 8
            assert panel.front

    def test_rows_and_packets_switch_them(self) -> None:
        with puck() as port:
            port.write(codes.row(("L", b"\x08\x01"), ("L", b"\x09\x01"), ("L", b"\x01\x01")))
            pass_time(port, 0.01)
            panel = port.emulator.robot.panel
            assert (panel.body, panel.front, panel.ring[1], panel.colours[0]) == (True,) * 3 + (10,)
            wanted = Actuators(leds=0b000101, colours=(0, 0, 0, 1, 2, 3, *[0] * 6))
            row(port, (0xF7, wanted.pack()), "Q", size=4)
            assert panel.ring == [True, False, False, True, True, False, False, False]
            assert (panel.body, panel.front) == (False, False)


class TestBehaviour:
    def test_obstacles_are_avoided_when_it_is_told_to(self) -> None:
        with puck() as port:
            wanted = Actuators(Behaviour.AVOID, (600, 600))
            row(port, (0xF7, wanted.pack()), "Q", size=4)
            for _ in range(60):
                pass_time(port, 0.5)
                assert not port.emulator.truth().touched
            row(port, (0xF7, Actuators().pack()), "Q", size=4)
            pass_time(port, 0.1)
            assert not port.emulator.robot.moving

    def test_the_force_field_is_the_firmwares(self) -> None:
        assert avoid((100, 100), (0,) * 8) == (100, 100)
        assert avoid((100, 100), (40, 0, 0, 0, 0, 0, 0, 0)) == (100 - 20 - 80, 100 - 20 + 80)
        assert avoid((-100, 100), (0, 0, 40, 0, 0, 0, 0, 0)) == (-100 - 160, 100 + 160)
        assert avoid((7, 7), (4,) * 8) == (7, 7)

    def test_an_epuck_resets_and_greets(self) -> None:
        with puck("epuck") as port:
            ask(port, "P,5,6")
            assert ask(port, "R") + port.read(len(GREETING)) == b"r\r\n" + GREETING
            assert numbers(port, "Q") == (0, 0)

    def test_an_epuck2_does_not(self) -> None:
        with puck("epuck2") as port:
            ask(port, "P,5,6")
            port.write(b"R\r")
            port.timeout = 0.1
            assert port.read(100) == b""
            assert numbers(port, "Q") == (5, 6)

    @pytest.mark.parametrize("model", MODELS)
    def test_a_reset_by_a_fault_is_greeted(self, model: str) -> None:
        with puck(model, fault="reset:at=0.5") as port:
            port.timeout = 1.0
            ask(port, "P,5,6")
            assert port.read(1000) == GREETING
            assert numbers(port, "Q") == (0, 0)

    @pytest.mark.parametrize(
        ("model", "profile", "line"),
        [
            ("epuck", "", b"v,Version 1.2.2 August 2008 GCtronic\r\n"),
            ("epuck", "btcom", b"v,Version 2.0.0 January 2008\r\n"),
            ("epuck2", "", b"v,Version 2.0 January 2018 GCtronic\r\n"),
        ],
    )
    def test_versions_differ(self, model: str, profile: str, line: bytes) -> None:
        with puck(model, profile=profile) as port:
            assert ask(port, "V") == line

    def test_the_same_seed_gives_the_same_bytes(self) -> None:
        def talk() -> bytes:
            with puck() as port:
                said = b""
                for request in ("D,300,200", "N", "O", "A", "g", "U"):
                    said += ask(port, request)
                    pass_time(port, 0.1)
                return said + row(port, 0xF8, "I", size=103 + 3203)

        assert talk() == talk()


class TestPictures:
    @pytest.mark.parametrize(
        ("request_line", "head", "size"),
        [
            ("C", (1, 40, 40), 3200),
            ("J,0,40,40,8", (0, 40, 40), 1600),
            ("J,2,40,40,8", (2, 40, 40), 3200),
            ("J,1,52,39,8", (1, 52, 39), 4056),
            ("J,1,100,100,8", (1, 40, 40), 3200),
            ("J,1,-5,-5,8", (1, 40, 40), 3200),
            ("J,1,40,40,-8", (1, 40, 40), 3200),
            ("J,1,8,6,8,600,400", (1, 8, 6), 96),
            ("J,1,8,6,99999,9999,-9999", (1, 8, 6), 96),
        ],
    )
    def test_have_a_head_and_so_many_bytes(
        self, request_line: str, head: tuple[int, ...], size: int
    ) -> None:
        with puck() as port:
            ask(port, request_line)
            assert tuple(row(port, "I", size=3)) == head
            assert len(port.read(size)) == size
            port.timeout = 0.1
            assert port.read(1) == b""

    def test_show_what_is_ahead(self) -> None:
        with puck(arena="toys", firmware="selector=3") as port:
            # a red box ahead, between a blue sky and the grey floor
            port.read(0)
            pixels = np.frombuffer(row(port, "I", size=3203)[3:], ">u2").reshape(40, 40)
            red, green, blue = pixels >> 11, pixels >> 5 & 63, pixels & 31
            assert blue[2].mean() > red[2].mean()
            middle = red[20, 15:25].mean()
            assert middle > 2 * blue[20, 15:25].mean()
            assert np.abs(red[38] - green[38] / 2).mean() < 2

    def test_grey_ones_are_the_light_of_coloured_ones(self) -> None:
        with puck(arena="toys") as port:
            ask(port, "J,0,40,40,8")
            grey = np.frombuffer(row(port, "I", size=1603)[3:], np.uint8).reshape(40, 40)
            ask(port, "J,2,40,40,8")
            light = np.frombuffer(row(port, "I", size=3203)[3:], np.uint8)[::2].reshape(40, 40)
            assert np.abs(grey.astype(int) - light).mean() < 4

    def test_a_window_is_a_part(self) -> None:
        with puck(arena="toys") as port:
            ask(port, "J,0,40,40,8")
            whole = np.frombuffer(row(port, "I", size=1603)[3:], np.uint8).reshape(40, 40)
            ask(port, "J,0,20,20,8,160,80")
            part = np.frombuffer(row(port, "I", size=403)[3:], np.uint8).reshape(20, 20)
            assert np.abs(whole[:20, :20].astype(int) - part).mean() < 4

    def test_a_dark_wire_takes_its_time(self) -> None:
        with puck() as port:
            started = port.now
            row(port, "I", size=3203)
            assert port.now - started == pytest.approx((3203 + 2) * 10 / 115_200, abs=0.001)


class TestWifi:
    def test_every_packet_is_answered(self) -> None:
        with puck(profile="wifi") as port:
            reader = WifiReader()
            port.write(WifiRequest(actuators=Actuators(wheels=(300, 300))).pack())
            ((head, body),) = reader.feed(port.read(105))
            assert head == SENSORS
            found = AllSensors.unpack(body[:103])
            assert found.selector == 15
            pass_time(port, 1.0)
            port.emulator.robot.pressed = True
            port.write(WifiRequest(pictures=True).pack())
            heads = reader.feed(port.read(38401 + 105))
            assert [head for head, _ in heads] == [PICTURE, SENSORS]
            found = AllSensors.unpack(heads[1][1][:103])
            assert found.steps[0] == pytest.approx(303, abs=5)
            assert found.last == 1
            port.write(WifiRequest(sensors=False).pack())
            assert port.read(1) == b"\3"


class TestMany:
    def test_kheperas_and_epucks_share_a_world(self) -> None:
        options = "?model=khepera,epuck,epuck2&robots=3&drift=none"
        lines = []
        for number in (1, 2, 3):
            with open_robot(f"khepera://open-box{options}&robot={number}", timeout=1) as port:
                request = b"B\n" if number == 1 else b"V\r"
                port.write(request)
                lines.append(port.read_until(b"\n"))
                fleet = port.emulator._fleet
                assert [each.radius for each in fleet.members] == [0.0275, 0.035, 0.035]
        assert [line[:9] for line in lines] == [b"b,5.01,5.", b"v,Version", b"v,Version"]

    def test_a_khepera_sees_an_epuck(self) -> None:
        with open_robot(
            "khepera://open-box?model=khepera,epuck2&robots=2&drift=none", timeout=1
        ) as port:
            first, second = port.emulator._fleet.members
            first.reset(Reset(pose=Pose(x=0.0, y=0.0, heading=0.0)))
            second.reset(Reset(pose=Pose(x=0.08, y=0.0, heading=pi)))
            port.write(b"N\n")
            proximity = [int(word) for word in port.read_until(b"\n").split(b",")[1:]]
            assert max(proximity[2:4]) > 200
            assert max(second.robot.proximity()) > 100

    def test_profiles_and_switches_go_to_those_that_know_them(self) -> None:
        options = RobotOptions(
            model="khepera,epuck,epuck2",
            robots=3,
            profile="btcom",
            firmware=("ground", "reject-beyond"),
            turret=("gripper",),
        )
        khepera, epuck, epuck2 = options.setups()
        assert khepera.choices.reject_beyond
        assert khepera.turrets
        assert not epuck.turrets
        assert epuck.choices.generation.name == "btcom"
        assert epuck2.choices.generation.name == "gctronic2"
        assert epuck.choices.switches.ground


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            {"model": "epuck", "profile": "wifi"},
            "unknown profile 'wifi': there are gctronic, btcom",
        ),
        ({"model": "khepera", "profile": "btcom"}, "Kheperas have one firmware"),
        ({"model": "epuck2", "turret": ("gripper",)}, "e-pucks carry no turrets"),
        ({"model": "epuck", "firmware": ("selector=16",)}, "selector='16': give 0 to 15"),
        ({"model": "epuck", "firmware": ("places=mars",)}, "give firmware, webots, ros, enki"),
        ({"model": "epuck", "firmware": ("error-dot",)}, "unknown firmware option 'error-dot'"),
        ({"model": "epuck3"}, "no robot model 'epuck3'; did you mean epuck"),
    ],
)
def test_options_that_do_not_fit_are_told(options: dict[str, Any], says: str) -> None:
    with pytest.raises(EmulatorError, match=says):
        RobotOptions(**options).setup()


def test_a_setup_without_choices_is_that_of_the_usual_firmware() -> None:
    robot = Emulator(Setup(load_arena("open-box"), model=EPUCK2, baud=None))
    robot.write(b"V\r")
    robot.advance(0.0)
    assert robot.read().startswith(b"v,Version 2.0 January 2018")
    robot.close()


def test_a_url_of_an_unknown_profile_is_refused() -> None:
    with pytest.raises(serial.SerialException, match="unknown profile"):
        serial.serial_for_url("khepera://open-box?model=epuck&profile=x")
