"""Health of a container: is there a liveliness token under a key, at a Zenoh endpoint?

python health.py tcp/127.0.0.1:7447 'khepera/*/alive'
"""

import sys

from khepera_protocol.zenoh.session import open_session

PATIENCE = 3.0
"""Seconds that the answer may take."""


def main() -> int:
    """Return the exit status: 0 if the token is there, 1 if not."""
    endpoint, key = sys.argv[1:]
    with open_session([], [endpoint]) as session:
        replies = session.liveliness().get(key, timeout=PATIENCE)
        return 0 if any(reply.ok for reply in replies) else 1


if __name__ == "__main__":
    sys.exit(main())
