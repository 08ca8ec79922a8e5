"""Turrets by themselves, told the time and a made-up world."""

from typing import Any

import numpy as np
import pytest
from khepera_protocol.serial.errors import RequestError
from khepera_protocol.serial.turrets import READING_PERIODS

from khepera_emulator.errors import EmulatorError
from khepera_emulator.turrets.catalogue import TURRET_CLASSES, find_turrets
from khepera_emulator.turrets.general_io import GeneralIO
from khepera_emulator.turrets.gripper import Gripper
from khepera_emulator.turrets.k213 import K213
from khepera_emulator.turrets.rack import Fittings, Rack, mount
from khepera_emulator.turrets.radio import AIR_TIME, Radio, RadioMedium
from khepera_emulator.turrets.turret import Piece, Site

RADIUS = 0.0275


class Scenery:
    """White everywhere, but for what lies within some bearings; nothing beyond others."""

    def __init__(self) -> None:
        self.black = (-10.0, -10.0)
        self.open = (-10.0, -10.0)
        self.origins = np.empty((0, 2))

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        bearings = np.degrees(np.arctan2(directions[:, 1], directions[:, 0]))
        self.origins = origins
        grey = np.where((bearings > self.black[0]) & (bearings < self.black[1]), 0.0, 1.0)
        free = (bearings > self.open[0]) & (bearings < self.open[1])
        return np.where(free, np.inf, 0.2), grey


class Table:
    """Things for a gripper: one piece at a place, that can be lifted or not."""

    def __init__(self, piece: Piece | None, light: bool = True) -> None:
        self.piece = piece
        self.light = light
        self.log: list[tuple[Any, ...]] = []
        self.jaw = (0.0, 0.0), (0.0, 0.0)

    def between(self, left: tuple[float, float], right: tuple[float, float]) -> Piece | None:
        self.jaw = left, right
        return self.piece

    def lift(self, piece: Piece) -> bool:
        self.log.append(("lift", piece.number))
        if self.light:
            self.piece = None
        return self.light

    def carry(self, piece: Piece, place: tuple[float, float]) -> None:
        self.log = [entry for entry in self.log if entry[0] != "carry"]
        self.log.append(("carry", piece.number, place))

    def put(self, piece: Piece, place: tuple[float, float]) -> None:
        self.piece = piece
        self.log.append(("put", piece.number, place))


class Nest:
    """A place for turrets."""

    def __init__(self, piece: Piece | None = None, light: bool = True) -> None:
        self.scenery = Scenery()
        self.table = Table(piece, light)
        self.place = (0.0, 0.0, 0.0)
        self.site = Site(RADIUS, lambda: self.place, self.scenery, 0.5, self.table)


POST = Piece(0, 0.020, 77)


def gripper(nest: Nest) -> Gripper:
    return Gripper(nest.site)


def ask(
    turret: Gripper | K213 | Radio, letter: str, *arguments: int, now: float = 0.0
) -> tuple[int, ...]:
    turret.step(now)
    return turret.answer(letter, arguments, now)


def hold(turret: Gripper, now: float = 0.0) -> float:
    """Arm down, fingers closed; returns when that is done."""
    ask(turret, "E", 255, now=now)
    ask(turret, "D", 1, now=now + 1.0)
    ask(turret, "B", now=now + 1.6)
    return now + 1.6


def test_fingers_take_their_time() -> None:
    turret = gripper(Nest())
    ask(turret, "D", 1, now=1.0)
    assert ask(turret, "H", 0, now=1.0) == (255,)
    assert ask(turret, "H", 0, now=1.3) == pytest.approx((127,), abs=1)
    assert ask(turret, "H", 0, now=1.59)[0] > 0
    assert ask(turret, "H", 0, now=1.6) == (0,)
    ask(turret, "D", 0, now=2.0)
    assert ask(turret, "H", 0, now=2.6) == (255,)


def test_the_arm_takes_a_second_and_stops_at_its_back() -> None:
    turret = gripper(Nest())
    assert ask(turret, "H", 1) == (150,)
    ask(turret, "E", 255)
    assert ask(turret, "H", 1, now=0.5)[0] == pytest.approx(202, abs=1)
    assert ask(turret, "H", 1, now=0.98)[0] < 255
    assert ask(turret, "H", 1, now=1.0) == (255,)
    ask(turret, "E", 0, now=1.0)
    assert ask(turret, "H", 1, now=9.0) == (150,)


@pytest.mark.parametrize("looks", [1, 7, 100])
def test_how_often_one_looks_changes_nothing(looks: int) -> None:
    # the arm is down after 0.8 s of its way, when the fingers are closed already: nothing held
    turret = gripper(Nest(POST))
    ask(turret, "E", 255)
    ask(turret, "D", 1)
    for look in range(1, looks + 1):
        turret.step(2.0 * look / looks)
    assert ask(turret, "F", now=2.0) == (0,)
    assert ask(turret, "G", now=2.0) == (0,)
    assert ask(turret, "H", 0, now=2.0) == (0,)


def test_a_post_in_front_breaks_the_beam_once_the_arm_is_down() -> None:
    nest = Nest(POST)
    nest.place = 1.0, 2.0, np.pi / 2
    turret = gripper(nest)
    assert ask(turret, "G") == (0,)
    ask(turret, "E", 255)
    assert ask(turret, "G", now=1.0) == (255,)
    assert ask(turret, "F", now=1.0) == (0,)
    left, right = nest.table.jaw
    assert left == pytest.approx((1.0 - 0.025, 2.0 + RADIUS + 0.020))
    assert right == pytest.approx((1.0 + 0.025, 2.0 + RADIUS + 0.020))


def test_fingers_stop_at_what_they_hold_and_feel_it() -> None:
    turret = gripper(Nest(POST))
    now = hold(turret)
    assert ask(turret, "F", now=now) == (77,)
    assert ask(turret, "H", 0, now=now) == (102,)  # 20 of 50 mm
    ask(turret, "D", 0, now=now)
    assert ask(turret, "F", now=now + 0.6) == (0,)
    assert ask(turret, "G", now=now + 0.6) == (255,)
    assert ask(turret, "H", 0, now=now + 0.6) == (255,)


def test_a_held_thing_goes_up_along_and_down() -> None:
    nest = Nest(POST)
    turret = gripper(nest)
    now = hold(turret)
    ask(turret, "E", 150, now=now)
    turret.step(now + 1.0)
    assert nest.table.log[0] == ("lift", 0)
    assert ask(turret, "F", now=now + 1.0) == (77,)
    nest.place = 0.5, 0.0, 0.0
    turret.step(now + 2.0)
    assert nest.table.log[-1] == ("carry", 0, pytest.approx((0.5 + RADIUS + 0.020, 0.0)))
    ask(turret, "E", 255, now=now + 2.0)
    ask(turret, "D", 0, now=now + 3.0)
    turret.step(now + 3.6)
    assert nest.table.log[-1] == ("put", 0, pytest.approx((0.5 + RADIUS + 0.020, 0.0)))
    assert ask(turret, "F", now=now + 3.6) == (0,)


def test_what_was_put_down_can_be_lifted_again() -> None:
    nest = Nest(POST)
    turret = gripper(nest)
    now = 0.0
    for _ in range(2):
        now = hold(turret, now)
        ask(turret, "E", 150, now=now)
        ask(turret, "D", 0, now=now + 1.0)
        now += 2.0
        turret.step(now)
    assert [entry[0] for entry in nest.table.log if entry[0] != "carry"] == ["lift", "put"] * 2


def test_what_stands_fast_slips_out() -> None:
    nest = Nest(POST, light=False)
    turret = gripper(nest)
    now = hold(turret)
    ask(turret, "E", 150, now=now)
    assert ask(turret, "F", now=now + 1.0) == (0,)
    assert ask(turret, "H", 0, now=now + 1.0) == (0,)


def test_a_robot_that_drives_off_loses_what_stands_fast() -> None:
    nest = Nest(POST, light=False)
    turret = gripper(nest)
    now = hold(turret)
    nest.table.piece = None
    assert ask(turret, "F", now=now + 0.01) == (0,)


def test_power_on_puts_down_what_was_lifted() -> None:
    nest = Nest(POST)
    turret = gripper(nest)
    ask(turret, "E", 150, now=hold(turret))
    turret.step(5.0)
    turret.power_on()
    assert nest.table.log[-1][0] == "put"
    assert (ask(turret, "H", 0, now=5.0), ask(turret, "H", 1, now=5.0)) == ((255,), (150,))


def k213(nest: Nest, first: int = 1) -> K213:
    return K213(nest.site, np.random.default_rng(0), first)


def test_pixels_run_from_left_to_right_over_36_degrees() -> None:
    nest = Nest()
    nest.scenery.black = (9.0, 17.9)
    image = np.array(ask(k213(nest), "N"))
    assert image.shape == (64,)
    assert (image[:16] < 80).all()
    assert (image[16:] > 150).all()
    assert ((image >= 0) & (image <= 255)).all()
    assert nest.scenery.origins == pytest.approx(np.tile([RADIUS, 0.0], (64, 1)))


def test_beyond_all_solids_is_the_sky() -> None:
    nest = Nest()
    nest.scenery.open = (-20.0, 0.0)
    image = np.array(ask(k213(nest), "N"))
    assert image[:32].mean() - image[32:].mean() == pytest.approx(195 / 2, abs=15)


def test_the_image_falls_off_towards_its_edges() -> None:
    image = np.array(ask(k213(Nest()), "N"))
    assert image[:4].mean() / image[30:34].mean() == pytest.approx(0.83, abs=0.05)


def test_parts_are_of_one_image() -> None:
    turret = k213(Nest())
    image = ask(turret, "N")
    assert ask(turret, "S") == image[::2]
    assert ask(turret, "T") == image[::4]
    assert ask(turret, "Q", 3) == image[2:10]
    assert ask(turret, "R", 49) == image[48:]
    assert ask(turret, "O") == (image.index(max(image)) + 1,)
    assert ask(turret, "P") == (image.index(min(image)) + 1,)
    high, low = ask(turret, "L")
    assert high + low / 256 == pytest.approx(sum(image) / 64, abs=1 / 256)
    pairs = zip(image[::2], image[1::2], strict=True)
    assert ask(turret, "M") == tuple(left // 16 * 16 + right // 16 for left, right in pairs)


def test_pixels_can_be_numbered_from_0() -> None:
    turret = k213(Nest(), first=0)
    image = ask(turret, "N")
    assert ask(turret, "Q", 0) == image[:8]
    assert ask(turret, "O") == (image.index(max(image)),)


@pytest.mark.parametrize(
    ("letter", "start", "first"), [("Q", 0, 1), ("Q", 58, 1), ("R", 50, 1), ("Q", 57, 0)]
)
def test_there_is_nothing_beyond_the_ends(letter: str, start: int, first: int) -> None:
    with pytest.raises(RequestError) as caught:
        ask(k213(Nest(), first), letter, start)
    assert caught.value.reply == "z,Protocol error"


@pytest.mark.parametrize(("code", "period"), list(enumerate(READING_PERIODS)))
def test_there_is_a_new_image_once_a_period(code: int, period: float) -> None:
    turret = k213(Nest())
    turret.step(5.0)
    ask(turret, "U", code, now=5.0)
    image = ask(turret, "N", now=5.0)
    assert ask(turret, "N", now=5.0 + period - 0.01) == image
    second = ask(turret, "N", now=5.0 + period)
    assert second != image
    assert ask(turret, "N", now=5.0 + 2 * period - 0.01) == second


def test_images_keep_their_beat_when_nobody_looks() -> None:
    turret = k213(Nest())
    turret.step(0.3)
    image = ask(turret, "N", now=0.39)
    assert ask(turret, "N", now=0.4) != image


def test_an_image_is_of_where_the_robot_was() -> None:
    nest = Nest()
    turret = k213(nest)
    nest.place = 0.3, 0.0, 0.0
    turret.step(0.1)
    ask(turret, "N", now=0.1)
    assert nest.scenery.origins[0] == pytest.approx((RADIUS, 0.0))
    ask(turret, "N", now=0.2)
    assert nest.scenery.origins[0] == pytest.approx((0.3 + RADIUS, 0.0))


DATA = (72, 105, 33, *range(13))


def pair() -> tuple[Radio, Radio]:
    medium = RadioMedium()
    return Radio(medium, 1), Radio(medium, 2)


def test_a_message_goes_from_robot_to_robot() -> None:
    one, two = pair()
    ask(one, "S", 2, 3, *DATA)
    assert ask(one, "F") == (0,)
    assert ask(two, "F") == (1,)
    assert ask(one, "F", now=AIR_TIME) == (1,)
    assert ask(two, "F", now=AIR_TIME) == (3,)
    assert ask(two, "R", now=AIR_TIME) == (1, 3, 72, 105, 33, *(0,) * 13)
    assert ask(two, "F", now=AIR_TIME) == (1,)
    assert ask(two, "R", now=AIR_TIME) == (0,) * 18


def test_a_message_to_nobody_fails_until_the_next_one() -> None:
    one, two = pair()
    ask(one, "S", 9, 1, *DATA)
    assert ask(one, "F", now=1.0) == (5,)
    ask(one, "S", 2, 16, *DATA, now=1.0)
    assert ask(one, "F", now=2.0) == (1,)
    assert ask(two, "R", now=2.0) == (1, 16, *DATA)


def test_an_unread_message_is_not_written_over() -> None:
    one, two = pair()
    for now, first in ((0.0, 1), (1.0, 2)):
        ask(one, "S", 2, 1, first, *DATA[1:], now=now)
    assert ask(one, "F", now=2.0) == (5,)
    assert ask(two, "R", now=2.0)[:3] == (1, 1, 1)


def test_a_radio_that_sends_does_not_hear_and_takes_nothing_more() -> None:
    one, two = pair()
    ask(one, "S", 2, 1, *DATA)
    ask(two, "S", 1, 1, *DATA, now=0.01)
    ask(one, "S", 2, 1, *DATA, now=0.02)
    assert ask(one, "F", now=0.02) == (4,)
    assert ask(one, "F", now=AIR_TIME) == (5,)
    assert ask(two, "R", now=1.0) == (0,) * 18
    assert ask(one, "R", now=1.0)[0] == 2


def test_a_radio_made_anew_takes_the_place_of_the_one_before() -> None:
    medium = RadioMedium()
    Radio(medium, 2)
    two, one = Radio(medium, 2), Radio(medium, 1)
    ask(one, "S", 2, 1, *DATA)
    one.step(1.0)
    assert ask(two, "F") == (3,)
    medium.leave(2)
    ask(one, "S", 2, 1, *DATA, now=1.0)
    assert ask(one, "F", now=2.0) == (5,)


def test_a_radio_has_a_byte_for_its_number() -> None:
    with pytest.raises(EmulatorError, match="0 to 255, not 256"):
        Radio(RadioMedium(), 256)


def test_general_io_is_on_the_bus_and_the_inputs() -> None:
    turret = GeneralIO()
    rack = Rack([turret])
    assert rack.read_bus(32) == 255
    assert rack.read_bus(33) is None
    turret.inputs = 15
    turret.volts[4] = 512
    assert rack.read_bus(32) == 15
    assert [rack.analogue(channel) for channel in range(6)] == [None, None, None, 0, 512, 0]
    rack.write_bus(31, 1)
    assert turret.outputs == 0
    rack.write_bus(32, 85)
    assert turret.outputs == 85
    rack.power_on()
    assert (turret.outputs, turret.inputs) == (0, 15)


def test_each_turret_is_found_by_its_number() -> None:
    fittings = Fittings(Nest().site, RadioMedium())
    rack = mount(find_turrets(TURRET_CLASSES.names()), fittings, np.random.default_rng(0))
    found = {number: turret.kind.name for number in range(256) if (turret := rack.find(number))}
    assert found == {1: "gripper", 2: "k213", 4: "radio"}
    assert not Rack([])


def test_what_a_turret_reads_does_not_depend_on_the_others() -> None:
    def image(*names: str) -> tuple[int, ...]:
        fittings = Fittings(Nest().site, RadioMedium(), first=0)
        turret = mount(find_turrets(names), fittings, np.random.default_rng(5)).find(2)
        assert turret is not None
        return turret.answer("N", (), 0.0)

    assert image("k213") == image("gripper", "radio", "k213")


def test_names_of_turrets_are_checked() -> None:
    assert find_turrets(["k213", "radio"]) == (K213, Radio)
    with pytest.raises(EmulatorError, match="no turret 'arm'; there are gripper, k213"):
        find_turrets(["arm"])
    with pytest.raises(EmulatorError, match="twice"):
        find_turrets(["radio", "k213", "radio"])
