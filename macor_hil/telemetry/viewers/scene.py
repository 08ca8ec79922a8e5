"""Messages that Foxglove draws by itself, made from a robot's events.

Frames: `arena` is the arena's, `odometry` begins where a run does, `robot` goes with the robot
(`viewers.frames`). Each message shows all that there is of its subject, so that a viewer that jumps
in time needs the latest one of each topic alone.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from math import cos, hypot, radians, sin
from typing import Any, Final

from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Decision, Learned, State
from khepera_protocol.zenoh.keys import CONTROLLER, PAYLOADS
from khepera_protocol.zenoh.payload_model import Payload, PayloadError
from khepera_protocol.zenoh.payloads import USUAL_ROBOT, Outline, Pose, Truth, Wire

from macor_hil.hardware.robots.form import REPLY, REQUEST, Form, Passed, Reading
from macor_hil.hardware.robots.forms import form_of
from macor_hil.hardware.robots.robot import FULL
from macor_hil.telemetry.feed import Event, Presence
from macor_hil.telemetry.viewers.frames import HERE, Whereabouts
from macor_hil.telemetry.viewers.prisms import Place, prism
from macor_hil.telemetry.viewers.wire_lines import WireLines

ARENA: Final = "arena"
ODOMETRY: Final = "odometry"
ROBOT: Final = "robot"

_WORDS: Final = 0.075
"""Metres above the floor at which a decision is told."""

_STEP: Final = 0.01
"""Metres between two points of the way driven."""

_WAY: Final = 500
"""Points of it that are drawn: the last five metres."""

_Colour = tuple[float, float, float, float]
_BEST: Final = (1.0, 0.45, 0.0, 1.0)
_OTHER: Final = (0.15, 0.45, 0.9, 0.7)
_DRIVEN: Final = (0.2, 0.2, 0.25, 0.8)
_SHELL: Final = (0.25, 0.25, 0.3, 1.0)
_NOSE: Final = (1.0, 0.8, 0.1, 1.0)


SCENES: Final[dict[str, type[Message]]] = {
    "arena": SceneUpdate,
    "robot": SceneUpdate,
    "infrared": SceneUpdate,
    "plan": SceneUpdate,
    "way": SceneUpdate,
    "transform": FrameTransform,
    "pose": PoseInFrame,
    "odometry": PoseInFrame,
    "wire": Log,
}
"""Last parts of the topics that a scene is drawn on, and their messages."""


class Scene:
    """Draws the events of one robot, in their order.

    What passes on its line tells its sensors where no controller does, whoever asks for them.
    """

    def __init__(self) -> None:
        self._controlled = False
        self._where = Whereabouts()
        self._lines = WireLines()
        self._form = form_of(USUAL_ROBOT)
        self._radius = self._form.radius
        self._way: deque[Pose] = deque(maxlen=_WAY)

    def draw(self, event: Event, now: int) -> Iterator[tuple[str, Message]]:
        """Yield messages that show an event, each with the last part of its topic.

        Args:
            event: what happened.
            now: time that they carry, ns since 1970.
        """
        if isinstance(event, Presence):
            self._meet(event)
            return
        kind = PAYLOADS.get((event.side, event.leaf))
        if kind is None:
            return
        try:
            payload = kind.parse(event.data)
        except PayloadError:
            return  # of another version: kept as it came, not drawn
        for topic, message in self._drawn(payload):
            if isinstance(message, SceneUpdate):
                for entity in message.entities:
                    entity.timestamp.FromNanoseconds(now)
            else:
                message.timestamp.FromNanoseconds(now)
            yield topic, message

    def _drawn(self, payload: Payload) -> Iterator[tuple[str, Message]]:
        where = self._where
        match payload:
            case Truth():
                where.truth = payload.pose
                yield "pose", _pose(ARENA, payload.pose)
                yield from self._tree()
                yield from self._driven(payload.pose)
            case Outline():
                self._form, self._radius = form_of(payload.robot_kind), payload.robot_radius
                yield "arena", _update(_arena(payload))
                yield "robot", _update(_robot(self._form, self._radius))
            case State():
                self._take_kind(payload.robot_kind)
            case Decision():
                where.decide(payload)
                yield from self._moved()
                yield "robot", _update(_robot(self._form, self._radius))
                yield "infrared", _update(_infrared(payload.infrared, self._form, self._radius))
                yield "plan", _update(*self._plan(payload))
            case Wire():
                self._take_kind(payload.robot_kind)
                passed = list(self._lines.take(payload))
                for message in _logs(passed):
                    yield "wire", message
                if not self._controlled:
                    yield from self._told([each.reading for each in passed])
            case Learned():
                where.learn(payload)

    def _meet(self, presence: Presence) -> None:
        if presence.side == CONTROLLER:
            self._controlled = presence.alive
            self._where.lose_count()

    def _tree(self) -> Iterator[tuple[str, Message]]:
        where = self._where
        if where.truth is not None:
            yield "transform", _transform(ARENA, ODOMETRY, where.origin)
        yield "transform", _transform(ODOMETRY, ROBOT, where.odometry)

    def _moved(self) -> Iterator[tuple[str, Message]]:
        yield from self._tree()
        yield "odometry", _pose(ODOMETRY, self._where.odometry)
        if self._where.truth is None:
            yield from self._driven(self._where.odometry)

    def _told(self, readings: Sequence[Reading]) -> Iterator[tuple[str, Message]]:
        """Yield what readings that came together come to: the latest infrared, and the way."""
        counted, seen = False, None
        for told in map(self._form.in_the_drivers_counts, readings):
            if told.recounted:
                self._where.lose_count()
            if told.counters is not None:
                self._where.count(told.counters)
                counted = True
            seen = told.proximity or seen
        if counted:
            yield from self._moved()
        if seen is not None:
            yield "infrared", _update(_infrared(seen, self._form, self._radius))

    def _take_kind(self, kind: str) -> None:
        """Take in which kind of robot it is, where no arena tells its size."""
        form = form_of(kind)
        if form is not self._form:
            self._form, self._radius = form, form.radius

    def _driven(self, pose: Pose) -> Iterator[tuple[str, Message]]:
        """Yield the way driven, where it has become longer."""
        way = self._way
        step = hypot(pose.x - way[-1].x, pose.y - way[-1].y) if way else _STEP
        if step > 10 * _STEP:
            way.clear()  # the robot was put there
        if step < _STEP:
            return
        way.append(pose)
        entity = SceneEntity(frame_id=ODOMETRY if self._where.truth is None else ARENA, id="way")
        _line(entity, [(each.x, each.y, 0.002) for each in way], 0.004, _DRIVEN)
        yield "way", _update(entity)

    def _plan(self, decision: Decision) -> Iterator[SceneEntity]:
        """Yield what was weighed, the best one above, and its command in words."""
        entity = SceneEntity(frame_id=ODOMETRY, id="plan")
        ways = [(each.ahead, each.evaluation) for each in decision.hypotheses]
        for rank, (ahead, _) in reversed(list(enumerate(ways))):
            best = rank == 0
            height = 0.006 if best else 0.004
            points = [(pose.x, pose.y, height) for pose in self._where.way(ahead)]
            _line(entity, points, 0.005 if best else 0.002, _BEST if best else _OTHER)
        if ways:
            end = self._where.way(ways[0][0])[-1]
            ball = entity.spheres.add()
            _place(ball, end, 0.008)
            ball.size.x = ball.size.y = ball.size.z = 0.012
            _paint(ball.color, _BEST)
        words = entity.texts.add(
            text=_words(decision), billboard=True, font_size=13.0, scale_invariant=True
        )
        _place(words, self._where.odometry, _WORDS)
        _paint(words.color, (0.1, 0.1, 0.1, 1.0))
        yield entity


def _words(decision: Decision) -> str:
    value = f" {decision.hypotheses[0].evaluation:.2f}" if decision.hypotheses else ""
    end = "  COLLISION" if decision.collided else ""
    return printable(f"{decision.sequence}: {decision.command}{value}{end}", 100)


def _update(*entities: SceneEntity) -> SceneUpdate:
    return SceneUpdate(entities=entities)


def _pose(frame: str, pose: Pose) -> PoseInFrame:
    message = PoseInFrame(frame_id=frame)
    _place(message, pose)
    return message


def _transform(frame: str, child: str, pose: Pose) -> FrameTransform:
    message = FrameTransform(parent_frame_id=frame, child_frame_id=child)
    message.translation.x, message.translation.y = pose.x, pose.y
    message.rotation.z, message.rotation.w = sin(pose.heading / 2), cos(pose.heading / 2)
    return message


def _arena(outline: Outline) -> SceneEntity:
    """Draw walls as upright prisms on a floor."""
    entity = SceneEntity(frame_id=ARENA, id="arena")
    corners = [corner for solid in outline.solids for corner in solid.corners]
    if corners:
        xs, ys = zip(*corners, strict=True)
        floor = entity.cubes.add()
        middle = Pose(x=(min(xs) + max(xs)) / 2, y=(min(ys) + max(ys)) / 2, heading=0.0)
        _place(floor, middle, -0.002)
        floor.size.x, floor.size.y = max(xs) - min(xs), max(ys) - min(ys)
        floor.size.z = 0.002
        _paint(floor.color, (*outline.floor, 1.0))
    for solid in outline.solids:
        body = entity.triangles.add()
        body.pose.orientation.w = 1.0
        _paint(body.color, (*solid.colour, 1.0))
        _points(body.points, prism(solid.corners))
    return entity


def _robot(form: Form, radius: float) -> SceneEntity:
    """Draw the body, two wheels, and an arrow that points ahead."""
    entity = SceneEntity(frame_id=ROBOT, id="robot", frame_locked=True)
    body = entity.cylinders.add(bottom_scale=1.0, top_scale=1.0)
    _place(body, HERE, form.height / 2)
    body.size.x = body.size.y = 2 * radius
    body.size.z = form.height
    _paint(body.color, _SHELL)
    arrow = entity.arrows.add(
        shaft_length=0.5 * radius,
        shaft_diameter=0.006,
        head_length=0.5 * radius,
        head_diameter=0.014,
    )
    _place(arrow, HERE, form.height + 0.003)
    _paint(arrow.color, _NOSE)
    return entity


def _infrared(readings: Sequence[int], form: Form, radius: float) -> SceneEntity:
    """Draw a ray from each sensor to what it sees: the nearer, the redder."""
    entity = SceneEntity(frame_id=ROBOT, id="infrared", frame_locked=True)
    for bearing, reading in zip(map(radians, form.bearings), readings, strict=True):
        share = min(max(reading / FULL, 0.0), 1.0)
        seen = form.distance(reading)
        reach = radius + (form.farthest if seen is None else seen)
        ends = [
            (length * cos(bearing), length * sin(bearing), form.sensor_height)
            for length in (radius, reach)
        ]
        _line(entity, ends, 0.003, (share, 1.0 - share, 0.1, 0.35 if seen is None else 1.0))
    return entity


def _line(entity: SceneEntity, points: Sequence[Place], thickness: float, colour: _Colour) -> None:
    line = entity.lines.add(type=LinePrimitive.LINE_STRIP, thickness=thickness)
    line.pose.orientation.w = 1.0
    _paint(line.color, colour)
    _points(line.points, points)


def _points(into: Any, points: Iterable[Place]) -> None:
    for x, y, z in points:
        into.add(x=x, y=y, z=z)


def _place(part: Any, pose: Pose, height: float = 0.0) -> None:
    part.pose.position.x, part.pose.position.y, part.pose.position.z = pose.x, pose.y, height
    part.pose.orientation.z = sin(pose.heading / 2)
    part.pose.orientation.w = cos(pose.heading / 2)


def _paint(part: Color, colour: _Colour) -> None:
    part.r, part.g, part.b, part.a = colour


def _logs(lines: Iterable[Passed]) -> Iterator[Log]:
    for line in lines:
        level = Log.INFO if line.what in (REQUEST, REPLY) else Log.WARNING
        yield Log(level=level, name=line.what, message=printable(line.text))
