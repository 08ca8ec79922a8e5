"""The topics of one robot in ROS 2, and the messages that its events become.

What is known without a controller is told without one: pictures and truth by the emulator, readings
of the sensors as they pass on the serial line, whoever asks for them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

from khepera_protocol.zenoh.controller_payloads import Decision, Learned, Link, State
from khepera_protocol.zenoh.keys import CAMERA, CONTROLLER, FRAME, PAYLOADS
from khepera_protocol.zenoh.payloads import USUAL_ROBOT, Outline, Truth, Wire
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.hardware.cameras.decoding import check_picture, decode_picture
from macor_hil.hardware.odometry import Wheels
from macor_hil.hardware.robots.form import Form, Reading
from macor_hil.hardware.robots.forms import form_of
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.ros2 import moving, sensing, telling
from macor_hil.telemetry.ros2.messages import Frames, topic_of
from macor_hil.telemetry.ros2.rmw_zenoh import Topic
from macor_hil.telemetry.viewers.frames import Whereabouts
from macor_hil.telemetry.viewers.wire_lines import WireLines

IMAGE: Final = "image/compressed"
CAMERA_INFO: Final = "camera_info"
ODOMETRY: Final = "odom"
COMMAND: Final = "cmd_vel"
SCAN: Final = "scan"
BATTERY: Final = "battery"
PLAN: Final = "plan"
MARKERS: Final = "markers"
ARENA: Final = "arena"
TRANSFORMS: Final = "/tf"
DIAGNOSTICS: Final = "/diagnostics"

RANGES: Final = tuple(f"range/ir{number}" for number in range(8))
"""In the driver's order: from the left over the front to the back."""

KINDS: Final[dict[str, type[Any]]] = {
    IMAGE: ros.sensor_msgs__msg__CompressedImage,
    CAMERA_INFO: ros.sensor_msgs__msg__CameraInfo,
    ODOMETRY: ros.nav_msgs__msg__Odometry,
    COMMAND: ros.geometry_msgs__msg__TwistStamped,
    **dict.fromkeys(RANGES, ros.sensor_msgs__msg__Range),
    SCAN: ros.sensor_msgs__msg__LaserScan,
    BATTERY: ros.sensor_msgs__msg__BatteryState,
    PLAN: ros.nav_msgs__msg__Path,
    MARKERS: ros.visualization_msgs__msg__MarkerArray,
    ARENA: ros.visualization_msgs__msg__MarkerArray,
    TRANSFORMS: ros.tf2_msgs__msg__TFMessage,
    DIAGNOSTICS: ros.diagnostic_msgs__msg__DiagnosticArray,
}
"""Names of topics, in the robot's namespace unless they begin with a slash, and their messages."""

_OFTEN: Final = 2_000_000_000
"""Nanoseconds after which what lasts is told again, for who came since."""

Told = tuple[str, Any]
"""A name of the table, and a message."""


def topic(name: str, namespace: str) -> Topic:
    """Return a topic of the table for a namespace."""
    whole = name if name.startswith("/") else f"{namespace}/{name}"
    return topic_of(whole, KINDS[name])


@dataclass
class RosTopics:
    """Turns the events of one robot, in their order, into messages.

    Args:
        robot: its name in the keys.
        frames: names of its frames.
        wheels: that the driver's counts are counted with.
        kind: of the robot.
    """

    robot: str
    frames: Frames = field(default_factory=Frames)
    wheels: Wheels = field(default_factory=Wheels)
    kind: str = USUAL_ROBOT

    def __post_init__(self) -> None:
        self._where = Whereabouts(self.wheels)
        self._lines = WireLines()
        self._controlled = False
        self._before: moving.Timed | None = None
        self._sequence = -1
        self._size = (0, 0)
        self._outline: Outline | None = None
        self._state: State | None = None
        self._link: Link | None = None
        self._often = 0

    def tell(self, event: Event, now: int, untold: str = "") -> Iterator[Told]:
        """Yield the messages of an event.

        Args:
            event: what happened.
            now: the wall clock, ns since 1970, for headers.
            untold: words on samples that were not forwarded.

        Raises:
            PayloadError, WrongPictureError, TelemetryError: it cannot be read.
        """
        if now - self._often >= _OFTEN:
            self._often = now
            yield DIAGNOSTICS, telling.diagnostics(self.robot, self._state, self._link, untold, now)
            if self._outline is not None:
                yield ARENA, telling.arena_markers(self._outline, now, self.frames)
        if isinstance(event, Presence):
            self._meet(event)
        elif event.leaf in (FRAME.leaf, CAMERA.leaf):
            yield from self._see(event, now)
        elif kind := PAYLOADS.get((event.side, event.leaf)):
            yield from self._read(kind.parse(event.data), now)

    @property
    def _form(self) -> Form:
        return form_of(self.kind)

    @property
    def _radius(self) -> float:
        return self._outline.robot_radius if self._outline else self._form.radius

    def _meet(self, presence: Presence) -> None:
        if presence.side == CONTROLLER:
            self._controlled = presence.alive
            self._state = self._link = None
            self._where.lose_count()

    def _see(self, arrival: Arrival, now: int) -> Iterator[Told]:
        if arrival.leaf == CAMERA.leaf and self._controlled:
            return  # the picture that is decided on is told instead
        check_picture(arrival.data, "it is no picture")
        form = arrival.encoding.partition("/")[2]
        yield IMAGE, sensing.image(arrival.data, form, now, self.frames)
        if self._size == (0, 0):
            height, width = decode_picture(arrival.data, "it is no picture").shape[:2]
            self._size = width, height
        yield CAMERA_INFO, sensing.camera_info(*self._size, now, self.frames)

    def _read(self, payload: object, now: int) -> Iterator[Told]:
        match payload:
            case Truth():
                self._where.truth = payload.pose
                yield self._tree(now)
            case Outline():
                self._outline, self.kind = payload, payload.robot_kind
                yield ARENA, telling.arena_markers(payload, now, self.frames)
            case Learned():
                self._where.learn(payload)
            case State():
                self._state, self.kind = payload, payload.robot_kind
            case Link():
                self._link = payload
            case Decision():
                yield from self._decide(payload, now)
            case Wire():
                self.kind = payload.robot_kind
                for passed in self._lines.take(payload):
                    yield from self._hear(passed.reading, passed.time, now)

    def _hear(self, told: Reading, when: float, now: int) -> Iterator[Told]:
        """Yield what passed on the line; where a controller drives, it tells the rest itself."""
        if self._controlled:
            told = Reading(battery=told.battery)
        yield from self.sense(self._form.in_the_drivers_counts(told), when, now)

    def _decide(self, decision: Decision, now: int) -> Iterator[Told]:
        self._where.decide(decision)
        yield COMMAND, moving.command(decision, now, self.frames)
        if decision.sequence <= self._sequence:
            self._before = None  # another run
        self._sequence = decision.sequence
        yield from self._move((decision.time, decision.odometry.pose), now)
        yield from self._infrared(decision.infrared, now)
        ways = [self._where.way(each.ahead) for each in decision.hypotheses]
        best = ways[0] if ways else self._where.way(decision.sequence_ahead)
        yield PLAN, moving.path(best, now, self.frames)
        yield MARKERS, telling.decision_markers(decision, ways, now, self.frames)

    def sense(self, told: Reading, when: float, now: int) -> Iterator[Told]:
        """Yield what a robot tells of itself.

        Args:
            told: it; counters are the driver's.
            when: seconds on the robot's clock.
            now: the wall clock, ns since 1970, for headers.
        """
        if told.proximity is not None:
            yield from self._infrared(told.proximity, now)
        if told.battery is not None:
            yield BATTERY, sensing.battery(told.battery, self._form, now, self.frames)
        if told.recounted:
            self._where.lose_count()
        if told.counters is not None:
            self._where.count(told.counters)
            yield from self._move((when, self._where.odometry), now)

    def _move(self, here: moving.Timed, now: int) -> Iterator[Told]:
        yield ODOMETRY, moving.odometry(here, self._before, now, self.frames)
        self._before = here
        yield self._tree(now)

    def _infrared(self, readings: tuple[int, ...] | list[int], now: int) -> Iterator[Told]:
        form = self._form
        yield from zip(RANGES, sensing.ranges(readings, form, now, self.frames), strict=True)
        yield SCAN, sensing.scan(readings, form, self._radius, now, self.frames)

    def _tree(self, now: int) -> Told:
        where, shape = self._where, (self._form, self._radius)
        tree = moving.transforms(where.origin, where.odometry, *shape, now, self.frames)
        return TRANSFORMS, tree
