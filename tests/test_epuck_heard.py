"""An e-puck's line as watchers hear it: whole requests and replies, and what they tell."""

from collections.abc import Sequence
from itertools import pairwise
from math import isclose
from typing import Any

import numpy as np
import pytest
from in_process import open_robot
from khepera_protocol.epuck.codes import ALL_ACTUATORS, ALL_SENSORS, pack, row
from khepera_protocol.epuck.letters import GREETING
from khepera_protocol.epuck.packets import Actuators, Behaviour
from khepera_protocol.epuck.units import STEP
from khepera_protocol.epuck.wifi import WifiRequest
from khepera_protocol.zenoh.keys import EMULATOR
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import Outline, Pose, Wire, WireEntry
from watching_helpers import json_event

from macor_hil.hardware.robots.epuck.form import EPUCK
from macor_hil.hardware.robots.epuck.readings import volts_of
from macor_hil.hardware.robots.forms import form_of
from macor_hil.hardware.robots.khepera.form import KHEPERA
from macor_hil.monitor.dashboard.drawings import charts
from macor_hil.monitor.line_state import LineState
from macor_hil.telemetry.feed import Arrival
from macor_hil.telemetry.ros2.topics import RosTopics
from macor_hil.telemetry.viewers.scene import Scene

Said = Sequence[tuple[str, bytes]]


def talk(dialect: str, requests: Sequence[tuple[bytes, int]]) -> Said:
    """Return what passes when requests are sent that are answered by so many bytes each."""
    model = "epuck" if dialect in ("gctronic", "btcom") else "epuck2"
    url = f"khepera://open-box?model={model}&profile={dialect}&seed=1"
    said: list[tuple[str, bytes]] = []
    with open_robot(url, baudrate=115_200, timeout=2.0) as port:
        for data, size in requests:
            port.write(data)
            said += [("request", data), ("reply", port.read(size))]
            assert len(said[-1][1]) == size
    return said


def heard(dialect: str, said: Said, seed: int | None = None) -> LineState:
    """Let it be heard, in pieces of any size."""
    rng = None if seed is None else np.random.default_rng(seed)
    line, entries = LineState(), []
    for number, (what, data) in enumerate(said):
        entries += [
            WireEntry(time=number * 0.01, what=what, text=piece.decode("latin-1"))
            for piece in _pieces(data, rng)
        ]
    for first, entry in enumerate(entries):
        wire = Wire(first=first, entries=[entry], robot_kind="epuck", dialect=dialect)
        line.take(wire, 1.0)
    return line


def _pieces(data: bytes, rng: np.random.Generator | None) -> list[bytes]:
    cuts = {0, len(data), *range(0, len(data), 4_000)}
    if rng is not None:
        cuts |= set(rng.integers(0, len(data) + 1, 3).tolist())
    return [data[a:b] for a, b in pairwise(sorted(cuts))]


LOOK = row(("D", pack((300, -2))), "E", "N", "Q")
SERIAL: Sequence[tuple[bytes, int]] = [
    (LOOK, 24),
    (row("a", "b"), 8),
    (b"N\r", 34),
    (b"L,3,1\r", 3),
    (row(("L", b"\x08\x01")), 0),
    (row("Q"), 4),
]


@pytest.mark.parametrize("dialect", ["gctronic", "gctronic2"])
def test_rows_are_pairs_and_never_halves(dialect: str) -> None:
    said = talk(dialect, [SERIAL[0], SERIAL[1], *SERIAL[3:]])
    whole = heard(dialect, said)
    for seed in range(8):
        rows = [(each.request, each.reply) for each in heard(dialect, said, seed).rows]
        assert rows == [(each.request, each.reply) for each in whole.rows]
    first = whole.rows[0]
    assert first.request == "BC 2C 01 FE FF BB B2 AF 00"
    assert first.reply.startswith("2C 01 FE FF ")
    assert len(first.reply.split()) == 24
    assert [row.request for row in whole.rows][2:] == ["L,3,1", "B4 08 01 00", "AF 00"]
    assert [row.reply for row in whole.rows][2:4] == ["l", ""]
    assert whole.lamps == {"3": True, "body": True}
    assert (whole.wanted, whole.speed) == ((300, -2), (300, -2))
    assert whole.battery is not None
    assert 3.4 < whole.battery < 4.2
    assert whole.proximity is not None
    assert len(whole.proximity.values) == 8
    assert whole.counters is not None


def test_text_of_several_lines_is_one_reply() -> None:
    version = b"v,Version 2.0 January 2018 GCtronic\r\nHW version: FFF7\r\n"
    said = [("request", b"V\r"), ("reply", version), ("request", b"Q\r"), ("reply", b"q,5,-7\r\n")]
    line = heard("gctronic2", said, 3)
    assert [(each.request, each.reply) for each in line.rows] == [
        ("V", "v,Version 2.0 January 2018 GCtronic / HW version: FFF7"),
        ("Q", "q,5,-7"),
    ]
    assert line.counters == (5, -7)


def test_a_packet_of_all_sensors_tells_them_all() -> None:
    wanted = Actuators(wheels=(200, 100), leds=0b110001)
    said = talk("gctronic2", [(row(ALL_SENSORS, (ALL_ACTUATORS, wanted.pack())), 103)])
    line = heard("gctronic2", said, 5)
    (only,) = line.rows
    assert len(only.reply.split()) == 103
    assert line.wanted == (200, 100)
    assert {name for name, lit in line.lamps.items() if lit} == {"0", "body", "front"}
    assert line.ambient is not None
    assert line.battery is not None
    assert line.driven == 1.0


def test_a_picture_is_told_by_its_size() -> None:
    said = talk("gctronic2", [(row("I", "Q"), 3 + 3200 + 4)])
    line = heard("gctronic2", said, 1)
    assert line.rows[0].reply.endswith("… 3207 bytes")
    assert line.rows[0].taken is not None


def test_packets_on_wifi_are_pairs() -> None:
    both = WifiRequest(pictures=True, actuators=Actuators(wheels=(100, 50))).pack()
    said = talk("wifi", [(both, 1 + 38_400 + 1 + 104), (WifiRequest().pack(), 105)])
    line = heard("wifi", said, 2)
    first, second = line.rows
    assert first.request.startswith("80 03 00 64 00 32 00")
    picture, sensors = first.reply.split(" / ")
    assert picture.endswith("… 38401 bytes")
    assert (sensors[:2], second.reply[:2]) == ("02", "02")
    assert line.wanted == (0, 0)
    assert line.proximity is not None


def test_counters_of_16_bits_count_on() -> None:
    ask = row("Q")
    ends = [32_760, -32_760, -32_000]
    said = [pair for end in ends for pair in (("request", ask), ("reply", pack((end, -end))))]
    assert heard("gctronic2", said).counters == (33_536, -33_536)


@pytest.mark.parametrize(("dialect", "counted"), [("gctronic", 33_536), ("gctronic2", -32_000)])
def test_in_text_only_an_e_pucks_counters_have_16_bits(dialect: str, counted: int) -> None:
    said: list[tuple[str, bytes]] = []
    for end in (32_760, -32_760, -32_000):
        said += [("request", b"Q\r"), ("reply", f"q,{end},{-end}\r\n".encode())]
    assert heard(dialect, said).counters == (counted, -counted)


STEPS_SET = Actuators(behaviour=Behaviour.STEPS, wheels=(10, 10))


@pytest.mark.parametrize(
    ("dialect", "asked"),
    [
        ("gctronic", b"P,0,0\r"),
        ("gctronic", b"R\r"),
        ("gctronic", row(("P", bytes(4)))),
        ("gctronic2", row((ALL_ACTUATORS, STEPS_SET.pack()))),
        ("gctronic2", b"r\r"),
    ],
)
def test_counters_that_are_set_are_no_way_that_was_driven(dialect: str, asked: bytes) -> None:
    ask = ("request", row("Q"))
    said: list[tuple[str, bytes]] = [ask, ("reply", pack((900, 900))), ask]
    said += [("reply", pack((1000, 1000))), ("request", asked)]
    answers = {b"R\r": GREETING, b"P,0,0\r": b"p\r\n"}
    said += [("reply", answers[asked])] if asked in answers else []
    said += [ask, ("reply", pack((20, 20))), ask, ("reply", pack((1020, 1020)))]
    assert heard(dialect, said).counters == (1020, 1020)
    entries = [WireEntry(time=k, what=w, text=d.decode("latin-1")) for k, (w, d) in enumerate(said)]
    wire = told("wire", Wire(first=0, entries=entries, robot_kind="epuck", dialect=dialect))
    for drawn in (RosTopics("khepera").tell(wire, 1), Scene().draw(wire, 1)):
        messages: dict[str, Any] = dict(drawn)
        pose = messages["odom"].pose.pose if "odom" in messages else messages["odometry"].pose
        assert pose.position.x == pytest.approx(1100 * STEP, abs=1e-4)


def test_what_is_lost_ends_with_the_next_request() -> None:
    line = heard("gctronic2", [("request", LOOK), ("reply", bytes(10))])
    gap = Wire(
        first=9,
        entries=[
            WireEntry(time=5.0, what="request", text="Q\r"),
            WireEntry(time=5.01, what="reply", text="q,1,2\r\n"),
        ],
        robot_kind="epuck",
        dialect="gctronic2",
    )
    line.take(gap, 2.0)
    assert [(row.request, row.reply) for row in line.rows][1:] == [
        ("", "7 events did not come here"),
        ("Q", "q,1,2"),
    ]


def test_a_robot_that_starts_again_says_so() -> None:
    said = [("request", LOOK), ("reply", bytes(5) + GREETING)]
    rows = [(row.request, row.reply) for row in heard("gctronic", said).rows]
    assert ("", "(it has started)") in rows


def test_garbage_is_heard_within_bounds() -> None:
    rng = np.random.default_rng(1)
    for dialect in ("gctronic", "btcom", "gctronic2", "wifi", "another"):
        line = LineState()
        for first in range(80):
            what = ("request", "reply")[int(rng.integers(2))]
            text = rng.bytes(int(rng.integers(1, 400))).decode("latin-1")
            wire = Wire(
                first=first,
                entries=[WireEntry(time=0.1 * first, what=what, text=text)],
                robot_kind="epuck",
                dialect=dialect,
            )
            line.take(wire, 1.0)
        assert len(line.rows) <= 60


@pytest.mark.parametrize(
    ("raw", "second", "volts"),
    [(2070, False, 3.4), (2560, False, 4.2), (3441, True, 4.2), (1, False, None)],
)
def test_a_battery_is_volts(raw: int, second: bool, volts: float | None) -> None:
    found = volts_of(raw, second=second)
    assert found == volts if volts is None else isclose(found or 0.0, volts, abs_tol=0.01)


def test_a_kind_that_nobody_knows_is_drawn_as_the_usual_one() -> None:
    assert (form_of("epuck"), form_of("khepera")) == (EPUCK, KHEPERA)
    assert form_of("walker") is KHEPERA
    assert form_of("/tmp/evil.py:FORM") is KHEPERA


def outline() -> Outline:
    start = Pose(x=0.0, y=0.0, heading=0.0)
    return Outline(
        title="",
        floor=(0, 0, 0),
        solids=[],
        start=start,
        robot_radius=0.035,
        robot_kind="epuck",
        robot_model="epuck2",
    )


def test_sensors_stand_where_an_e_puck_has_them() -> None:
    readings = (0, 0, 1000, 0, 0, 0, 0, 0)
    drawn = {form.title: charts.infrared(form, readings) for form in (EPUCK, KHEPERA)}
    assert "left 15: 1000" in drawn["e-puck"]
    assert "left 10: 1000" in drawn["Khepera"]
    assert (EPUCK.distance(1000), EPUCK.distance(0)) == (0.015, None)


def told(leaf: str, payload: Payload) -> Arrival:
    return json_event(EMULATOR, leaf, payload, 1.0)


def test_ros_and_foxglove_know_the_size_of_an_e_puck() -> None:
    topics, scene = RosTopics("khepera"), Scene()
    list(topics.tell(told("arena", outline()), 1))
    drawn: dict[str, Any] = dict(scene.draw(told("arena", outline()), 1))
    assert drawn["robot"].entities[0].cylinders[0].size.z == EPUCK.height
    said = talk("gctronic2", [(row("Q"), 4), (row("N"), 16)])
    said = [*said, ("request", row("Q")), ("reply", pack((1000, 1000)))]
    entries = [
        WireEntry(time=k * 0.01, what=what, text=data.decode("latin-1"))
        for k, (what, data) in enumerate(said)
    ]
    wire = Wire(first=0, entries=entries, robot_kind="epuck", dialect="gctronic2")
    found = dict(topics.tell(told("wire", wire), 1))
    shown = dict(scene.draw(told("wire", wire), 1))
    assert shown["odometry"].pose.position.x == pytest.approx(0.1288, abs=0.0002)
    rays = shown["infrared"].entities[0].lines
    assert (rays[0].points[0].y, rays[0].points[1].y) == pytest.approx((0.035, 0.105))
    assert rays[0].points[0].z == EPUCK.sensor_height
    # a turn of both wheels
    assert found["odom"].pose.pose.position.x == pytest.approx(0.1288, abs=0.0002)
    assert found["range/ir0"].max_range == EPUCK.farthest
    ring = {each.child_frame_id: each.transform for each in found["/tf"].transforms}
    assert ring["ir0"].translation.y == pytest.approx(0.035)
