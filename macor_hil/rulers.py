"""Who puts a robot on its mark, and measures where it ended."""

from collections.abc import Callable
from math import radians
from typing import Any, Protocol

from macor_hil.bench import Bench
from macor_hil.calibration import Move, seen_from
from protocol.side_channel import Pose, Reset

End = tuple[float, float, float | None]


class Ruler(Protocol):
    """Marks and measures."""

    def place(self, move: Move, number: int) -> None:
        """See to it that the robot stands on its mark, before a run of a number."""
        ...

    def measure(self, move: Move) -> End:
        """Where the robot ended: metres ahead and to the left, radians if they are known."""
        ...


class BenchRuler:
    """An emulator puts its robot on the start, and knows where it ended."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._start = Pose(x=0.0, y=0.0, heading=0.0)
        self._placed = 0

    def place(self, move: Move, number: int) -> None:
        """Every run slips in its own way."""
        del move, number
        self._placed += 1
        self._start = self._bench.reset(Reset(seed=self._placed)).pose

    def measure(self, move: Move) -> End:
        """The true pose."""
        del move
        return seen_from(self._start, self._bench.truth().pose)


class Hands:
    """An operator with a ruler.

    Args:
        say: shows a line.
        ask: asks a question and gives the answer; a second argument is the answer of Enter alone.
    """

    def __init__(self, say: Callable[[str], object], ask: Callable[..., Any]) -> None:
        self._say = say
        self._ask = ask

    def place(self, move: Move, number: int) -> None:
        """Wait until the robot stands on its mark."""
        self._say(f"Next: {move.name}, run {number + 1}. Put the robot on its mark, looking ahead.")
        self._ask("Press Enter when it stands there", "", show_default=False)

    def measure(self, move: Move) -> End:
        """Ask until the answer is two or three numbers."""
        while True:
            answer = str(
                self._ask(
                    f"Where did it end ({move.name})? Millimetres ahead and to the left of the"
                    " mark, degrees turned to the left beyond whole moves if measured: X Y [TURN]"
                )
            )
            try:
                numbers = [float(word) for word in answer.replace(",", " ").split()]
            except ValueError:
                numbers = []
            if len(numbers) in (2, 3):
                turn = radians(numbers[2]) if len(numbers) == 3 else None
                return numbers[0] / 1000, numbers[1] / 1000, turn
            self._say("Two or three numbers are needed, such as: 12 -30 4.5")
