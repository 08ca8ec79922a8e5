"""Samples as they travel: a payload with its encoding, its stamp and its time stamp.

Emulator, controller and player of recordings publish and answer by what is here alone. Nothing
here waits for a subscriber: one that is too slow loses samples, and the numbers in the stamps
show it.
"""

import json
from contextlib import ExitStack
from typing import NamedTuple, cast

import zenoh

from khepera_protocol.zenoh.keys import DESCRIBE, SCHEMA_MEDIA_TYPE, Key, schema_name
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Stamp
from khepera_protocol.zenoh.schema import schema_of


class Content(NamedTuple):
    """A payload as bytes, and their encoding."""

    data: bytes
    encoding: zenoh.Encoding


class Sample(NamedTuple):
    """A content with its stamp (JSON; None: without) and the time stamp that orders samples."""

    content: Content
    stamp: str | None
    timestamp: zenoh.Timestamp


def json_content(side: str, payload: Payload) -> Content:
    """Return a payload in JSON; its encoding names its schema."""
    encoding = zenoh.Encoding.APPLICATION_JSON.with_schema(schema_name(side, type(payload)))
    return Content(payload.model_dump_json().encode(), encoding)


class SampleWriter:
    """Makes the samples of one robot's key, numbered from 0, and answers queries with them.

    Args:
        session: an open session, which stays its owner's.
        key: of the table.
        robot: the robot's name in the keys.

    Attributes:
        name: the key with the robot's name in it.
    """

    def __init__(self, session: zenoh.Session, key: Key, robot: str) -> None:
        self.name = key.of(robot)
        self._session = session
        self._payload = key.payload
        self._sequence = 0

    def sample(self, content: Content, time: float) -> Sample:
        """Return the next sample.

        Args:
            content: its content.
            time: seconds on the robot's clock.
        """
        stamp = Stamp(sequence=self._sequence, time=time).model_dump_json()
        timestamp = self._session.new_timestamp()
        self._sequence += 1
        return Sample(content, stamp, timestamp)

    def describe(self, query: zenoh.Query) -> bool:
        """Answer a query that asks for the schema; return whether it does."""
        if self._payload is None or DESCRIBE not in query.parameters:
            return False
        schema = json.dumps(schema_of(self._payload))
        query.reply(self.name, schema, encoding=zenoh.Encoding(SCHEMA_MEDIA_TYPE))
        return True

    def reply(self, query: zenoh.Query, sample: Sample) -> None:
        """Answer a query with a sample."""
        query.reply(
            self.name,
            sample.content.data,
            encoding=sample.content.encoding,
            attachment=sample.stamp,
            timestamp=sample.timestamp,
        )


class SamplePublisher:
    """Publishes the samples of a key; dropped where a subscriber is too slow.

    Args:
        session: an open session, which stays its owner's.
        name: the key with the robot's name in it.
        priority: of the samples on their way.
    """

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        priority: zenoh.Priority = zenoh.Priority.DATA,
    ) -> None:
        self._publisher = session.declare_publisher(
            name, congestion_control=zenoh.CongestionControl.DROP, priority=priority
        )

    @property
    def heard(self) -> bool:
        """True while anyone subscribes to the key."""
        # the library's type stub says bool; it is an object, and as such always true
        return cast(zenoh.MatchingStatus, self._publisher.matching_status).matching

    def put(self, sample: Sample) -> None:
        """Publish a sample."""
        self._publisher.put(
            sample.content.data,
            encoding=sample.content.encoding,
            attachment=sample.stamp,
            timestamp=sample.timestamp,
        )

    def close(self) -> None:
        """Publish no more."""
        self._publisher.undeclare()


class AnsweringPublisher:
    """Publishes the samples of a robot's key; queries get the latest one, or the schema.

    Args:
        session: an open session, which stays its owner's.
        key: of the table.
        robot: the robot's name in the keys.
        priority: of the samples on their way.
        missing: refusal of a query while there is no latest sample.

    Attributes:
        writer: makes the samples.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: Key,
        robot: str,
        priority: zenoh.Priority = zenoh.Priority.DATA,
        missing: str = "nothing yet",
    ) -> None:
        self.writer = SampleWriter(session, key, robot)
        self._missing = missing
        # replaced as a whole, for the library's thread that answers the queries
        self._latest: Sample | None = None
        with ExitStack() as stack:
            self._publisher = SamplePublisher(session, self.writer.name, priority)
            stack.callback(self._publisher.close)
            stack.enter_context(session.declare_queryable(self.writer.name, self._answer))
            self._stack = stack.pop_all()

    def put(self, sample: Sample) -> None:
        """Publish a sample; queries are answered with it from then on."""
        try:
            self._publisher.put(sample)
        finally:
            # not before: who joins would get an answer that overtakes what is on its way
            self._latest = sample

    def forget(self) -> None:
        """Drop the latest sample: queries are refused until there is another one."""
        self._latest = None

    def close(self) -> None:
        """Publish and answer no more."""
        self._stack.close()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            if self.writer.describe(query):
                return
            latest = self._latest
            if latest is None:
                query.reply_err(self._missing, encoding=zenoh.Encoding.TEXT_PLAIN)
            else:
                self.writer.reply(query, latest)
