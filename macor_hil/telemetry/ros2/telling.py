"""Messages of what the controller thinks and how it does: markers and diagnostics."""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from khepera_protocol.text import printable
from khepera_protocol.zenoh.controller_payloads import Decision, Link, Phase, State
from khepera_protocol.zenoh.payloads import Outline, Pose
from rosbags.typesys.stores import ros2_jazzy as ros

from macor_hil.telemetry.ros2.messages import Frames, header, heading, point, pose, vector
from macor_hil.telemetry.viewers.prisms import prism

_ABOVE: Final = 0.08
_LETTERS: Final = 0.02
"""Metres: height of words above the floor, and of their letters."""

_WARNED: Final = (Phase.LATE, Phase.BACKING_OFF, Phase.RECOVERING)
_BEST: Final = (1.0, 0.45, 0.0, 1.0)
_OTHER: Final = (0.15, 0.45, 0.9, 0.7)
_INK: Final = (0.1, 0.1, 0.1, 1.0)
_LASTS: Final = 30
"""Seconds after which a decision that nothing followed is no longer drawn."""

_Marker = ros.visualization_msgs__msg__Marker
_Colour = tuple[float, float, float, float]


def decision_markers(
    decision: Decision, ways: Sequence[Sequence[Pose]], time: int, frames: Frames
) -> ros.visualization_msgs__msg__MarkerArray:
    """Return what was weighed as lines, the best one first, and the command in words.

    Args:
        decision: the decision.
        ways: of its hypotheses, in the frame of the odometry.
        time: for the headers.
        frames: their names.
    """
    clear = _marker(time, frames.odometry, "plan", 0, _Marker.ARROW, _INK)
    clear.action = _Marker.DELETEALL
    markers: list[Any] = [clear]
    for rank, way in enumerate(ways):
        best = rank == 0
        line = _marker(
            time, frames.odometry, "plan", rank, _Marker.LINE_STRIP, _BEST if best else _OTHER
        )
        line.scale = vector(0.005 if best else 0.002, 0.0, 0.0)
        line.points = [point(place.x, place.y, 0.005) for place in way]
        if len(line.points) > 1:
            markers.append(line)
    words = _marker(time, frames.odometry, "decision", 0, _Marker.TEXT_VIEW_FACING, _INK)
    words.pose = pose(decision.odometry.pose, _ABOVE)
    words.scale = vector(0.0, 0.0, _LETTERS)
    words.text = printable(
        f"{decision.sequence}: {decision.command}{' COLLISION' if decision.collided else ''}", 100
    )
    markers.append(words)
    return ros.visualization_msgs__msg__MarkerArray(markers)


def arena_markers(
    outline: Outline, time: int, frames: Frames
) -> ros.visualization_msgs__msg__MarkerArray:
    """Return the arena's walls and things, as upright prisms without a floor."""
    prisms: list[Any] = [
        _prism(number, solid.corners, (*solid.colour, 1.0), time, frames.world)
        for number, solid in enumerate(outline.solids)
    ]
    return ros.visualization_msgs__msg__MarkerArray(prisms)


def diagnostics(
    robot: str, state: State | None, link: Link | None, untold: str, time: int
) -> ros.diagnostic_msgs__msg__DiagnosticArray:
    """Return how controller, serial line and bridge do.

    Args:
        robot: name of the robot.
        state: the latest one; None: nobody tells it.
        link: likewise.
        untold: words on samples that were not forwarded; empty: all were.
        time: for the header.
    """
    kind = ros.diagnostic_msgs__msg__DiagnosticStatus
    statuses = []
    if state is None:
        statuses.append(_status(robot, "controller", kind.STALE, "no controller", {}))
    else:
        level = kind.WARN if state.phase in _WARNED else kind.OK
        level = kind.ERROR if state.phase is Phase.FAILED else level
        words = f"{state.phase}{': ' if state.reason else ''}{state.reason}"
        facts = {
            "planner": state.planner,
            "port": state.port,
            "camera": state.camera,
            "map": state.map,
            "driven": state.driven,
            "limit": state.limit,
        }
        statuses.append(_status(robot, "controller", level, words, facts))
    if link is not None:
        level = kind.WARN if link.failures else kind.OK
        words = f"{link.failures} of {link.exchanges + link.failures} requests failed"
        facts = {"mean round trip, s": f"{link.mean:.4f}", "worst, s": f"{link.worst:.4f}"}
        statuses.append(_status(robot, "serial line", level, words, facts))
    level = kind.WARN if untold else kind.OK
    statuses.append(_status(robot, "bridge", level, untold or "all samples are forwarded", {}))
    return ros.diagnostic_msgs__msg__DiagnosticArray(header(time, ""), statuses)


def _status(
    robot: str, name: str, level: int, words: str, facts: dict[str, object]
) -> ros.diagnostic_msgs__msg__DiagnosticStatus:
    values = [
        ros.diagnostic_msgs__msg__KeyValue(key, printable(str(value)))
        for key, value in facts.items()
    ]
    return ros.diagnostic_msgs__msg__DiagnosticStatus(
        level, f"{robot}: {name}", printable(words), robot, values
    )


def _prism(
    number: int, corners: Sequence[tuple[float, float]], colour: _Colour, time: int, frame: str
) -> _Marker:
    marker = _marker(time, frame, "arena", number, _Marker.TRIANGLE_LIST, colour)
    marker.scale = vector(1.0, 1.0, 1.0)
    marker.points = [point(*each) for each in prism(corners)]
    marker.lifetime.sec = 0
    return marker


def _marker(
    time: int, frame: str, group: str, number: int, kind: int, colour: Iterable[float]
) -> _Marker:
    empty = np.zeros(0, np.uint8)
    return _Marker(
        header=header(time, frame),
        ns=group,
        id=number,
        type=kind,
        action=_Marker.ADD,
        pose=ros.geometry_msgs__msg__Pose(point(0.0, 0.0), heading(0.0)),
        scale=vector(0.0, 0.0, 0.0),
        color=ros.std_msgs__msg__ColorRGBA(*colour),
        lifetime=ros.builtin_interfaces__msg__Duration(_LASTS, 0),
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=ros.sensor_msgs__msg__CompressedImage(header(time, ""), "", empty),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=ros.visualization_msgs__msg__MeshFile("", empty),
        mesh_use_embedded_materials=False,
    )
