"""Robots as viewers see them: scenes, frames, a layout, and the same live."""

import json
import signal
import struct
import subprocess
from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import cos, pi, radians
from pathlib import Path
from typing import Any

import pytest
from controller_helpers import PATIENCE, a_decision, a_frame, free_endpoint, publishing
from drives import MACOR_HIL
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from khepera_protocol.zenoh.controller_payloads import Odometry
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR
from khepera_protocol.zenoh.payloads import Outline, Pose, Wire, WireEntry
from typer.testing import CliRunner
from watching_helpers import BEGIN, a_life, json_event, picture_event, truth
from websockets.sync.client import ClientConnection, connect

from macor_hil.cli.program import app
from macor_hil.hardware.robots.khepera.form import KHEPERA
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Event, Presence
from macor_hil.telemetry.viewers.frames import HERE, Whereabouts, arc, seen_from, turned_round
from macor_hil.telemetry.viewers.layout import layout
from macor_hil.telemetry.viewers.topics import Told, Topics
from macor_hil.telemetry.viewers.wire_lines import WireLines

A = Pose(x=1.0, y=2.0, heading=pi / 2)
B = Pose(x=0.5, y=0.1, heading=-0.3)


def place(pose: Pose) -> Any:
    return pytest.approx((pose.x, pose.y, pose.heading))


def numbers(pose: Pose) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.heading


def test_frames_are_turned_and_put_together() -> None:
    assert numbers(seen_from(A, B)) == place(Pose(x=0.9, y=2.5, heading=pi / 2 - 0.3))
    assert numbers(seen_from(A, turned_round(A))) == place(HERE)
    assert numbers(seen_from(turned_round(B), B)) == place(HERE)
    assert numbers(arc(0.0, 0.021)) == (0.021, 0.0, 0.0)
    half = arc(pi, pi * 0.1)  # half a circle of 10 cm
    assert numbers(half) == place(Pose(x=0.0, y=0.2, heading=pi))


def at(x: float, heading: float = 0.0) -> Odometry:
    return Odometry(pose=Pose(x=x, y=0.0, heading=heading), counters=(0, 0))


def test_a_plan_begins_where_the_robot_decided() -> None:
    where = Whereabouts()
    where.decide(a_decision(0, odometry=at(0.021)))
    assert numbers(where.start) == place(HERE)
    where.decide(a_decision(1, odometry=at(0.040)))
    assert numbers(where.start) == place(at(0.021).pose)
    where.decide(a_decision(5, odometry=at(0.200)))  # some were missed
    assert numbers(where.start) == place(at(0.179).pose)
    way = where.way(a_decision().hypotheses[0].ahead)
    assert [pose.x for pose in way][:2] == pytest.approx([0.179, 0.200])
    assert len(way) == 3


def test_what_odometry_lacks_moves_its_frame_and_not_the_robot() -> None:
    where = Whereabouts()
    where.truth = A
    where.decide(a_decision(0, odometry=at(0.5, 0.2)))
    assert numbers(seen_from(where.origin, where.odometry)) == place(A)


@pytest.mark.parametrize(
    ("reading", "metres"),
    [(0, None), (2, None), (3, 0.043), (449, 0.025), (1023, 0.015), (2000, 0.015)],
)
def test_a_reading_is_a_distance(reading: int, metres: float | None) -> None:
    assert KHEPERA.distance(reading) == metres


def test_readings_and_distances_are_in_one_order() -> None:
    seen = [KHEPERA.distance(reading) or 1.0 for reading in range(1024)]
    assert all(a >= b for a, b in pairwise(seen))


def test_pieces_on_the_line_are_put_together_each_way_on_its_own() -> None:
    pieces = [("request", "N"), ("reply", "h,1"), ("request", "\nH\nD,"), ("fault", "drop")]
    pieces += [("reply", ",2\r\n"), ("request", "0,0\n"), ("reply", "x" * 10_000)]
    entries = [WireEntry(time=0.0, what=what, text=text[:4000]) for what, text in pieces]
    said = [(each.what, each.text) for each in WireLines().take(Wire(first=0, entries=entries))]
    assert said == [
        ("request", "N"),
        ("request", "H"),
        ("fault", "drop"),
        ("reply", "h,1,2"),
        ("request", "D,0,0"),
    ]


def told(events: Iterable[Event]) -> dict[str, list[Told]]:
    topics = Topics("khepera")
    found: dict[str, list[Told]] = {}
    for event in events:
        for each in topics.tell(event):
            found.setdefault(each.topic, []).append(each)
    return found


def scene(each: Told) -> Any:
    return SceneUpdate.FromString(each.data).entities[0]


def test_a_robot_is_drawn_with_arena_rays_plan_and_way() -> None:
    found = told(a_life(3))
    arena = scene(found["foxglove/khepera/arena"][0])
    outline = EXAMPLES[Outline]
    assert isinstance(outline, Outline)
    assert len(arena.triangles) == len(outline.solids)
    assert len(arena.triangles[0].points) == 3 * (3 * 2 + 1)
    rays = scene(found["foxglove/khepera/infrared"][0])
    assert (rays.frame_id, len(rays.lines)) == ("robot", 8)
    lengths = [line.points[1].x ** 2 + line.points[1].y ** 2 for line in rays.lines]
    assert min(lengths) == lengths[2]  # 1023: something is before it
    plan = scene(found["foxglove/khepera/plan"][1])
    assert [len(line.points) for line in plan.lines] == [2, 3]
    assert plan.texts[0].text == "1: straight 4.25"
    way = scene(found["foxglove/khepera/way"][-1])
    assert (way.frame_id, len(way.lines[0].points)) == ("arena", 4)
    assert scene(found["foxglove/khepera/robot"][0]).frame_locked


def test_without_an_emulator_the_robot_is_drawn_in_the_frame_of_its_odometry() -> None:
    decisions = [a_decision(k, odometry=at(0.021 * (k + 1))) for k in range(2)]
    events = [json_event(CONTROLLER, "decision", each, 1.0 + each.sequence) for each in decisions]
    found = told([Presence(CONTROLLER, True, BEGIN), *events])
    frames = [FrameTransform.FromString(each.data) for each in found["foxglove/khepera/transform"]]
    assert {(each.parent_frame_id, each.child_frame_id) for each in frames} == {
        ("odometry", "robot")
    }
    assert scene(found["foxglove/khepera/way"][-1]).frame_id == "odometry"


ASKED = Wire(
    first=0,
    entries=[
        WireEntry(time=1.0, what="request", text="H\nN\nH\n"),
        WireEntry(time=1.1, what="reply", text="h,0,0\r\nn,0,0,1,0,0,0,0,0\r\nh,100,100\r\n"),
        WireEntry(time=1.2, what="request", text="N\n"),
        WireEntry(time=1.3, what="reply", text="n,0,0,449,0,0,0,0,0\r\n"),
    ],
)


def test_without_a_controller_the_line_tells_rays_and_odometry() -> None:
    found = told(
        [
            json_event(EMULATOR, "truth", truth(1.0, 0.1), 1.0),
            json_event(EMULATOR, "wire", ASKED, 1.4),
        ]
    )
    (rays,) = map(scene, found["foxglove/khepera/infrared"])  # the latest ones
    assert rays.lines[2].points[1].x == pytest.approx((0.0275 + 0.025) * cos(radians(10)))
    (way,) = map(PoseInFrame.FromString, [each.data for each in found["foxglove/khepera/odometry"]])
    assert (way.frame_id, way.pose.position.x) == ("odometry", pytest.approx(0.008))


def test_beside_a_controller_the_line_tells_nothing_but_itself() -> None:
    found = told([Presence(CONTROLLER, True, BEGIN), json_event(EMULATOR, "wire", ASKED, 1.0)])
    assert {topic for topic in found if topic.startswith("foxglove")} == {"foxglove/khepera/wire"}


def test_a_robot_has_its_place_before_anybody_drives_it() -> None:
    found = told([json_event(EMULATOR, "truth", truth(1.0, 0.1), 1.0)])
    frames = [FrameTransform.FromString(each.data) for each in found["foxglove/khepera/transform"]]
    assert [(each.parent_frame_id, each.child_frame_id) for each in frames] == [
        ("arena", "odometry"),
        ("odometry", "robot"),
    ]


def test_all_topics_are_known_before_their_messages() -> None:
    events = [*a_life(2), json_event(EMULATOR, "wire", ASKED, 9.0)]
    events.append(picture_event(9.1, side=EMULATOR, leaf="camera"))
    forms = dict(Topics("khepera").all())
    assert {topic: messages[0].form for topic, messages in told(events).items()} == forms


def test_where_the_robot_is_put_a_new_way_begins() -> None:
    places = [0.1, 0.12, 0.14, 0.9]
    events = [json_event(EMULATOR, "truth", truth(1.0, x), 1.0 + k) for k, x in enumerate(places)]
    ways = [scene(each).lines[0].points for each in told(events)["foxglove/khepera/way"]]
    assert [len(points) for points in ways] == [1, 2, 3, 1]


def panels(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    else:
        yield from panels(node["first"])
        yield from panels(node["second"])


def paths(node: Any) -> Iterator[str]:
    """Topics that a layout names, with what follows them."""
    for name, value in node.items() if isinstance(node, dict) else enumerate(node):
        if isinstance(value, dict | list):
            yield from paths(value)
        for text in (name, value):
            if isinstance(text, str) and text.startswith(("macor/", "khepera/", "foxglove/")):
                yield text


def test_the_layout_shows_topics_that_there_are() -> None:
    made = layout("khepera")
    assert set(panels(made["layout"])) == set(made["configById"])
    topics = told(a_life(1))
    named = {path.partition(".")[0] for path in paths(made["configById"])}
    assert named <= set(topics)
    fields = json.loads(topics["macor/khepera/decision"][0].form.schema)["properties"]
    for path in paths(made["configById"]):
        topic, _, rest = path.partition(".")
        if topic.endswith("decision") and rest:
            assert rest.partition(".")[0].partition("[")[0] in fields


def test_a_layout_is_written_for_one_robot(tmp_path: Path) -> None:
    file = tmp_path / "layout.json"
    done = CliRunner().invoke(app, ["foxglove", "--layout", str(file), "--robot", "khepera-2"])
    assert done.exit_code == 0
    assert json.loads(file.read_text()) == layout("khepera-2")


class Viewer:
    """A client of Foxglove's WebSocket protocol, without its library."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.channels: dict[str, dict[str, Any]] = {}

    def advertised(self, *topics: str) -> None:
        """Wait until topics are there."""
        while not set(topics) <= set(self.channels):
            said = self._socket.recv(PATIENCE)
            assert isinstance(said, str)
            for channel in json.loads(said).get("channels", []):
                self.channels[channel["topic"]] = channel

    def subscribe(self, *topics: str) -> None:
        wanted = [
            {"id": number, "channelId": self.channels[topic]["id"]}
            for number, topic in enumerate(topics)
        ]
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def message(self) -> tuple[int, int, bytes]:
        """The next message: its subscription, its time in ns, and its payload."""
        while isinstance(data := self._socket.recv(PATIENCE), str):
            pass
        opcode, number, when = struct.unpack_from("<BIQ", data)
        assert opcode == 1
        return number, when, data[13:]


def test_the_same_is_shown_live() -> None:
    pytest.importorskip("foxglove")
    endpoint = free_endpoint()
    command = [*MACOR_HIL, "foxglove", "--port", "0", "--connect", endpoint]
    with (
        publishing(endpoint) as (_, publisher),
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("ws://127.0.0.1:")
        with connect(address, subprotocols=["foxglove.sdk.v1"]) as socket:  # type: ignore[list-item]
            viewer = Viewer(socket)
            # all topics are there at once, so that no first message is missed
            viewer.advertised("macor/khepera/alive", "macor/khepera/decision")
            decision = viewer.channels["macor/khepera/decision"]
            assert decision["schemaName"] == "macor.Decision"
            assert json.loads(decision["schema"])["type"] == "object"
            # what lasts is told to who comes later; decisions are not
            viewer.subscribe("macor/khepera/alive", "macor/khepera/decision")
            number, first, data = viewer.message()
            assert (number, json.loads(data)) == (0, {"alive": True})
            publisher.frame(a_frame())
            publisher.decision(a_decision(0))
            number, second, data = viewer.message()
            assert (number, json.loads(data)["sequence"]) == (1, 0)
            assert second >= first
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0


def test_a_port_that_is_taken_is_named(tmp_path: Path) -> None:
    pytest.importorskip("foxglove")
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        done = subprocess.run(
            [*MACOR_HIL, "foxglove", "--port", port, "--connect", free_endpoint()],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
    assert done.returncode == 2
    assert f"cannot listen on 127.0.0.1:{port}: " in done.stderr


def test_poses_at_the_bounds_of_payloads_are_seen_from_each_other() -> None:
    far = Pose(x=-1e9, y=-1e9, heading=-1e9)
    where = Whereabouts()
    where.truth = where.odometry = far
    assert where.origin.x == pytest.approx(0.0, abs=1.0)
    assert abs(seen_from(far, far).y) <= 3e9
