"""ROS 2 topics over Zenoh: names against rmw_zenoh's own examples, CDR through another decoder."""

import signal
import struct
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from math import cos, degrees, inf, isnan, pi, sin
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
from as_type import as_type, not_none
from controller_helpers import (
    PATIENCE,
    a_decision,
    a_frame,
    a_state,
    free_endpoint,
    publishing,
    wait_until_watched,
    watching,
)
from khepera_protocol.serial.units import battery_volts
from khepera_protocol.zenoh.controller_payloads import Link, Odometry, Phase
from khepera_protocol.zenoh.keys import CONTROLLER, DECISION, EMULATOR, FRAME
from khepera_protocol.zenoh.payloads import Outline, Pose, Wire, WireEntry
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from watching_helpers import BEGIN, a_life, json_event, picture_event, truth

from macor_hil.errors import TelemetryError
from macor_hil.hardware.robots.khepera.form import KHEPERA
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Event, Presence
from macor_hil.telemetry.ros2 import messages, moving, sensing, telling, topics
from macor_hil.telemetry.ros2.bridge import Bridge
from macor_hil.telemetry.ros2.messages import Frames, cdr
from macor_hil.telemetry.ros2.rmw_zenoh import Node, Topic, attachment, gid, namespace_of

# what the ROS 2 project publishes of its own demonstration nodes
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
CHATTER = Topic("/chatter", "std_msgs/msg/String", STRING_HASH)
TALKER = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
)

# the interfaces' definitions as the ROS 2 project publishes them, for the other decoder
DEFINITIONS = {
    name: text.strip()
    for name, _, text in (
        part.partition("\n")
        for part in (Path(__file__).parent / "ros2_definitions.txt").read_text().split("MSG: ")[1:]
    )
}

NOW = 1_700_000_000_123_456_789


def definition(kind: str) -> str:
    """The definition of an interface, with those of all parts after it, as in recordings."""
    rest = [f"MSG: {name}\n{text}" for name, text in DEFINITIONS.items() if name != kind]
    return f"\n{80 * '='}\n".join([DEFINITIONS[kind], *rest])


@cache
def decoder(kind: str) -> Callable[[bytes], Any]:
    schema = Schema(1, definition(kind).encode(), "ros2msg", kind)
    return not_none(DecoderFactory().decoder_for("cdr", schema))


def decode(message: Any) -> Any:
    """A message of ours as another library reads it."""
    return decoder(message.__msgtype__.replace("/msg/", "/"))(cdr(message))


def times(message: Any) -> tuple[int, int]:
    return message.header.stamp.sec, message.header.stamp.nanosec


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


HASHES = {
    # as systems that run ROS 2 Jazzy show them
    topics.ODOMETRY: "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    topics.COMMAND: "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    topics.IMAGE: "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
}


@pytest.mark.parametrize("name", HASHES)
def test_types_have_the_hashes_of_ros_2(name: str) -> None:
    assert topics.topic(name, "/khepera").kind_hash == f"RIHS01_{HASHES[name]}"


def test_types_are_those_that_ros_2_publishes() -> None:
    published = get_typestore(Stores.EMPTY)
    for name, text in DEFINITIONS.items():
        published.register(get_types_from_msg(text, name.replace("/", "/msg/")))
    for kind in {message.__msgtype__ for message in topics.KINDS.values()}:
        assert published.hash_rihs01(kind) == messages.types().hash_rihs01(kind)


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
    assert topics.topic(topics.IMAGE, namespace).name == f"{namespace}/image/compressed"
    assert topics.topic(topics.TRANSFORMS, namespace).name == "/tf"


@pytest.mark.parametrize("name", ["chatter", "/", "/a b", "/a//b", "/1st"])
def test_names_that_ros_refuses_are_refused(name: str) -> None:
    with pytest.raises(TelemetryError, match="ROS topic"):
        Topic(name, CHATTER.kind, STRING_HASH)


FRAMES = Frames("a/")


def test_a_picture_passes_through_as_it_is() -> None:
    message = decode(sensing.image(b"\xff\xd8jpeg", "jpeg", NOW, FRAMES))
    assert message.format == "jpeg"
    assert bytes(message.data) == b"\xff\xd8jpeg"
    assert times(message) == divmod(NOW, 10**9)
    assert message.header.frame_id == "a/camera"


def test_odometry_is_the_pose_and_the_mean_speed() -> None:
    before, after = at(1.0, 2.0, pi / 2).pose, at(1.0, 2.1, pi / 2 + 0.2).pose
    message = decode(moving.odometry((1.5, after), (1.0, before), NOW, FRAMES))
    assert (message.header.frame_id, message.child_frame_id) == ("a/odom", "a/base_link")
    pose = message.pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, 2.1, 0.0)
    half = (pi / 2 + 0.2) / 2
    assert (pose.orientation.z, pose.orientation.w) == (sin(half), cos(half))
    twist = message.twist.twist
    assert twist.linear.x == pytest.approx(0.2 * cos(0.1))
    assert twist.angular.z == pytest.approx(0.4)
    first = decode(moving.odometry((1.5, after), None, NOW, FRAMES))
    assert first.twist.twist.linear.x == 0.0


@pytest.mark.parametrize(("name", "turn"), [("left", 12), ("right", -12), ("straight", 0)])
def test_a_command_is_its_arc(name: str, turn: int) -> None:
    twist = decode(moving.command(a_decision(command=name), NOW, FRAMES)).twist
    # the faster wheel turns at 20 counts of 0.08 mm / 10 ms
    wheels = [twist.linear.x + side * twist.angular.z * 0.053 / 2 for side in (1, -1)]
    assert max(wheels) == pytest.approx(0.16, rel=0.01)
    assert twist.angular.z / twist.linear.x == pytest.approx(turn / 180 * pi / 0.021)


def test_an_unknown_command_is_named() -> None:
    with pytest.raises(TelemetryError, match="'back'"):
        moving.command(a_decision(command="back"), NOW, FRAMES)


def test_infrared_sensors_are_ranges_and_a_scan() -> None:
    readings = (0, 12, 1023, 449, 0, 0, 0, 55)
    ranges = [decode(each) for each in sensing.ranges(readings, KHEPERA, NOW, FRAMES)]
    assert [each.header.frame_id for each in ranges] == [f"a/ir{k}" for k in range(8)]
    seen = [inf, 0.041, 0.015, 0.025, inf, inf, inf, 0.035]
    assert [each.range for each in ranges] == pytest.approx(seen)
    assert {each.radiation_type for each in ranges} == {1}
    scan = decode(sensing.scan(readings, KHEPERA, KHEPERA.radius, NOW, FRAMES))
    beams = {
        round(degrees(scan.angle_min + k * scan.angle_increment)): reach - 0.0275
        for k, reach in enumerate(scan.ranges)
    }
    bearings = (90, 45, 10, -10, -45, -90, -170, 170)
    assert [beams[bearing] for bearing in bearings] == pytest.approx(seen)
    assert beams[0] == pytest.approx(0.015)  # two look there: the nearer one counts
    assert isnan(beams[135])


def test_a_battery_is_its_voltage() -> None:
    message = decode(sensing.battery(battery_volts(600), KHEPERA, NOW, FRAMES))
    assert message.voltage == pytest.approx(4.8)
    assert isnan(message.percentage)


def test_a_mirror_has_no_pinhole() -> None:
    message = decode(sensing.camera_info(160, 120, NOW, FRAMES))
    assert (message.width, message.height, message.k[0]) == (160, 120, 0.0)


def test_the_tree_of_frames_leads_from_the_arena_to_each_sensor() -> None:
    origin, odometer = at(1.0, 0.0, pi / 2).pose, at(0.5, 0.0, 0.0).pose
    tree = decode(
        moving.transforms(origin, odometer, KHEPERA, KHEPERA.radius, NOW, FRAMES)
    ).transforms
    parents = {each.child_frame_id: each.header.frame_id for each in tree}
    assert parents["a/odom"] == "map"
    assert parents["a/base_link"] == "a/odom"
    assert all(parents[f"a/ir{k}"] == "a/base_link" for k in range(8))
    left = next(each for each in tree if each.child_frame_id == "a/ir0").transform
    assert left.translation.y == pytest.approx(0.0275)
    assert left.rotation.z == pytest.approx(sin(pi / 4))


def test_a_decision_is_drawn_with_what_was_weighed() -> None:
    ways = [[at(0.0, 0.0, 0.0).pose, at(0.1, 0.0, 0.0).pose], [at(0.0, 0.0, 0.0).pose]]
    drawn = decode(telling.decision_markers(a_decision(3, collided=True), ways, NOW, FRAMES))
    clear, line, words = drawn.markers  # a way of a single point is none
    assert (clear.action, line.type, words.type) == (3, 4, 9)
    assert [(place.x, place.y) for place in line.points] == [(0.0, 0.0), (0.1, 0.0)]
    assert words.text == "3: straight COLLISION"


def test_walls_are_prisms() -> None:
    drawn = decode(telling.arena_markers(as_type(Outline, EXAMPLES[Outline]), NOW, FRAMES))
    (wall,) = drawn.markers
    assert (wall.header.frame_id, wall.type) == ("map", 11)
    assert len(wall.points) == 3 * (3 * 2 + 1)  # a triangle's three sides and its top


def test_diagnostics_say_how_controller_line_and_bridge_do() -> None:
    link = as_type(Link, EXAMPLES[Link]).model_copy(update={"failures": 2})
    state = a_state(Phase.FAILED, reason="no reply")
    told = decode(telling.diagnostics("khepera", state, link, "3 lost", NOW))
    assert [(each.name, each.level, each.message) for each in told.status] == [
        ("khepera: controller", 2, "failed: no reply"),
        ("khepera: serial line", 1, "2 of 242 requests failed"),
        ("khepera: bridge", 1, "3 lost"),
    ]
    alone = decode(telling.diagnostics("khepera", None, None, "", NOW))
    assert [each.level for each in alone.status] == [3, 0]


def told_of(events: Iterable[Event]) -> dict[str, list[Any]]:
    """All messages of events, as another library reads them, by their topics."""
    made = topics.RosTopics("khepera")
    told: dict[str, list[Any]] = {}
    for event in events:
        for name, message in made.tell(event, event.received):
            told.setdefault(name, []).append(decode(message))
    return told


def test_a_run_is_told_on_every_topic() -> None:
    told = told_of(a_life(3))
    assert set(topics.KINDS) - set(told) == {topics.BATTERY}
    for name in (topics.IMAGE, topics.CAMERA_INFO, topics.COMMAND, topics.PLAN, *topics.RANGES):
        assert len(told[name]) == 3
    assert len(told[topics.ODOMETRY]) == 1 + 3  # the line told of the wheels before it
    size = told[topics.CAMERA_INFO][0]
    assert (size.width, size.height) == (160, 160)
    # the first of a run begins a command before it, each other one where the last one ended
    plan = told[topics.PLAN][2].poses
    last = told[topics.ODOMETRY][-2].pose.pose.position
    assert (plan[0].pose.position.x, plan[0].pose.position.y) == (last.x, last.y)
    assert len(plan) == 3
    newest = {each.child_frame_id: each for each in told[topics.TRANSFORMS][-1].transforms}
    assert newest["base_link"].transform.translation.x == pytest.approx(0.021)


def a_wire(*lines: str) -> Wire:
    """A part of the line, in pieces as it is told: two characters each."""
    entries = []
    for line in lines:
        what, text = ("request", f"{line}\n") if line[0].isupper() else ("reply", f"{line}\r\n")
        pieces = [text[k : k + 2] for k in range(0, len(text), 2)]
        entries += [WireEntry(time=1.0, what=what, text=piece) for piece in pieces]
    return Wire(first=0, entries=entries)


ASKED = a_wire(
    *("H", "h,0,0", "N", "n,0,0,449,0,0,0,0,0", "I,0", "i,600", "I,1", "i,7", "H", "h,100,100"),
    *("N", "n,1,2", "H", "z,Protocol error", "h,5,x"),
)


def test_an_emulator_alone_is_told_by_what_passes_on_its_line() -> None:
    told = told_of(
        [
            Presence(EMULATOR, True, BEGIN),
            picture_event(0.1, side=EMULATOR, leaf="camera"),
            json_event(EMULATOR, "truth", truth(0.2, 0.1), 0.2),
            json_event(EMULATOR, "wire", ASKED, 0.3),
        ]
    )
    assert len(told[topics.IMAGE]) == 1
    assert told[topics.RANGES[2]][0].range == pytest.approx(0.025)
    assert [each.voltage for each in told[topics.BATTERY]] == pytest.approx([4.8])
    assert told[topics.ODOMETRY][-1].pose.pose.position.x == pytest.approx(0.008)
    assert topics.COMMAND not in told
    # in the arena the robot is where the truth says
    origin, body = told[topics.TRANSFORMS][-1].transforms[:2]
    sum_of_both = origin.transform.translation.x + body.transform.translation.x
    assert sum_of_both == pytest.approx(0.1)


def test_a_speed_is_that_between_two_replies_however_many_come_at_once() -> None:
    said = [
        ("request", "H\n"),
        ("reply", "h,0,0\r\n"),
        ("request", "H\n"),
        ("reply", "h,10,10\r\n"),
    ]
    said += [("request", "H\n"), ("reply", "h,30,30\r\n")]
    entries = [WireEntry(time=1 + 0.01 * k, what=w, text=t) for k, (w, t) in enumerate(said)]
    told = told_of([json_event(EMULATOR, "wire", Wire(first=0, entries=entries), 0.3)])
    speeds = [each.twist.twist.linear.x for each in told[topics.ODOMETRY]]
    assert speeds == pytest.approx([0.0, 0.04, 0.08])


@pytest.mark.parametrize("reset", [("G,0,0", "g"), ("restart", "ROM of minirobot KHEPERA, 5.01")])
def test_counters_that_are_set_do_not_move_the_robot(reset: tuple[str, str]) -> None:
    asked, said = reset
    entries = [("request", "H\n"), ("reply", "h,500,500\r\n"), ("request", f"{asked}\n")]
    entries += [("reply", f"{said}\r\n"), ("request", "H\n"), ("reply", "h,0,0\r\n")]
    entries += [("request", "H\n"), ("reply", "h,100,100\r\n")]
    wire = [WireEntry(time=k, what=what, text=text) for k, (what, text) in enumerate(entries)]
    told = told_of([json_event(EMULATOR, "wire", Wire(first=0, entries=wire), 0.3)])
    where = [each.pose.pose.position.x for each in told[topics.ODOMETRY]]
    assert where == pytest.approx([0.0, 0.0, 0.008])


def test_beside_a_controller_the_line_tells_the_battery_alone() -> None:
    told = told_of([Presence(CONTROLLER, True, BEGIN), json_event(EMULATOR, "wire", ASKED, 0.3)])
    assert set(told) == {topics.DIAGNOSTICS, topics.BATTERY}


def forwarded(bridge: Bridge, enough: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not enough():
        assert time.monotonic() < end
        bridge.forward(0.1)


def test_what_a_controller_tells_arrives_as_ros_2_topics() -> None:
    endpoint = free_endpoint()
    hears = "5/khepera/**"
    with (
        publishing(endpoint) as (session, publisher),
        watching(endpoint, hears) as (listener, samples),
        Bridge(session, "khepera", 5) as bridge,
    ):
        wait_until_watched(session, hears, FRAME.of("khepera"), DECISION.of("khepera"))
        publisher.frame(a_frame())
        publisher.decision(a_decision(0, command="left"))
        publisher.decision(a_decision(1))
        got: dict[str, list[zenoh.Sample]] = {}

        def both_decisions() -> bool:
            while not samples.empty():
                sample = samples.get()
                got.setdefault(str(sample.key_expr).split("/", 2)[2].rsplit("/", 2)[0], []).append(
                    sample
                )
            return len(got.get("markers", [])) == 2 and "image/compressed" in got

        forwarded(bridge, both_decisions)
        tokens = [
            str(not_none(reply.ok).key_expr) for reply in listener.liveliness().get("@ros2_lv/**")
        ]
    numbers = {name: len(each) for name, each in got.items()}
    twice = ("cmd_vel", "odom", "plan", "markers", "scan", "range/ir7")
    assert {name: numbers[name] for name in twice} == dict.fromkeys(twice, 2)
    odometry = not_none(got["odom"][0].attachment).to_bytes()
    assert struct.unpack("<q", odometry[:8])[0] == 1
    (odometry_token,) = (token for token in tokens if "Odometry_" in token)
    assert odometry[17:] == gid(odometry_token)
    twist = decoder("geometry_msgs/TwistStamped")(got["cmd_vel"][0].payload.to_bytes())
    assert twist.twist.angular.z > 0
    assert abs(twist.header.stamp.sec - time.time()) < PATIENCE
    kinds = Counter(token.split("/")[5] for token in tokens)
    assert kinds == {"MP": len(topics.KINDS), "NN": 1}
    assert all(token.startswith(f"@ros2_lv/5/{session.zid()}/0/") for token in tokens)


def test_what_cannot_be_read_is_dropped(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = free_endpoint()
    with publishing(endpoint) as (session, publisher), Bridge(session, "khepera") as bridge:
        got: SimpleQueue[zenoh.Sample] = SimpleQueue()
        session.declare_subscriber("0/khepera/odom/**", got.put)
        session.put(DECISION.of("khepera"), "{}")
        forwarded(bridge, lambda: "1 refused; the last one of decision: " in caplog.text)
        assert got.empty()
        publisher.decision(a_decision())
        forwarded(bridge, lambda: not got.empty())
        # said again when the count has doubled
        session.put("macor/*/frame", "{}")
        forwarded(bridge, lambda: "2 refused; the last one of frame: " in caplog.text)
        assert "it came for macor/*/frame, not for one key" in caplog.text


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
