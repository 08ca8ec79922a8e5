r"""Reset and ground truth of a daemon's robots over its standard input and output.

For the program that has started the daemon (`khepera-emulator run --control`), a test for
example. It writes a request as a line of JSON and reads a line in answer:

    {"reset": {"pose": {"x": 0.3, "y": 0.0, "heading": 0.0}}}
    {"truth": {"time": 1.2, "pose": {"x": 0.3, "y": 0.0, "heading": 0.0}, ...}}

`{}` asks for the truth alone. A daemon whose standard input ends, ends: so no robot outlives
the program that wanted it, whatever becomes of that.
"""

import os
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from khepera_protocol.text import printable
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.payloads import Reset, Truth
from pydantic import Field

from khepera_emulator.errors import EmulatorError

_INPUT: Final = 0
_LONGEST: Final = 10_000
"""Bytes of a request."""


class Request(Payload):
    """A reset of a robot, or the question where it is."""

    robot: int = Field(default=1, ge=1, description="number of the robot in its world")
    reset: Reset | None = Field(default=None, description="a reset; absent: the truth alone")


class Answer(Payload):
    """The truth, after the reset if one was asked for; or the reason of a refusal."""

    truth: Truth | None = None
    error: str = Field(default="", description="a sentence; empty: there is none")


class Controlled(Protocol):
    """A robot as requests see it."""

    def truth(self) -> Truth:
        """Return where it is."""

    def reset(self, reset: Reset) -> Truth:
        """Put it somewhere.

        Raises:
            EmulatorError: the place is not free.
        """


class Control:
    """Answers the requests on the standard input.

    Args:
        robots: of a daemon.
        tell: is given each answer, a line without its end.
    """

    def __init__(self, robots: Sequence[Controlled], tell: Callable[[str], None]) -> None:
        self._robots = robots
        self._tell = tell
        self._rest = b""

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when a request has come."""
        return _INPUT

    def serve(self) -> bool:
        """Answer the requests that have come, as of now; False if no more will come."""
        data = os.read(_INPUT, _LONGEST)
        *lines, rest = (self._rest + data).split(b"\n")
        self._rest = rest[: _LONGEST + 1]  # one that is too long is refused at its end
        for line in lines:
            self._tell(self._answer(line).model_dump_json(exclude_none=True))
        return bool(data)

    def _answer(self, line: bytes) -> Answer:
        try:
            request = Request.parse(line, _LONGEST)
            robot = self._robot(request.robot)
            return Answer(truth=robot.reset(request.reset) if request.reset else robot.truth())
        except (EmulatorError, PayloadError) as error:
            return Answer(error=printable(str(error), 1000))

    def _robot(self, number: int) -> Controlled:
        if number > len(self._robots):
            raise EmulatorError(f"there is no robot {number}: there are {len(self._robots)}")
        return self._robots[number - 1]
