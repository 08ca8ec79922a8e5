"""Reasons of those who refuse a Zenoh query."""

from typing import Final

import zenoh

from khepera_protocol.text import printable

_MOST: Final = 300
"""Bytes of a reason."""


def refusal(reply: zenoh.Reply) -> str:
    """Return the reason that a peer gives for not answering, fit for a terminal."""
    if reply.err is None:
        return "no reason given"
    return printable(reply.err.payload.to_bytes()[:_MOST].decode(errors="backslashreplace"))
