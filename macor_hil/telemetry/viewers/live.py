"""Live data of a robot for Foxglove and Lichtblick, over Foxglove's WebSocket protocol.

The same topics as in a recording (`viewers.topics`), while they happen. Nothing that a viewer sends
has any effect. Needs the extra 'foxglove'.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Final

import foxglove
import zenoh
from foxglove.websocket import ChannelView, Client, ServerListener

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.feed import Feed, Loss, NotTaken, Refusal
from macor_hil.telemetry.viewers.topics import Form, Told, Topics

_LOOK: Final = 0.2
"""Seconds to wait for an event."""

_LASTING: Final = ("alive", "arena", "map", "robot", "state", "way")
"""Last parts of topics whose latest message is told again to who comes later."""


def show(
    session: zenoh.Session, robot: str, host: str, port: int, ready: Callable[[str], None]
) -> NotTaken:
    """Show a robot to viewers until Ctrl-C; it may come, go and come again, and so may they.

    Args:
        session: an open session.
        robot: its name in the keys.
        host: address to listen on.
        port: TCP port to listen on; 0: any free one.
        ready: hears the address that viewers connect to.

    Returns:
        What was not shown.

    Raises:
        TelemetryError: the name cannot be part of a key, or nothing can listen there.
    """
    topics, not_taken = Topics(robot), NotTaken()
    with (
        Feed(session, robot, camera=True) as feed,
        _serving(robot, host, port, topics.all()) as (channels, url),
    ):
        ready(url)
        try:
            while True:
                event = feed.get(_LOOK)
                if isinstance(event, Loss | Refusal):
                    not_taken.count(event)
                elif event is not None:
                    for told in topics.tell(event):
                        channels.log(told)
        except KeyboardInterrupt:
            pass  # the way to end it
    return not_taken


class _Channels(ServerListener):
    """The channels of one server.

    All are there before a viewer is: of one that is made while viewers look on, each would miss
    the message that it is made for, and the library refuses a subscription that comes at once.
    """

    def __init__(self, topics: Iterable[tuple[str, Form]]) -> None:
        self.context = foxglove.Context()
        self._channels = {topic: self._channel(topic, form) for topic, form in topics}
        self._latest: dict[str, Told] = {}
        self._now = 0

    def log(self, told: Told) -> None:
        """Tell a message to all who have subscribed to its topic."""
        if told.topic.rpartition("/")[2] in _LASTING:
            self._latest[told.topic] = told
        self._now = told.time
        self._channels[told.topic].log(told.data, log_time=told.time)

    def _channel(self, topic: str, form: Form) -> foxglove.Channel:
        schema = foxglove.Schema(name=form.name, encoding=form.schema_encoding, data=form.schema)
        return foxglove.Channel(
            topic, schema=schema, message_encoding=form.encoding, context=self.context
        )

    def on_subscribe(self, _: Client, channel: ChannelView) -> None:
        """Tell again what lasts; in a thread of the library."""
        if told := self._latest.get(channel.topic):
            # as of now: to a viewer, what is old comes from another recording
            self._channels[told.topic].log(told.data, log_time=self._now)


@contextmanager
def _serving(
    robot: str, host: str, port: int, topics: Iterable[tuple[str, Form]]
) -> Iterator[tuple[_Channels, str]]:
    channels = _Channels(topics)
    try:
        server = foxglove.start_server(
            name=f"macor-hil {robot}",
            host=host,
            port=port,
            server_listener=channels,
            context=channels.context,
        )
    except RuntimeError as error:
        reason = str(error).removeprefix("FoxgloveError: ")
        raise TelemetryError(
            f"cannot listen on {host}:{port}: {reason}; give another --port"
        ) from None
    try:
        yield channels, f"ws://{host}:{server.port}"
    finally:
        server.stop()
