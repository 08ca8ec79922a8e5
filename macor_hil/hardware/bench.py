"""The emulator's bench: put the robot somewhere, and learn where it really is.

For set-up and scoring only. A physical robot has no bench, and nothing that drives needs one.
"""

from typing import Any, Protocol, TypeVar

import zenoh
from khepera_protocol.zenoh.keys import ARENA, RESET, TRUTH, Key
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.payloads import (
    Outline,
    Reset,
    Truth,
)
from khepera_protocol.zenoh.reply import refusal

from macor_hil.errors import BenchError

_P = TypeVar("_P", bound=Payload)

PATIENCE = 5.0
"""Seconds that a reset may take."""


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
        return self._ask(RESET, Truth, reset.model_dump_json(exclude_none=True))

    def truth(self) -> Truth:
        """Return where the robot really is."""
        return self._ask(TRUTH, Truth)

    def outline(self) -> Outline:
        """Return the arena from above."""
        return self._ask(ARENA, Outline)

    def _ask(self, asked: Key, kind: type[_P], payload: str | None = None) -> _P:
        key = asked.of(self._robot)
        for reply in self._session.get(key, payload=payload, timeout=PATIENCE):
            if reply.ok is None:
                raise BenchError(f"the emulator answers on {key}: {refusal(reply)}")
            try:
                return kind.parse(reply.ok.payload.to_bytes())
            except PayloadError as error:
                raise BenchError(f"what came from {key} is no {kind.__name__}: {error}") from None
        raise BenchError(f"no emulator answers on the Zenoh key {key}; is it running?")
