"""`macor-hil monitor`: a controller in the terminal.

Zenoh calls back in threads of its own; they only put what came on a queue. Everything else
happens in the thread that called `watch`.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from math import inf
from queue import Empty, SimpleQueue
from typing import Final, Self

import zenoh
from pydantic import ValidationError
from rich.console import Console
from rich.live import Live

from macor_hil.monitor.view import render
from macor_hil.monitor.watched import Watched
from macor_hil.telemetry.keys import ALIVE, DECISION, FRAME, STATE
from macor_hil.telemetry.schemas import Decision, State
from macor_hil.telemetry.session import check_robot_name, open_session
from protocol.side_channel import controller_key

_REFRESH: Final = 0.2
"""Seconds between two pictures."""

_ONCE_PATIENCE: Final = 2.0
"""Seconds that a single picture waits for a controller."""

_QUERY_PATIENCE: Final = 2.0
"""Seconds that the answer to a query for the latest sample may take."""

_LATEST: Final = (STATE, DECISION)


def watch(
    robot: str,
    listen: Sequence[str],
    connect: Sequence[str],
    once: bool = False,
    duration: float | None = None,
    *,
    console: Console | None = None,
) -> bool:
    """Show a controller until Ctrl-C; it may come, go and come again.

    Args:
        robot: the robot's name in Zenoh keys.
        listen: Zenoh endpoints to be found at; usually none.
        connect: Zenoh endpoints of the controller, or of a peer that knows it.
        once: show a single picture, of a controller that is there or after two seconds.
        duration: seconds after which to end; None: never.
        console: where to draw; the standard output if not given.

    Returns:
        Whether a controller was there at the end.

    Raises:
        TelemetryError: the name or an endpoint cannot be used.
    """
    check_robot_name(robot)
    console = console or Console()
    with open_session(listen, connect) as session, Watcher(session, robot) as watcher:
        if once:
            watcher.follow(_ONCE_PATIENCE, until=lambda: watcher.introduced)
            console.print(render(watcher.watched, time.monotonic()))
        else:
            _show(watcher, console, inf if duration is None else duration)
        return watcher.watched.alive


def _show(watcher: "Watcher", console: Console, duration: float) -> None:
    end = time.monotonic() + duration
    with Live(console=console, auto_refresh=False, transient=False) as live:
        try:
            while (now := time.monotonic()) < end:
                live.update(render(watcher.watched, now), refresh=True)
                watcher.follow(min(_REFRESH, end - now))
        except KeyboardInterrupt:
            pass  # the way to end it


class Watcher:
    """Follows one robot's controller; use as a context.

    Attributes:
        watched: what is known of the controller that is there, or was last.
    """

    def __init__(self, session: zenoh.Session, robot: str) -> None:
        self.watched = Watched(robot)
        self._robot = robot
        self._session = session
        self._events: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._newest: dict[str, zenoh.Timestamp] = {}
        self._answers = 0
        with ExitStack() as stack:
            for leaf in (FRAME, DECISION, STATE):
                subscriber = session.declare_subscriber(self._key(leaf), self._enqueue(self._take))
                stack.enter_context(subscriber)
            liveliness = session.liveliness().declare_subscriber(
                self._key(ALIVE), self._enqueue(self._meet), history=True
            )
            stack.enter_context(liveliness)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def introduced(self) -> bool:
        """Whether a controller is there and has told its latest state and decision."""
        return self.watched.alive and self._answers >= len(_LATEST)

    def follow(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Take in what comes for a time, or until something is so."""
        end = time.monotonic() + seconds
        while not until() and (left := end - time.monotonic()) > 0.0:
            try:
                self._events.get(timeout=left)()
            except Empty:
                return

    def _key(self, leaf: str) -> str:
        return controller_key(self._robot, leaf)

    def _enqueue(self, take: Callable[[zenoh.Sample], None]) -> Callable[[zenoh.Sample], None]:
        return lambda sample: self._events.put(lambda: take(sample))

    def _meet(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self.watched.alive = False
            return
        self.watched = Watched(self._robot, alive=True, met=True)
        self._newest.clear()
        self._answers = 0
        for leaf in _LATEST:
            self._session.get(
                self._key(leaf),
                lambda reply: self._events.put(lambda: self._answer(reply)),
                timeout=_QUERY_PATIENCE,
            )

    def _answer(self, reply: zenoh.Reply) -> None:
        self._answers += 1
        if reply.ok is not None:  # an error says that there is nothing to tell yet
            self._take(reply.ok, live=False)

    def _take(self, sample: zenoh.Sample, *, live: bool = True) -> None:
        """Take in a sample, unless it is known already or older than what is known."""
        key, timestamp = str(sample.key_expr), sample.timestamp
        if timestamp is not None:
            if key in self._newest and self._newest[key] >= timestamp:
                return
            self._newest[key] = timestamp
        leaf = key.rpartition("/")[2]
        try:
            self._note(leaf, sample, live=live)
        except ValidationError as error:
            self.watched.trouble = (
                f"{leaf} of another version of macor-hil? {error.errors()[0]['msg']}"
            )

    def _note(self, leaf: str, sample: zenoh.Sample, *, live: bool) -> None:
        now = time.monotonic()
        if leaf == FRAME:
            self.watched.see(len(sample.payload), now)
        elif leaf == DECISION:
            decision = Decision.model_validate_json(sample.payload.to_bytes())
            self.watched.decide(decision, now if live else None)
        else:
            self.watched.state = State.model_validate_json(sample.payload.to_bytes())
