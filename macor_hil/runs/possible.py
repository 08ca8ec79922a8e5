"""Trials against what is possible: the longest drive that a search over the floor plan finds.

For scoring an emulated robot only: the search is the emulator's own
(`khepera_emulator.routes.oracle`), asked with the arena's outline, so that it makes no difference
whether the robot is in this process.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from khepera_protocol.serial.units import PULSE
from khepera_protocol.zenoh.payloads import Pose

from macor_hil.commands import COMMANDS
from macor_hil.errors import BenchError
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.driver import DriveSettings
from macor_hil.hardware.robots.forms import form_of
from macor_hil.runs.trials import MAX_COMMANDS, Trial


@dataclass(frozen=True, slots=True)
class Possible:
    """The best that there is from a start.

    Attributes:
        length: commands of the longest drive without a collision.
        asked: greatest number of commands of a trial.
        exact: whether it is certain that there is no longer one.
    """

    length: int
    asked: int
    exact: bool

    @property
    def everything(self) -> bool:
        """True if all commands of a trial can be driven: no collision is necessary."""
        return self.length >= self.asked


Judge = Callable[[Pose], Possible]
"""Tells what is possible from a start."""


def judge(bench: Bench, commands: int = MAX_COMMANDS) -> Judge:
    """Make a judge of what is possible for an emulated robot, with things where they are now.

    Args:
        bench: of the robot, which is driven with the usual settings.
        commands: greatest number of commands of a trial.

    Raises:
        BenchError: the emulator does not answer, or its robot is unknown here.
    """
    oracle = _oracle(bench)

    def tell(start: Pose) -> Possible:
        longest = oracle.longest_drive(start, commands)
        return Possible(longest.length, commands, longest.exact)

    return tell


class Ways:
    """Shortest ways of an emulated robot to a region: near some points, and in their sight.

    Args:
        bench: of the robot, which is driven with the usual settings.
        points: places in metres.
        reach: metres.

    Raises:
        BenchError: the emulator does not answer, or its robot is unknown here.
    """

    def __init__(self, bench: Bench, points: Sequence[tuple[float, float]], reach: float) -> None:
        from khepera_emulator.routes.regions import Region

        self._oracle = _oracle(bench)
        self._region = Region(points, bench.outline(), reach)

    def shortest(self, start: Pose, commands: int) -> int | None:
        """Return how many commands the shortest way has; None: no way has so few or less."""
        way: tuple[int, ...] | None
        way = self._oracle.shortest_way(start, self._region.holds, commands)
        return None if way is None else len(way)

    def inside(self, path: Sequence[Pose]) -> list[bool]:
        """Tell which poses of a path are in the region."""
        from khepera_emulator.routes.feelers import Poses

        x, y, heading = np.array([(p.x, p.y, p.heading) for p in path]).reshape(-1, 3).T
        held: list[bool] = self._region.holds(Poses(x, y, heading)).tolist()
        return held


def _oracle(bench: Bench) -> Any:
    """Return the emulator's search for what is possible."""
    from khepera_emulator.errors import EmulatorError
    from khepera_emulator.routes.oracle import Oracle

    settings = DriveSettings()
    counts = [settings.wheels.counts(each.way, each.turn) for each in COMMANDS]
    ways = [(round(left) * PULSE, round(right) * PULSE) for left, right in counts]
    outline = bench.outline()
    collision = form_of(outline.robot_kind).on_the_line(settings.collision)
    try:
        return Oracle(outline, ways, bench.truth().drift, collision)
    except EmulatorError as error:
        raise BenchError(f"cannot tell what is possible: {error}") from None


@dataclass(frozen=True, slots=True)
class Shares:
    """Trials of a system against what was possible.

    Attributes:
        share: of the commands that were possible, mean over the trials in which any was; None:
            none ever was.
        hopeless: trials in which no command was possible; they count in nothing else.
        free: trials in which no collision was necessary.
        needless: of those, the ones that collided.
    """

    share: float | None
    hopeless: int
    free: int
    needless: int


def compare(trials: Sequence[Trial], possible: Sequence[Possible]) -> Shares:
    """Compare trials with what was possible from their starts."""
    pairs = list(zip(trials, possible, strict=True))
    shares = [share for trial, most in pairs if (share := share_of(trial, most)) is not None]
    free = [trial for trial, most in pairs if most.everything]
    return Shares(
        share=sum(shares) / len(shares) if shares else None,
        hopeless=len(pairs) - len(shares),
        free=len(free),
        needless=sum(trial.collided for trial in free),
    )


def said_of_starts(possible: Sequence[Possible]) -> str:
    """Return a sentence on the starts from which not all commands are possible."""
    hopeless = sum(each.length == 0 for each in possible)
    short = sum(not each.everything for each in possible) - hopeless
    if hopeless + short == 0:
        return "From every start all commands are possible."
    return (
        f"From {hopeless} of {len(possible)} starts nothing is possible: they count in no share."
        f" From {short} a collision is inevitable later on."
    )


def share_of(trial: Trial, possible: Possible) -> float | None:
    """Return the share of the possible commands that a trial drove; None: none was possible.

    The command that collides is not driven. A trial that got further than was thought possible
    shows that more was.
    """
    driven = trial.length - trial.collided
    most = max(possible.length, driven)
    return driven / most if most else None
