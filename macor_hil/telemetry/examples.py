"""An example of every payload: for the documentation, and as a model for those who send them."""

from math import pi
from typing import Final

from khepera_protocol.zenoh.controller_payloads import (
    Ahead,
    Alternative,
    Command,
    Decision,
    Eye,
    Fields,
    Goal,
    Hypothesis,
    Learned,
    Link,
    Odometry,
    Phase,
    Situation,
    State,
    Steer,
)
from khepera_protocol.zenoh.payload_model import Payload
from khepera_protocol.zenoh.payloads import (
    CameraQuery,
    FaultsOn,
    FaultSwitch,
    Outline,
    Pose,
    Push,
    Reset,
    Solid,
    Stamp,
    Stop,
    Truth,
    WheelDrift,
    Wire,
    WireEntry,
)

_BEST: Final = [Ahead(node=1, command="straight"), Ahead(node=0, command="left")]
_OTHER: Final = [Ahead(node=0, command="left")]

_ALL: Final[tuple[Payload, ...]] = (
    Stamp(sequence=7, time=12.5),
    CameraQuery(view="panorama", encoding="jpeg"),
    Stop(stop=True),
    Reset(pose=Pose(x=0.1, y=0.2, heading=1.57), seed=3),
    Push(thing=0, x=0.3, y=0.05),
    FaultSwitch(on=["dead-sensor:sensor=2", "drop:p=0.01"], off=["cut"]),
    FaultsOn(kinds=["dead-sensor", "drop"]),
    Steer(planner="goal", goal="red"),
    Truth(
        time=12.5,
        pose=Pose(x=0.103, y=-0.002, heading=0.01),
        speed=(0.16, 0.158),
        contact=False,
        touched=False,
        drift=WheelDrift(left_scale=1.002, right_scale=0.997, wheel_base=0.0529, slip=0.02),
    ),
    Outline(
        title="A wall",
        floor=(0.5, 0.5, 0.5),
        solids=[Solid(corners=[(0.0, 0.1), (1.0, 0.1), (1.0, 0.12)], colour=(0.9, 0.8, 0.1))],
        start=Pose(x=0.1, y=0.0, heading=0.0),
        robot_radius=0.0275,
    ),
    Wire(
        first=120,
        entries=[
            WireEntry(time=12.41, what="request", text="H\n"),
            WireEntry(time=12.43, what="reply", text="h,262,263\r\n"),
        ],
    ),
    Decision(
        time=12.5,
        sequence=7,
        frame_time=11.7,
        situation=Situation(node=1, neuron=5, resonant=True, match=0.96),
        alternatives=[
            Alternative(command="left", evaluation=2.1),
            Alternative(command="right", evaluation=None),
            Alternative(command="straight", evaluation=4.2),
        ],
        command="straight",
        steps=21,
        sequence_ahead=_BEST,
        hypotheses=[
            Hypothesis(evaluation=4.2, ahead=_BEST),
            Hypothesis(evaluation=2.1, ahead=_OTHER),
        ],
        activities=[0.9025, 0.0, 0.0, 0.0, 0.0, 1.0],
        features=[0.25, 0.5, 0.125, 0.75, 0.5, 0.25],
        reinforcement=0.62,
        total_reinforcement=4.6,
        collided=False,
        infrared=[0, 12, 180, 171, 9, 0, 0, 0],
        odometry=Odometry(pose=Pose(x=0.021, y=0.0, heading=0.0), counters=(262, 263)),
        goal=Goal(name="red", bearing=0.393, reached=False),
    ),
    Learned(
        situations=2,
        transitions=9,
        commands=[
            Command(name="left", turn=0.2094, way=0.021),
            Command(name="right", turn=-0.2094, way=0.021),
            Command(name="straight", turn=0.0, way=0.021),
        ],
        fields=Fields(
            sectors=2,
            width=round(pi / 12, 4),
            channels=["black-white", "red-green", "blue-yellow"],
        ),
        eye=Eye(
            width=160,
            height=160,
            centre_x=79.5,
            centre_y=79.5,
            inner=16.0,
            outer=78.0,
            low=-1.0472,
            high=0.3491,
        ),
    ),
    State(
        phase=Phase.DRIVING,
        planner="anticipative",
        port="/dev/ttyUSB0",
        camera="video:0",
        map="runs/corridor.npz",
        driven=8,
        limit=40,
    ),
    Link(time=12.5, exchanges=240, failures=0, recent=31, mean=0.026, worst=0.053),
)

EXAMPLES: Final = {type(payload): payload for payload in _ALL}
"""An example by its model."""
