"""Choices where e-pucks differ among each other, or sources about them.

A switch is set as `--firmware NAME` or `--firmware NAME=VALUE`; a firmware as `--profile NAME`.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from khepera_protocol.epuck.generations import GCTRONIC2, GENERATIONS, Generation
from khepera_protocol.epuck.wifi import WIFI

from khepera_emulator.robot.epuck.models import PLACES, EpuckModel
from khepera_emulator.robot.switches import Form, parse_switches, switch_names

_SELECTOR: Final = re.compile(r"[0-9]|1[0-5]", re.ASCII), "give 0 to 15"
_PLACES: Final = re.compile("|".join(PLACES)), f"give {', '.join(PLACES)}"

_FORMS: Final[dict[str, Form]] = {"selector": _SELECTOR, "places": _PLACES}

_BLUETOOTH, _WIFI_POSITION = 3, 15


@dataclass(frozen=True, slots=True)
class Switches:
    """Properties of one e-puck.

    Attributes:
        ground: the board of ground sensors is mounted.
        first_revision: an e-puck before hardware 1.3: no gyroscope, and of the battery only
            whether it is good.
        selector: position of the selector that C reads.
        places: whose table of the infrared sensors' places holds.
    """

    ground: bool = False
    first_revision: bool = False
    selector: int = _BLUETOOTH
    places: str = "firmware"


@dataclass(frozen=True, slots=True)
class Choices:
    """A firmware and properties of one e-puck.

    Attributes:
        generation: the firmware.
        wifi: whether it speaks packets on WiFi, and not the line.
        switches: the properties.
    """

    generation: Generation
    wifi: bool = False
    switches: Switches = Switches()


SWITCHES: Final = tuple(switch_names(Switches()))


def parse_choices(model: EpuckModel, items: Iterable[str] = (), profile: str = "") -> Choices:
    """Read switches and a profile; see `robot.kind.Kind.choices`."""
    name = profile or model.profiles[0]
    wifi = name == WIFI
    usual = Switches(selector=_WIFI_POSITION if wifi else _BLUETOOTH)
    switches = parse_switches(usual, items, _FORMS)
    found = [each for each in GENERATIONS if each.name == name]
    return Choices(found[0] if found else GCTRONIC2, wifi, switches)
