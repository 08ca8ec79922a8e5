"""Watchers of a controller, as a process: `python subscribers.py ENDPOINT NUMBER [stuck]`.

Each is a Zenoh session of its own that takes all that the controller tells. A stuck process takes
one sample and then nothing any more, with its link up.
"""

import os
import signal
import sys
from contextlib import ExitStack

import zenoh

from macor_hil.telemetry.session import open_session


def main() -> None:
    """Watch until the standard input ends."""
    endpoint, number, stuck = sys.argv[1], int(sys.argv[2]), "stuck" in sys.argv[3:]

    def take(sample: zenoh.Sample) -> None:
        sample.payload.to_bytes()
        if stuck:
            os.kill(os.getpid(), signal.SIGSTOP)

    with ExitStack() as stack:
        for _ in range(number):
            session = stack.enter_context(open_session([], [endpoint]))
            session.declare_subscriber("macor/**", take)
        print("there", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main()
