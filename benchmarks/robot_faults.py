"""Draw what each fault of the robot does, beside a robot without any.

python benchmarks/robot_faults.py        # writes docs/pictures/robot-faults.png
"""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from khepera_protocol.palette import drawing_style
from khepera_protocol.zenoh.payloads import Pose, Reset
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from khepera_emulator.robot.emulator import Emulator
from khepera_emulator.robot.options import UrlOptions

PICTURE = Path(__file__).parents[1] / "docs/pictures/robot-faults.png"

STEP = 0.05
BEFORE = Pose(x=0.38, y=0.0, heading=0.0)
MIDDLE = Pose(x=0.0, y=0.0, heading=0.0)

NONE = "no fault"
CAMERA = ("frozen-camera", "dark-camera", "turned-camera:angle=60")

Look = Callable[[Emulator], Sequence[float]]


def robot(fault: str) -> Emulator:
    """Make a robot in the open box, with one fault or none."""
    url = "khepera://open-box?drift=none&baud=unpaced" + (f"&fault={fault}" if fault else "")
    return Emulator(UrlOptions.from_url(url).setup())


def ask(emulator: Emulator, request: str) -> list[float]:
    """Ask a robot, and return the numbers that it answers; NaN if it says something else."""
    emulator.read()
    emulator.write(request.encode() + b"\r")
    emulator.advance(emulator.now + 0.01)
    reply = emulator.read().decode()
    if not reply.startswith(request[0].lower() + ","):
        return [np.nan] * 8
    return [float(word) for word in reply.split(",")[1:]]


def drive(fault: str, start: Pose, begin: str, seconds: float, look: Look) -> tuple[Any, Any]:
    """Drive with a fault: times, shape (T,), and what is looked at, shape (T, ...)."""
    with closing(robot(fault)) as emulator:
        emulator.reset(Reset(pose=start))
        ask(emulator, begin)
        times, seen = [], []
        while emulator.now < seconds:
            emulator.advance(emulator.now + STEP)
            times.append(emulator.now)
            seen.append(look(emulator))
        return np.array(times), np.array(seen)


def panorama(fault: str) -> Any:
    """Return what the camera gives after the robot was put elsewhere, as red, green and blue."""
    with closing(robot(fault)) as emulator:
        emulator.panorama()
        emulator.reset(Reset(pose=Pose(x=0.3, y=0.2, heading=0.4)))
        return emulator.panorama()[:, :, ::-1]


def draw_sensors(axes: Axes) -> None:
    """Draw what a sensor reads on the way to a wall."""
    for name in ("", "dead-sensor:at=3.2", "stuck-sensor:at=3.2", "dirty-sensor:at=1"):
        fault = f"{name},sensor=2" if name else ""
        times, counts = drive(fault, BEFORE, "D,3,3", 3.5, lambda robot: ask(robot, "N"))
        axes.plot(times, counts[:, 2], label=name or NONE, lw=1.5 if name else 3.0)
    axes.set(title="Sensor 2 on the way to a wall", xlabel="s")
    axes.set_ylabel("proximity, counts")


def draw_motors(axes: Axes) -> None:
    """Draw how fast a wheel turns."""
    for name in ("", "weak-motor:part=0.1", "jammed-motor:for=1"):
        fault = f"{name},at=1,wheel=left" if name else ""
        times, speeds = drive(fault, MIDDLE, "D,15,15", 3.0, lambda robot: ask(robot, "E"))
        axes.plot(times, speeds[:, 0], label=name or NONE, lw=1.5 if name else 3.0)
    axes.set(title="Left wheel, told to turn at 15; faults from 1 s on", xlabel="s", ylim=(-1, 20))
    axes.set_ylabel("speed, counts in 10 ms")


def draw_ways(axes: Axes) -> None:
    """Draw ways straight on."""
    for name in ("", "worn-wheel:wheel=left"):
        _, way = drive(name, MIDDLE, "D,20,20", 2.5, _place)
        axes.plot(*(100 * way.T), label=name or NONE, lw=1.5 if name else 3.0)
    axes.set(title="Way straight on (left wheel: 95 %)", xlabel="x, cm", ylabel="y, cm")
    axes.set_ylim(-5, 15)
    axes.set_aspect("equal")


def draw_battery(axes: Axes) -> None:
    """Draw a battery that runs empty, and what becomes of the drive."""
    fault = "empty-battery:at=1,for=4"
    times, seen = drive(fault, MIDDLE, "D,10,10", 7.0, _battery)
    axes.plot(times, seen[:, 0], label="A/D input 0, counts")
    axes.plot(times, 20 * seen[:, 1], label="speed of a wheel, x 20", ls="--")
    axes.set(title=fault, xlabel="s", ylim=(0, 650))


def draw() -> Figure:
    """Draw all kinds."""
    figure = Figure(figsize=(11.5, 10.0), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=(1.6, 1.0))
    top, below = parts
    panels = (draw_sensors, draw_motors, draw_ways, draw_battery)
    for draw_panel, axes in zip(panels, top.subplots(2, 2).flat, strict=True):
        draw_panel(axes)
        axes.legend()
    shown = {NONE: "", **{name: name for name in CAMERA}}
    for axes, (title, fault) in zip(below.subplots(2, 2).flat, shown.items(), strict=True):
        axes.imshow(panorama(fault))
        axes.set_title(title)
        axes.axis("off")
    return figure


def _place(emulator: Emulator) -> Sequence[float]:
    pose = emulator.truth().pose
    return pose.x, pose.y


def _battery(emulator: Emulator) -> Sequence[float]:
    return ask(emulator, "I,0")[0], ask(emulator, "E")[0]


if __name__ == "__main__":
    with drawing_style():
        draw().savefig(PICTURE)
