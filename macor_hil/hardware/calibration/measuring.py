"""Ways of putting a robot on its mark, and of measuring where it ended."""

from collections.abc import Callable
from math import cos, radians, sin
from typing import Protocol

from khepera_protocol.zenoh.payloads import Pose, Reset

from macor_hil.errors import BenchError, CalibrationError
from macor_hil.hardware.bench import Bench
from macor_hil.hardware.calibration.course import End, Move, seen_from


class Ruler(Protocol):
    """Marks and measures."""

    def place(self, move: Move, number: int) -> None:
        """See to it that the robot stands on its mark, before a run of a number."""
        ...

    def measure(self, move: Move) -> End:
        """Measure where the robot ended: metres ahead and to the left, radians if known."""
        ...


class BenchRuler:
    """An emulator puts its robot where the arena has room, and knows where it ended.

    Args:
        bench: the emulator's.
        placed: how many runs have been driven before.
    """

    def __init__(self, bench: Bench, placed: int = 0) -> None:
        self._bench = bench
        self._start = Pose(x=0.0, y=0.0, heading=0.0)
        self._placed = placed

    def place(self, move: Move, number: int) -> None:
        """Put the move's middle on the arena's start; every run slips in its own way.

        Raises:
            BenchError: there is no room for it.
        """
        del number
        self._placed += 1
        start = self._bench.reset(Reset()).pose
        try:
            mark = _beside(start, move)
            self._start = self._bench.reset(Reset(pose=mark, seed=self._placed)).pose
        except BenchError as error:
            raise BenchError(
                f"{error}; the course needs more room than this arena has around its start: another"
                " arena, or a smaller --side"
            ) from None

    def measure(self, move: Move) -> End:
        """Return the true pose."""
        del move
        return seen_from(self._start, self._bench.truth().pose)


class Hands:
    """An operator with a ruler.

    Args:
        say: shows a line.
        ask: asks a question and gives the answer.
    """

    def __init__(self, say: Callable[[str], object], ask: Callable[[str], str]) -> None:
        self._say = say
        self._ask = ask

    def place(self, move: Move, number: int) -> None:
        """Wait until the robot stands on its mark."""
        self._say(f"Next: {move.name}, run {number + 1}. Put the robot on its mark, looking ahead.")
        self._ask("Press Enter when it stands there")

    def measure(self, move: Move) -> End:
        """Ask until the answer is a place that the move can have led to."""
        while True:
            answer = self._ask(
                f"Where did it end ({move.name})? Millimetres ahead and to the left of the"
                " mark, degrees turned to the left beyond whole moves if measured: X Y [TURN]"
            )
            try:
                end = _end(answer)
                move.check_end(end)
            except CalibrationError as error:
                self._say(f"{error}.")
            else:
                return end


def _end(answer: str) -> End:
    """Read where a robot ended.

    Raises:
        CalibrationError: it is not two or three numbers.
    """
    try:
        numbers = [float(word) for word in answer.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise CalibrationError("two or three numbers are needed, such as: 12 -30 4.5")
    turn = radians(numbers[2]) if len(numbers) == 3 else None
    return numbers[0] / 1000, numbers[1] / 1000, turn


def _beside(middle: Pose, move: Move) -> Pose:
    """Return the mark from which a move goes around a place."""
    xs, ys = ([getattr(place, axis) for place in move.places] for axis in "xy")
    x, y = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    c, s = cos(middle.heading), sin(middle.heading)
    return Pose(x=middle.x - (c * x - s * y), y=middle.y - (s * x + c * y), heading=middle.heading)
