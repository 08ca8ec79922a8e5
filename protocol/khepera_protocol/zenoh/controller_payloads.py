"""JSON payloads of the controller's keys, one model each; `describe` queries give their schemas.

The bounds of measured values are far beyond what is measured: a robot that reads oddly is still to
be seen as it reads.
"""

from enum import StrEnum
from typing import Annotated, Final

from pydantic import FailFast, Field

from khepera_protocol.zenoh.payload_model import (
    Amount,
    Count,
    Integer,
    Name,
    Number,
    Payload,
    Real,
    Text,
    Time,
)
from khepera_protocol.zenoh.payloads import USUAL_ROBOT, Pose

MOST_COMMANDS: Final = 16
MOST_AHEAD: Final = 4_096
"""Transitions of a sequence."""

MOST_HYPOTHESES: Final = 64
MOST_ACTIVITIES: Final = 100_000
MOST_SECTORS: Final = 360
MOST_CHANNELS: Final = 8


class Situation(Payload):
    """The situation that the robot takes its view for."""

    node: Count = Field(description="visual situation")
    neuron: Count = Field(description="that situation, entered by the last command")
    resonant: bool = Field(description="whether the match reached the vigilance")
    match: Real = Field(description="match of the situation's node, 0 to 1")


class Alternative(Payload):
    """A command that could have followed."""

    command: Name
    evaluation: Real | None = Field(
        default=None,
        # left out rather than null: viewers of recordings know one type for a field
        exclude_if=lambda value: value is None,
        description="absent: never tried in this situation",
    )


class Ahead(Payload):
    """A transition of the best hypothetical sequence."""

    node: Count = Field(description="situation expected after the command")
    command: Name


Transitions = Annotated[list[Ahead], FailFast(), Field(max_length=MOST_AHEAD)]


class Hypothesis(Payload):
    """A hypothetical sequence of transitions that was weighed."""

    evaluation: Real = Field(description="what the planner takes it to be worth")
    ahead: Transitions = Field(description="its transitions, the next command first")


class Odometry(Payload):
    """The robot's pose by its own account, from its encoders alone."""

    pose: Pose
    counters: tuple[Integer, Integer] = Field(description="encoder counts, left and right")


class Goal(Payload):
    """A goal that the robot is driven to, as its camera sees it."""

    name: Name
    bearing: Real | None = Field(
        default=None,
        exclude_if=lambda value: value is None,
        description="direction in which it is seen after the command, radians, left positive;"
        " absent: it is not seen",
    )
    reached: bool = Field(description="whether the robot is there after the command")


class Decision(Payload):
    """A decision and its outcome; published when the command has been driven."""

    time: Time = Field(description="seconds on the robot's clock; wall clock for a real robot")
    sequence: Number = Field(description="counts the decisions of a run from 0")
    frame_time: Time = Field(description="stamp of the frame that was decided on, seconds")
    situation: Situation
    alternatives: Annotated[list[Alternative], FailFast()] = Field(max_length=MOST_COMMANDS)
    command: Name = Field(description="the command that was driven")
    steps: Count = Field(description="steps that the wave of activity took")
    sequence_ahead: Transitions = Field(description="the best hypothetical sequence")
    hypotheses: Annotated[list[Hypothesis], FailFast()] = Field(
        max_length=MOST_HYPOTHESES,
        description="what was weighed, the best first: each next transition, best continued",
    )
    activities: Annotated[list[Real], FailFast()] = Field(
        max_length=MOST_ACTIVITIES,
        description="of every neuron after the wave, 0 to 1; neuron = situation * commands +"
        " command that led into it; empty for planners without a wave",
    )
    features: Annotated[list[Real], FailFast()] = Field(
        max_length=MOST_SECTORS * MOST_CHANNELS,
        description="what the receptive fields saw, 0 to 1: the channels of the first field, of"
        " the second, ...",
    )
    reinforcement: Real = Field(description="earned by the command")
    total_reinforcement: Real = Field(description="of the run so far")
    collided: bool
    infrared: list[Integer] = Field(
        min_length=8,
        max_length=8,
        description="the last proximity reading, 0 far to 1023 near, from the left over the front"
        " to the back",
    )
    odometry: Odometry
    goal: Goal | None = Field(
        default=None,
        exclude_if=lambda value: value is None,
        description="absent: the planner has none",
    )


class Phase(StrEnum):
    """The phase of a run."""

    STARTING = "starting"
    TRAINING = "training"
    DRIVING = "driving"
    PAUSED = "paused"
    LATE = "late"
    BACKING_OFF = "backing off"
    RECOVERING = "recovering"
    STOPPED = "stopped"
    FAILED = "failed"


class State(Payload):
    """The state of a controller, and what it works with."""

    phase: Phase
    planner: Text
    port: Text
    camera: Text
    map: Text
    driven: Count = Field(description="commands driven so far")
    limit: Count = Field(description="commands after which the run ends; 0: it has no end")
    reason: Text = Field(default="", description="why it is late, recovering, stopped or failed")
    robot_kind: Name = Field(
        default=USUAL_ROBOT, description="kind of the robot: khepera, epuck or another program's"
    )


class Steer(Payload):
    """A wish to those who drive: only what is given changes."""

    pause: bool | None = Field(default=None, description="true: stand, at once; false: go on")
    planner: Name | None = Field(default=None, description="plan by another one from now on")
    goal: Name | None = Field(default=None, description="drive there; with the planner goal")


class Command(Payload):
    """A motor command: an arc."""

    name: Name
    turn: Real = Field(description="radians, left positive")
    way: Real = Field(description="metres")


class Fields(Payload):
    """Receptive fields around the robot: Gaussian profiles over azimuth."""

    sectors: int = Field(
        ge=0,
        le=MOST_SECTORS,
        description="how many, evenly around, clockwise from straight behind; 0: other eyes",
    )
    width: float = Field(ge=0.0, le=100.0, description="standard deviation of a profile, radians")
    channels: list[Name] = Field(
        max_length=MOST_CHANNELS, description="opponent channels, in the order of the features"
    )


Side = Annotated[int, Field(ge=1, le=10_000)]
Pixels = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
Angle = Annotated[float, Field(ge=-10.0, le=10.0)]


class Eye(Payload):
    """The place of the mirror in a frame, and its elevations; straight ahead is up."""

    width: Side = Field(description="of a frame, pixels")
    height: Side = Field(description="of a frame, pixels")
    centre_x: Pixels = Field(description="pixels from the left")
    centre_y: Pixels = Field(description="pixels from the top")
    inner: Pixels = Field(description="radius of the lowest elevation, pixels")
    outer: Pixels = Field(description="radius of the highest elevation, pixels")
    low: Angle = Field(description="that lowest elevation, radians")
    high: Angle = Field(description="that highest elevation, radians")


class Learned(Payload):
    """The basis of a run: its map in numbers, and how to read frames and decisions."""

    situations: Count = Field(description="visual situations that the map knows")
    transitions: Count = Field(description="transitions between neurons that have occurred")
    commands: Annotated[list[Command], FailFast()] = Field(
        min_length=1, max_length=MOST_COMMANDS, description="in the order of neurons"
    )
    fields: Fields
    eye: Eye


class Link(Payload):
    """The health of the serial line to the robot."""

    time: Time = Field(description="seconds on the robot's clock; wall clock for a real robot")
    exchanges: Count = Field(description="requests that were answered, so far")
    failures: Count = Field(description="requests that were not, so far")
    recent: Count = Field(description="requests answered since the last sample")
    mean: Amount = Field(description="of their round trips, seconds; 0 without any")
    worst: Amount = Field(description="of their round trips, seconds")
