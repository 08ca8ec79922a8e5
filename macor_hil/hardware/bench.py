"""The emulator's bench: put the robot somewhere, and learn where it really is.

For set-up and scoring only. A physical robot has no bench, and nothing that drives needs one.
"""

from typing import Any, Protocol, TypeVar

import zenoh
from khepera_protocol.zenoh.ask import AskError, ask
from khepera_protocol.zenoh.keys import ARENA, RESET, TRUTH, Key
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Outline, Reset, Truth

from macor_hil.errors import BenchError

_P = TypeVar("_P", bound=Payload)


class Bench(Protocol):
    """Set-up and ground truth of an emulated robot."""

    def reset(self, reset: Reset) -> Truth:
        """Put the robot somewhere, powered on afresh.

        Raises:
            BenchError: the emulator refuses or does not answer.
        """
        ...

    def truth(self) -> Truth:
        """Return where the robot really is.

        Raises:
            BenchError: the emulator does not answer.
        """
        ...

    def outline(self) -> Outline:
        """Return the arena from above, to draw.

        Raises:
            BenchError: the emulator does not answer.
        """
        ...


class PortBench:
    """Bench of the robot behind a `khepera://` port."""

    def __init__(self, port: Any) -> None:
        self._emulator = port.emulator

    def reset(self, reset: Reset) -> Truth:
        """Put the robot somewhere."""
        from khepera_emulator.errors import EmulatorError

        try:
            truth: Truth = self._emulator.reset(reset)
        except EmulatorError as error:
            raise BenchError(str(error)) from None
        return truth

    def truth(self) -> Truth:
        """Return where the robot really is."""
        truth: Truth = self._emulator.truth()
        return truth

    def outline(self) -> Outline:
        """Return the arena from above."""
        outline: Outline = self._emulator.outline()
        return outline


class ZenohBench:
    """Bench of an emulator daemon, over its side channel."""

    def __init__(self, session: zenoh.Session, robot: str) -> None:
        self._session = session
        self._robot = robot

    def reset(self, reset: Reset) -> Truth:
        """Put the robot somewhere."""
        return self._ask(RESET, Truth, reset)

    def truth(self) -> Truth:
        """Return where the robot really is."""
        return self._ask(TRUTH, Truth)

    def outline(self) -> Outline:
        """Return the arena from above."""
        return self._ask(ARENA, Outline)

    def _ask(self, key: Key, answer: type[_P], request: Payload | None = None) -> _P:
        try:
            return ask(self._session, self._robot, key, answer, request)
        except AskError as error:
            raise BenchError(str(error)) from None
