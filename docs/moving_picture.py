"""Draws a robot that plans in the maze: python docs/moving_picture.py runs/corridor.npz FILE.gif.

The map is one of the corridor, as of `make run`. On the left is the floor plan with the
way driven (white), places that hypothetical drives lead to, the brighter the likelier, and the best
drive (red); on the right what the robot sees. What is hidden from
it counts as floor. The drive is in virtual time, and the same for the same map.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from khepera_protocol.palette import SCALE, VERMILION
from khepera_protocol.zenoh.payloads import Outline, Pose, Reset
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from PIL import Image as Pictures

from khepera_emulator.senses.camera import HEIGHT
from macor_hil.arrays import Array, Image, Indices
from macor_hil.commands import COMMANDS
from macor_hil.errors import MacorError
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.foresight.drives import hypothetical_drives
from macor_hil.mind.foresight.floor import clearance, solids
from macor_hil.mind.foresight.skill import Skill
from macor_hil.mind.map_file import load_map
from macor_hil.mind.memories.foresight import ForesightMemory
from macor_hil.mind.planners.foresight import Foresight
from macor_hil.runs.agent import Agent
from macor_hil.runs.trials import drive

PORT: Final = "khepera://maze?seed=5"
SEED: Final = 5
_MILLISECONDS: Final = 250
_COLOURS: Final = 64
_DPI: Final = 72
_FAR: Final = 15
"""Commands ahead up to which places are drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class Foreseen:
    """Everything that a robot foresees, in heights of its camera: ahead, to the left.

    Attributes:
        places: that hypothetical drives lead to, shape (n, 2).
        chances: to get there, shape (n,).
        way: places of the best drive, shape (commands, 2).
    """

    places: Array
    chances: Array
    way: Array


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """One picture: where the robot is, what it sees and foresees, and the command it takes."""

    pose: Pose
    image: Image
    foreseen: Foreseen
    command: str


def foresee(profile: Array, skill: Skill) -> Foreseen:
    """Return what the planner `foresight` weighs at a profile of the floor."""
    solid, drives = solids(profile), hypothetical_drives(skill.motions)
    chances = []
    for stride in drives:
        clear = clearance(solid, stride.ways.reshape(-1, 2)).reshape(stride.ways.shape[:2])
        through = skill.curve.survival(clear, stride.before).prod(axis=0)
        chances.append(through.reshape(len(COMMANDS), -1))
    value = np.zeros(drives[-1].poses)
    choices: list[Indices] = []
    for stride, chance in zip(reversed(drives), reversed(chances), strict=True):
        earned = stride.commands * skill.earns[:, np.newaxis] + value[stride.ends]
        worth = chance * earned + (1 - chance) * skill.collision
        choices.insert(0, worth.argmax(axis=0))
        value = worth.max(axis=0)
    pose, way, reached = 0, [np.zeros(2)], np.ones(1)
    places, likely = [], []
    for stride, chance, choice in zip(drives, chances, choices, strict=True):
        command = choice[pose]
        way.extend(stride.ways[:, command * chance.shape[1] + pose])
        pose = stride.ends[command, pose]
        there, ends = np.zeros(stride.poses), np.zeros((stride.poses, 2))
        np.maximum.at(there, stride.ends, reached * chance)
        ends[stride.ends.ravel()] = stride.ways[-1]
        reached = there
        if stride.before < _FAR:
            places.append(ends)
            likely.append(there)
    return Foreseen(np.concatenate(places), np.concatenate(likely), np.array(way))


def scenes(brain: Brain, skill: Skill) -> tuple[Outline, list[Scene]]:
    """Drive a trial in the maze; return the arena and a scene for every command."""
    shown = []
    with open_hardware(PORT) as hardware:
        assert hardware.bench is not None
        pose = hardware.bench.reset(Reset(seed=SEED)).pose
        agent = Agent(brain, Driver(hardware.robot), hardware.camera)
        for step in drive(agent, Foresight(), np.random.default_rng(SEED)):
            floor = step.before.moment.floor
            assert floor is not None
            foreseen, name = foresee(floor, skill), COMMANDS[step.command].name
            shown.append(Scene(pose, step.before.frame.image, foreseen, name))
            pose = hardware.bench.truth().pose
        return hardware.bench.outline(), shown


def pictures(outline: Outline, shown: list[Scene], eyes: PanoramaEyes) -> Iterator[Any]:
    """Draw one picture of each scene."""
    for number, scene in enumerate(shown):
        figure: Any = Figure(figsize=(8.4, 4.7), dpi=_DPI, layout="constrained")
        shape = [["plan", "mirror"], ["plan", "panorama"]]
        axes = figure.subplot_mosaic(shape, width_ratios=[1.55, 1], height_ratios=[2.4, 1])
        _draw_plan(axes["plan"], outline, shown[: number + 1])
        axes["plan"].set_title(f"command {number + 1}: {scene.command}", fontsize=12)
        axes["mirror"].imshow(scene.image[..., ::-1])
        axes["mirror"].set_title("camera, straight ahead is up", fontsize=12)
        axes["panorama"].imshow(eyes.unwrap(scene.image)[..., ::-1], aspect="auto")
        axes["panorama"].set_title("unwrapped: left, ahead, right", fontsize=12)
        for name in ("mirror", "panorama"):
            axes[name].axis("off")
        canvas: Any = FigureCanvasAgg(figure)
        canvas.draw()
        yield Pictures.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _draw_plan(axes: Any, outline: Outline, driven: list[Scene]) -> None:
    axes.set_facecolor(outline.floor)
    for solid in outline.solids:
        axes.add_patch(Polygon(solid.corners, facecolor=solid.colour, edgecolor="none"))
    now = driven[-1]
    likely = np.argsort(now.foreseen.chances)
    x, y = _in_the_arena(now.pose, now.foreseen.places[likely])
    chances = now.foreseen.chances[likely]
    seen = chances > 0.05
    axes.scatter(x[seen], y[seen], c=chances[seen], s=3, cmap=SCALE, vmin=0.0, vmax=1.0)
    axes.plot(*_in_the_arena(now.pose, now.foreseen.way[:_FAR]), color=VERMILION, linewidth=2.5)
    axes.plot([s.pose.x for s in driven], [s.pose.y for s in driven], ".-", color="white")
    place = (now.pose.x, now.pose.y)
    axes.add_patch(Circle(place, outline.robot_radius, facecolor="white", edgecolor="black"))
    nose = _in_the_arena(now.pose, np.array([[0.0, 0.0], [outline.robot_radius / HEIGHT, 0.0]]))
    axes.plot(*nose, color="black", linewidth=2.0)
    corners = np.concatenate([np.array(solid.corners) for solid in outline.solids])
    axes.set_xlim(corners[:, 0].min(), corners[:, 0].max())
    axes.set_ylim(corners[:, 1].min(), corners[:, 1].max())
    axes.set_aspect("equal")
    axes.set(xticks=[], yticks=[])


def _in_the_arena(pose: Pose, places: Array) -> tuple[Array, Array]:
    """Return x and y in metres of places that a robot at a pose sees."""
    ahead, left = places[:, 0] * HEIGHT, places[:, 1] * HEIGHT
    c, s = np.cos(pose.heading), np.sin(pose.heading)
    return pose.x + c * ahead - s * left, pose.y + s * ahead + c * left


def main() -> None:
    """Drive, draw, and write the moving picture."""
    map_file, target = Path(sys.argv[1]), Path(sys.argv[2])
    brain, _ = load_map(map_file)
    memory = brain.memories.get("foresight")
    if not isinstance(memory, ForesightMemory) or memory.skill is None:
        raise MacorError(f"{map_file} has learned no foresight")
    if not isinstance(brain.eyes, PanoramaEyes):
        raise MacorError(f"the eyes of {map_file} see no panorama")
    outline, shown = scenes(brain, memory.skill)
    frames = list(pictures(outline, shown, brain.eyes))
    # one palette for all, or colours flicker; without dithering, or noise makes the file large
    palette = frames[len(frames) // 2].quantize(_COLOURS, Pictures.Quantize.MAXCOVERAGE)
    first, *others = [each.quantize(palette=palette, dither=0) for each in frames]
    first.save(target, save_all=True, append_images=others, duration=_MILLISECONDS, loop=0)
    sys.stdout.write(f"{target}: {len(frames)} pictures, {target.stat().st_size / 1000:.0f} kB\n")


if __name__ == "__main__":
    main()
