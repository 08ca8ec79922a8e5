"""Configuration of Zenoh sessions: peers on named endpoints, on this machine only.

A peer listens on the endpoints that it is given and nowhere else, looks for nobody by multicast,
and learns from the peers that it connects to of all others (gossip): whoever connects to the
emulator also finds the controller. Nothing is opened here; see `khepera_protocol.zenoh.session`.
"""

import json
from collections.abc import Sequence
from typing import Final

DEFAULT_ENDPOINT: Final = "tcp/127.0.0.1:7447"
"""The emulator's Zenoh endpoint: on this machine only."""

CONTROLLER_ENDPOINT: Final = "tcp/127.0.0.1:7448"
"""The controller's Zenoh endpoint: on this machine only."""

MOST_MESSAGE: Final = 16_000_000
"""Bytes of the longest message that is received; Zenoh drops longer ones as they come."""


def zenoh_config(listen: Sequence[str], connect: Sequence[str]) -> str:
    """Return the configuration of a session, as JSON text.

    Opening fails if an endpoint of `listen` cannot be had. An endpoint of `connect` may appear
    later, and go and come again: it is tried in the background, for ever. Opening waits half a
    second for it at most, so that the first query finds a peer that is there.

    Args:
        listen: endpoints such as `tcp/127.0.0.1:7447`; none: do not listen.
        connect: endpoints of peers to connect to.
    """
    return json.dumps(
        {
            "mode": "peer",
            "listen": {"endpoints": list(listen), "timeout_ms": 0, "exit_on_failure": True},
            "connect": {
                "endpoints": list(connect),
                "timeout_ms": -1,  # 0 would be a single attempt
                "exit_on_failure": False,
                "retry": {
                    "period_init_ms": 100,
                    "period_max_ms": 1000,
                    "period_increase_factor": 2,
                },
            },
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": True}},
            "timestamping": {"enabled": True},
            "transport": {
                # who receives would keep the memory and descriptors of every sender for ever
                "shared_memory": {"enabled": False},
                "link": {"rx": {"max_message_size": MOST_MESSAGE}},
            },
        }
    )
