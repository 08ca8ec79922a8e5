"""Questions to the keys of a robot: one query, one answer, parsed."""

from typing import Final, TypeVar

import zenoh

from khepera_protocol.zenoh.keys import Key
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.reply import refusal

PATIENCE: Final = 5.0
"""Seconds that an answer may take; a reset with things in the arena takes parts of one."""

_P = TypeVar("_P", bound=Payload)


class AskError(Exception):
    """A question got no answer that can be used; the message says why, fit for a terminal."""


def ask(
    session: zenoh.Session,
    robot: str,
    key: Key,
    answer: type[_P],
    request: Payload | None = None,
) -> _P:
    """Return the answer of an emulator on one of its keys.

    Args:
        session: an open session.
        robot: the robot's name in the keys.
        key: of the table.
        answer: model of the answer.
        request: payload of the query; fields that are None are left out.

    Raises:
        AskError: the emulator refuses, does not answer, or answers something else.
    """
    name = key.of(robot)
    payload = None if request is None else request.model_dump_json(exclude_none=True)
    for reply in session.get(name, payload=payload, timeout=PATIENCE):
        if reply.ok is None:
            raise AskError(f"the emulator answers on {name}: {refusal(reply)}")
        try:
            return answer.parse(reply.ok.payload.to_bytes())
        except PayloadError as error:
            raise AskError(f"what came from {name} is no {answer.__name__}: {error}") from None
    raise AskError(f"no emulator answers on the Zenoh key {name}; is it running?")
