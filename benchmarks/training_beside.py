"""Training commands of this code beside those of another checkout, old and new in turn.

    git worktree add /tmp/before COMMIT
    python benchmarks/training_beside.py /tmp/before

Each turn is a process of its own that trains 1,000 random commands in the corridor, in virtual
time; what is told are milliseconds of its processor time a command, session by session, and
a digest of what was seen and learned.
"""

import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from typing import Final

from rich.console import Console

_ROUNDS: Final = 3

_HERE: Final = Path(__file__).parents[1]

_TRAIN: Final = """
from hashlib import sha256
from time import process_time

from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.catalogue import build_brain
from macor_hil.runs.training import Trainer

drive, total = Drive(tuning=100, random=1_000), sha256()
with open_hardware(drive.port(1)) as hardware:
    schedule, brain = drive.schedule(1), build_brain(drive.brain)
    robot = Driver(hardware.robot)
    seen = lambda each: total.update(each.raw.tobytes())
    trainer = Trainer(brain, robot, hardware.camera, hardware.bench, schedule, witness=seen)
    for session in schedule.sessions():
        start = process_time()
        trainer.run(session, lambda _: None)
        print(1e3 * (process_time() - start) / session.length)
print(total.hexdigest()[:12])
"""


def trained(tree: Path) -> tuple[list[float], str]:
    """Train with the code of a checkout: milliseconds a command of each session, and a digest."""
    paths = os.pathsep.join(map(str, (tree, tree / "protocol")))
    done = subprocess.run(
        [sys.executable, "-c", _TRAIN],
        env={**os.environ, "PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        cwd="/",
    )
    *times, digest = done.stdout.split()[-6:]
    return [float(each) for each in times], digest


def main() -> None:
    """Measure, and print a line for each turn, and the ratio of the last sessions' medians."""
    last: dict[str, list[float]] = {"before": [], "now": []}
    digests, told = set(), Console(highlight=False)
    for _ in range(_ROUNDS):
        for name, tree in (("before", Path(sys.argv[1])), ("now", _HERE)):
            times, digest = trained(tree)
            digests.add(digest)
            last[name] += times[-3:]
            shown = " ".join(f"{each:.2f}" for each in times)
            told.print(f"{name:6} {shown} ms a command, {digest}")
    before, now = median(last["before"]), median(last["now"])
    same = "the same" if len(digests) == 1 else "NOT the same"
    told.print(f"{before:.2f} ms and {now:.2f} ms: {before / now:.2f} times; {same} was seen")


if __name__ == "__main__":
    main()
