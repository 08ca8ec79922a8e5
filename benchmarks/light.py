"""Changes of brightness and white balance that leave the situation alone: docs/light.md.

A map is trained in one light; pictures from places of their own are then changed as a camera
would, and the share of them that is still taken for the same situation is counted.
"""

from collections.abc import Callable, Mapping

import numpy as np
from khepera_protocol.palette import MARKERS, drawing_style
from khepera_protocol.zenoh.payloads import Reset
from matplotlib.figure import Figure
from page import DOCS, PICTURES, table, write_part

from macor_hil.arrays import Image
from macor_hil.commands import FIRST_COMMAND
from macor_hil.hardware.cameras.light import Light, brightness, fog
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.brain import Brain
from macor_hil.mind.catalogue import build_brain
from macor_hil.runs.training import Schedule, Trainer

_PICTURES = 100
_SHARES = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.2, 1.3)
_PAGE = DOCS / "light.md"

_CHANGES: dict[str, Callable[[float], Light]] = {
    "brightness (all channels)": brightness,
    "white balance: blue": lambda share: Light(blue=share),
    "white balance: red": lambda share: Light(red=share),
    "fog: black level raised": fog,
}


def main() -> None:
    """Train, change, count; write the table and the picture."""
    brain, images = _trained()
    before = [_situation(brain, image) for image in images]
    kept = {
        name: [_share(brain, images, before, light(share)) for share in _SHARES]
        for name, light in _CHANGES.items()
    }
    head = ("change", *(f"{share:g}" for share in _SHARES))
    rows = [(name, *(f"{100 * value:.0f} %" for value in row)) for name, row in kept.items()]
    write_part(_PAGE, "light", table(head, rows))
    with drawing_style():
        _draw(kept)


def _draw(kept: Mapping[str, list[float]]) -> None:
    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for (name, row), marker in zip(kept.items(), MARKERS, strict=False):
        axes.plot(_SHARES, [100 * value for value in row], marker=marker, label=name)
    axes.set(xlabel="share of the light in training", ylabel="same situation, %", ylim=(0, 105))
    axes.grid()
    figure.legend(loc="outside lower center", ncols=2)
    figure.savefig(PICTURES / "light.png")


def _trained() -> tuple[Brain, list[Image]]:
    schedule = Schedule(tuning=150, random=450, reactive=0, session=150, seed=3)
    with open_hardware("khepera://corridor?seed=3") as hardware:
        brain = build_brain()
        trainer = Trainer(brain, Driver(hardware.robot), hardware.camera, hardware.bench, schedule)
        for session in schedule.sessions():
            trainer.run(session, lambda _: None)
        assert hardware.bench is not None
        images = []
        for seed in range(_PICTURES):
            hardware.bench.reset(Reset(random=True, seed=5000 + seed))
            images.append(hardware.camera.grab().image)
    return brain, images


def _situation(brain: Brain, image: Image) -> int:
    return brain.perceive(brain.look(image), FIRST_COMMAND, learn=False).node


def _share(brain: Brain, images: list[Image], before: list[int], light: Light) -> float:
    # a sensor's noise makes pictures of the same light differ, too
    rng = np.random.default_rng(1)
    same = 0
    for image, node in zip(images, before, strict=True):
        changed = light.on(image.astype(np.float64)) + rng.normal(0.0, 2.0, image.shape)
        same += _situation(brain, np.clip(changed, 0, 255).astype(np.uint8)) == node
    return same / len(images)


if __name__ == "__main__":
    main()
