"""A map to drive by, learned in a second or two: it knows a few situations around the start."""

from pathlib import Path

from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.settings import MindSettings
from macor_hil.runs.learning.checkpoints import train_map
from macor_hil.runs.training import Schedule

OPEN_BOX = "khepera://open-box?seed=1&drift=none"


def train_shortly(path: Path, port: str = OPEN_BOX, *, tuning: int = 15, random: int = 60) -> Path:
    """Train on a robot in this process; returns the path of the map."""
    schedule = Schedule(tuning=tuning, random=random, reactive=0, session=random)
    with open_hardware(port) as hardware:
        driven = (Driver(hardware.robot), hardware.camera, hardware.bench)
        train_map(path, MindSettings(), schedule, port, driven, lambda _: None)
    return path
