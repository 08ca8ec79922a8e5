"""A key of a controller that has effects, and a question to it: one request, an answer in words.

Only what names the key itself and holds its payload counts: a query or a sample for all keys
(`macor/**`, `**`) is a look, and changes nothing.
"""

from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Final, Self

import zenoh
from khepera_protocol.text import printable
from khepera_protocol.zenoh.keys import Key
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.reply import refusal

from macor_hil.errors import MacorError, TelemetryError
from macor_hil.telemetry.session import check_robot_name

_PATIENCE: Final = 2.0
_LONGEST: Final = 300
"""Characters of an answer at most."""


class ActingKey:
    """A key of one robot's controller that does what it is asked for; use as a context.

    Args:
        session: an open session, which stays its owner's.
        key: of the table.
        robot: the robot's name in the keys.
        act: called, in a thread of the library, with the payload of a query; it returns what is
            done, in words, or raises MacorError: nothing is.
        hears: samples on the key count as well; nobody is told what becomes of them.

    Raises:
        TelemetryError: the name cannot be part of a key.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: Key,
        robot: str,
        act: Callable[[bytes], str],
        *,
        hears: bool = False,
    ) -> None:
        check_robot_name(robot)
        self._key = key.of(robot)
        self._act = act
        with ExitStack() as stack:
            stack.enter_context(session.declare_queryable(self._key, self._answer))
            if hears:
                stack.enter_context(session.declare_subscriber(self._key, self._hear))
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if str(query.key_expr) != self._key:
                return  # somebody looks at what there is, and means no harm
            payload = query.payload
            try:
                said = self._act(payload.to_bytes() if payload else b"")
            except MacorError as error:
                reason = printable(str(error), _LONGEST)
                query.reply_err(reason, encoding=zenoh.Encoding.TEXT_PLAIN)
            else:
                query.reply(self._key, said, encoding=zenoh.Encoding.TEXT_PLAIN)

    def _hear(self, sample: zenoh.Sample) -> None:
        if str(sample.key_expr) == self._key:
            with suppress(MacorError):
                self._act(sample.payload.to_bytes())


def ask_to_act(
    session: zenoh.Session, robot: str, key: Key, request: Payload, *, to: str = ""
) -> str:
    """Ask the controller of a robot for something; return what it does, in words.

    Args:
        session: an open session.
        robot: the robot's name in the keys.
        key: that has effects.
        request: payload of the query.
        to: what the controller refuses, in an error's words, such as ` to stop`.

    Raises:
        TelemetryError: no controller takes the request.
    """
    check_robot_name(robot)
    name = key.of(robot)
    replies = list(session.get(name, payload=request.model_dump_json(), timeout=_PATIENCE))
    for reply in replies:
        if reply.ok:
            said = reply.ok.payload.to_bytes()[:_LONGEST]
            return printable(said.decode(errors="backslashreplace"))
    if replies:
        raise TelemetryError(f"the controller of {robot} refuses{to}: {refusal(replies[0])}")
    raise TelemetryError(
        f"nobody answers on the Zenoh key {name}: no controller drives {robot}, or it was not"
        f" started with --{key.leaf}-key, or does not let you"
    )
