"""ROS 2 topics over Zenoh: names against rmw_zenoh's own examples, CDR through another decoder."""

import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from math import cos, pi, sin
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
from as_type import not_none
from controller_helpers import (
    PATIENCE,
    a_decision,
    a_frame,
    free_endpoint,
    publishing,
    receive,
    wait_until_watched,
    watching,
)
from khepera_protocol.zenoh.controller_payloads import Odometry
from khepera_protocol.zenoh.keys import DECISION, FRAME
from khepera_protocol.zenoh.payloads import Pose
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from macor_hil.errors import TelemetryError
from macor_hil.telemetry.ros2 import messages
from macor_hil.telemetry.ros2.bridge import Bridge
from macor_hil.telemetry.ros2.rmw_zenoh import Node, Topic, attachment, gid, namespace_of

# what the ROS 2 project publishes of its own demonstration nodes
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = Topic("/chatter", "std_msgs/msg/String", STRING_HASH)
TALKER = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
)

# the interfaces' definitions as ROS 2 prints them (ros2 interface show), for the other decoder
_HEADER = """
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_TWIST = """
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
DEFINITIONS = {
    "sensor_msgs/msg/CompressedImage": f"""std_msgs/Header header
string format
uint8[] data
==={_HEADER}""",
    "geometry_msgs/msg/TwistStamped": f"""std_msgs/Header header
geometry_msgs/Twist twist
==={_HEADER}==={_TWIST}""",
    "nav_msgs/msg/Odometry": f"""std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
==={_HEADER}==={_TWIST}===
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
===
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
===
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
===
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
""",
}

NOW = 1_700_000_000_123_456_789


def decode(kind: str, data: bytes) -> Any:
    text = DEFINITIONS[kind].replace("===", 80 * "=")
    schema = Schema(1, text.encode(), "ros2msg", kind)
    return not_none(DecoderFactory().decoder_for("cdr", schema))(data)


def at(x: float, y: float, heading: float) -> Odometry:
    return Odometry(pose=Pose(x=x, y=y, heading=heading), counters=(0, 0))


def test_a_topic_is_the_key_that_ros_2_gives_it() -> None:
    assert CHATTER.key(0) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert (
        Topic("/robot1/chatter", CHATTER.kind, STRING_HASH).key(7).startswith("7/robot1/chatter/")
    )


def test_tokens_are_those_of_ros_2_nodes() -> None:
    node = Node(2, "8b20917502ee955ac4476e0266340d5c", "/", "talker")
    assert node.token() == "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/0/NN/%/%/talker"
    assert node.publisher_token(10, CHATTER, depth=7) == TALKER


@pytest.mark.parametrize(
    ("topic", "kind", "kind_hash"),
    [
        # hashes as systems that run ROS 2 Jazzy show them
        (
            messages.odometry_topic,
            "nav_msgs/msg/Odometry",
            "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
        ),
        (
            messages.command_topic,
            "geometry_msgs/msg/TwistStamped",
            "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
        ),
        (
            messages.image_topic,
            "sensor_msgs/msg/CompressedImage",
            "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
        ),
    ],
)
def test_types_have_the_hashes_of_ros_2(
    topic: Callable[[str], Topic], kind: str, kind_hash: str
) -> None:
    made = topic("/khepera")
    assert made.kind == kind
    assert made.kind_hash == f"RIHS01_{kind_hash}"


def test_an_attachment_is_number_time_and_gid() -> None:
    data = attachment(3, NOW, bytes(range(16)))
    assert len(data) == 33
    assert data == struct.pack("<qq", 3, NOW) + b"\x10" + bytes(range(16))


def test_a_gid_is_the_hash_of_the_token() -> None:
    # XXH3, 128 bits, of the empty text: 99aa06d3014798d86001c324468d497f, the low half first
    assert gid("") == bytes.fromhex("7f498d4624c30160d8984701d306aa99")
    assert gid(TALKER) != gid(TALKER.replace("10", "11"))


@pytest.mark.parametrize(
    ("robot", "namespace"),
    [("khepera", "/khepera"), ("khepera-2.a", "/khepera_2_a"), ("7of9", "/robot_7of9")],
)
def test_any_robot_has_a_namespace(robot: str, namespace: str) -> None:
    assert namespace_of(robot) == namespace
    assert messages.image_topic(namespace).name == f"{namespace}/image/compressed"


@pytest.mark.parametrize("name", ["chatter", "/", "/a b", "/a//b", "/1st"])
def test_names_that_ros_refuses_are_refused(name: str) -> None:
    with pytest.raises(TelemetryError, match="ROS topic"):
        Topic(name, CHATTER.kind, STRING_HASH)


def test_a_picture_passes_through_as_it_is() -> None:
    message = decode("sensor_msgs/msg/CompressedImage", messages.image(b"\xff\xd8jpeg", NOW))
    assert message.format == "jpeg"
    assert bytes(message.data) == b"\xff\xd8jpeg"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(NOW, 10**9)


def test_odometry_is_the_pose_and_the_mean_speed() -> None:
    before = a_decision(3, odometry=at(1.0, 2.0, pi / 2))
    after = a_decision(4, odometry=at(1.0, 2.1, pi / 2 + 0.2), time=before.time + 0.5)
    message = decode("nav_msgs/msg/Odometry", messages.odometry(after, before, NOW))
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    pose = message.pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, 2.1, 0.0)
    half = (pi / 2 + 0.2) / 2
    assert (pose.orientation.z, pose.orientation.w) == (sin(half), cos(half))
    twist = message.twist.twist
    assert twist.linear.x == pytest.approx(0.2 * cos(0.1))
    assert twist.angular.z == pytest.approx(0.4)


def test_a_first_decision_has_no_speed() -> None:
    last_run = a_decision(7)
    for before in (None, last_run):
        cdr = messages.odometry(a_decision(0), before, NOW)
        assert decode("nav_msgs/msg/Odometry", cdr).twist.twist.linear.x == 0.0


@pytest.mark.parametrize(("name", "turn"), [("left", 12), ("right", -12), ("straight", 0)])
def test_a_command_is_its_arc(name: str, turn: int) -> None:
    cdr = messages.command(a_decision(command=name), NOW)
    twist = decode("geometry_msgs/msg/TwistStamped", cdr).twist
    # the faster wheel turns at 20 counts of 0.08 mm / 10 ms
    wheels = [twist.linear.x + side * twist.angular.z * 0.053 / 2 for side in (1, -1)]
    assert max(wheels) == pytest.approx(0.16, rel=0.01)
    assert twist.angular.z / twist.linear.x == pytest.approx(turn / 180 * pi / 0.021)


def test_an_unknown_command_is_named() -> None:
    with pytest.raises(TelemetryError, match="'back'"):
        messages.command(a_decision(command="back"), NOW)


def test_what_a_controller_tells_arrives_as_ros_2_topics() -> None:
    endpoint = free_endpoint()
    hears = "5/khepera/**"
    with (
        publishing(endpoint) as (session, publisher),
        watching(endpoint, hears) as (listener, topics),
        Bridge(session, "khepera", 5) as bridge,
    ):
        wait_until_watched(session, hears)
        publisher.frame(a_frame())
        publisher.decision(a_decision(0, command="left"))
        publisher.decision(a_decision(1))
        for _ in range(3):
            bridge.forward(PATIENCE)
        samples = [receive(topics) for _ in range(5)]
        tokens = [
            str(not_none(reply.ok).key_expr) for reply in listener.liveliness().get("@ros2_lv/**")
        ]
    got: dict[str, list[tuple[Any, bytes]]] = {}
    for sample in samples:
        _, name, dds_kind, _ = str(sample.key_expr).rsplit("/", 3)[-4:]
        kind = dds_kind.replace("::", "/").replace("dds_/", "").rstrip("_")
        message = decode(kind, sample.payload.to_bytes())
        got.setdefault(name, []).append((message, not_none(sample.attachment).to_bytes()))
    assert {name: len(each) for name, each in got.items()} == {
        "compressed": 1,
        "cmd_vel": 2,
        "odom": 2,
    }
    assert got["compressed"][0][0].data[:2] == b"\xff\xd8"
    assert got["cmd_vel"][0][0].twist.angular.z > 0 == got["cmd_vel"][1][0].twist.angular.z
    assert abs(got["odom"][0][0].header.stamp.sec - time.time()) < PATIENCE
    numbers = [struct.unpack("<q", mark[:8])[0] for _, mark in got["odom"]]
    assert numbers == [1, 2]
    (odometry_token,) = (token for token in tokens if "Odometry_" in token)
    assert {mark[17:] for _, mark in got["odom"]} == {gid(odometry_token)}
    kinds = sorted(token.split("/")[5] for token in tokens)
    assert kinds == ["MP", "MP", "MP", "NN"]
    assert all(token.startswith(f"@ros2_lv/5/{session.zid()}/0/") for token in tokens)


def test_what_cannot_be_read_is_dropped(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = free_endpoint()
    with publishing(endpoint) as (session, publisher), Bridge(session, "khepera") as bridge:
        got: SimpleQueue[zenoh.Sample] = SimpleQueue()
        session.declare_subscriber("0/khepera/odom/**", got.put)
        session.put(DECISION.of("khepera"), "{}")
        publisher.decision(a_decision())
        bridge.forward(PATIENCE)
        assert "1 refused; the last one of decision: " in caplog.text
        assert got.empty()
        bridge.forward(PATIENCE)
        assert receive(got)
        # of frames and of decisions; said again when the count has doubled
        session.put("macor/**", "{}")
        bridge.forward(PATIENCE)
        bridge.forward(PATIENCE)
        assert "2 refused; the last one of " in caplog.text
        assert "it came for macor/**, not for one key" in caplog.text


@pytest.mark.parametrize("domain", [-1, 233])
def test_domains_that_ros_has_not_are_refused(domain: int) -> None:
    with (
        publishing(free_endpoint()) as (session, _),
        pytest.raises(TelemetryError, match="domain"),
    ):
        Bridge(session, "khepera", domain)


def test_the_bridge_is_a_process_that_a_signal_ends() -> None:
    endpoint = free_endpoint()
    command = [
        sys.executable,
        "-m",
        "macor_hil.cli",
        "ros2",
        "--connect",
        endpoint,
        "--domain",
        "3",
    ]
    with publishing(endpoint) as (session, publisher):
        arrived = threading.Event()
        session.declare_subscriber("3/khepera/image/**", lambda _: arrived.set())
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            try:
                wait_until_watched(session, FRAME.of("khepera"))
                publisher.frame(a_frame())
                assert arrived.wait(PATIENCE)
                process.send_signal(signal.SIGTERM)
                _, said = process.communicate(timeout=PATIENCE)
            finally:
                process.kill()
    assert (process.returncode, said) == (0, "macor-hil: ended by SIGTERM\n")


def test_nodes_find_the_bridge_as_they_come() -> None:
    """A session as rmw_zenoh configures it: connects to the well-known peer, listens, gossips."""
    endpoint = free_endpoint()
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    config.insert_json5("listen/endpoints", '["tcp/localhost:0"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with (
        publishing(endpoint) as (session, _),
        Bridge(session, "khepera"),
        zenoh.open(config) as ros,
    ):
        found = threading.Event()
        ros.liveliness().declare_subscriber("@ros2_lv/**", lambda _: found.set(), history=True)
        assert found.wait(PATIENCE)
