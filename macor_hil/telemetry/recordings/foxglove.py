"""Messages that Foxglove draws by itself, made from a robot's events.

Frames: `arena` is the arena's, `odometry` begins where a run does, `robot` goes with the robot.
"""

from collections.abc import Iterable, Iterator
from math import cos, radians, sin
from typing import Final

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.message import Message
from khepera_protocol.serial.commands import SENSOR_BEARINGS
from khepera_protocol.serial.units import BODY_RADIUS, PROXIMITY_FULL
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import (
    Outline,
    Pose,
    Truth,
    Wire,
)

from macor_hil.telemetry.feed import Arrival, Event

_ARENA: Final = "arena"
_ODOMETRY: Final = "odometry"
_ROBOT: Final = "robot"
_REACH: Final = 0.04
"""Metres that the arrow of a sensor with the greatest reading is long."""
_LOG_LEVELS: Final = {"fault": Log.WARNING}


def drawings(event: Event) -> Iterator[tuple[str, Message]]:
    """Yield messages that show an event, each with the last part of its topic."""
    if not isinstance(event, Arrival):
        return
    try:
        match event.leaf:
            case "truth":
                truth = Truth.parse(event.data)
                yield "pose", _pose(_ARENA, truth.pose, event.received)
                yield "transform", _transform(_ARENA, truth.pose, event.received)
            case "arena":
                outline = Outline.parse(event.data)
                yield "walls", _walls(outline, event.received)
            case "decision":
                decision = Decision.parse(event.data)
                yield "odometry", _pose(_ODOMETRY, decision.odometry.pose, event.received)
                yield "infrared", _infrared(decision.infrared, event.received)
            case "wire":
                for message in _log(Wire.parse(event.data), event.received):
                    yield "wire", message
    except PayloadError:
        return  # of another version: kept as it came, not drawn


def _pose(frame: str, pose: Pose, received: int) -> PoseInFrame:
    message = PoseInFrame(frame_id=frame)
    message.timestamp.FromNanoseconds(received)
    message.pose.position.x = pose.x
    message.pose.position.y = pose.y
    message.pose.orientation.z = sin(pose.heading / 2)
    message.pose.orientation.w = cos(pose.heading / 2)
    return message


def _transform(frame: str, pose: Pose, received: int) -> FrameTransform:
    message = FrameTransform(parent_frame_id=frame, child_frame_id=_ROBOT)
    message.timestamp.FromNanoseconds(received)
    message.translation.x = pose.x
    message.translation.y = pose.y
    message.rotation.z = sin(pose.heading / 2)
    message.rotation.w = cos(pose.heading / 2)
    return message


def _walls(outline: Outline, received: int) -> SceneUpdate:
    update = SceneUpdate()
    entity = update.entities.add(frame_id=_ARENA, id="walls")
    entity.timestamp.FromNanoseconds(received)
    for solid in outline.solids:
        line = entity.lines.add(type=LinePrimitive.LINE_LOOP, thickness=0.003)
        line.pose.orientation.w = 1.0
        line.color.r, line.color.g, line.color.b = solid.colour
        line.color.a = 1.0
        for x, y in solid.corners:
            line.points.add(x=x, y=y)
    return update


def _infrared(readings: Iterable[int], received: int) -> SceneUpdate:
    update = SceneUpdate()
    entity = update.entities.add(frame_id=_ROBOT, id="infrared", frame_locked=True)
    entity.timestamp.FromNanoseconds(received)
    for bearing, reading in zip(map(radians, SENSOR_BEARINGS), readings, strict=True):
        share = min(max(reading / PROXIMITY_FULL, 0.0), 1.0)
        arrow = entity.arrows.add(
            shaft_length=0.005 + share * _REACH,
            shaft_diameter=0.004,
            head_length=0.004,
            head_diameter=0.008,
        )
        arrow.pose.position.x = BODY_RADIUS * cos(bearing)
        arrow.pose.position.y = BODY_RADIUS * sin(bearing)
        arrow.pose.orientation.z = sin(bearing / 2)
        arrow.pose.orientation.w = cos(bearing / 2)
        arrow.color.r, arrow.color.g, arrow.color.a = share, 1.0 - share, 1.0
    return update


def _log(wire: Wire, received: int) -> Iterator[Log]:
    for entry in wire.entries:
        message = Log(
            level=_LOG_LEVELS.get(entry.what, Log.INFO),
            name=entry.what,
            message=printable(entry.text),
        )
        message.timestamp.FromNanoseconds(received)
        yield message
