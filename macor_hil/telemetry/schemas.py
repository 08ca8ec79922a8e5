"""JSON payloads of the controller's keys, one model each; `describe` queries give their schemas.

Measured values have no bounds here: a robot that reads oddly is still to be seen as it reads.
"""

from enum import StrEnum

from pydantic import Field

from protocol.side_channel import Payload, Pose


class Situation(Payload):
    """What the robot takes its view for."""

    node: int = Field(ge=0, description="visual situation")
    neuron: int = Field(ge=0, description="that situation, entered by the last command")
    resonant: bool = Field(description="whether the match reached the vigilance")
    match: float = Field(description="match of the situation's node, 0 to 1")


class Alternative(Payload):
    """A command that could have followed."""

    command: str
    evaluation: float | None = Field(description="null: never tried in this situation")


class Ahead(Payload):
    """A transition of the best hypothetical sequence."""

    node: int = Field(ge=0, description="situation expected after the command")
    command: str


class Hypothesis(Payload):
    """A hypothetical sequence of transitions that was weighed."""

    evaluation: float = Field(description="what the planner takes it to be worth")
    ahead: list[Ahead] = Field(description="its transitions, the next command first")


class Odometry(Payload):
    """Where the robot takes itself to be, from its encoders alone."""

    pose: Pose
    counters: tuple[int, int] = Field(description="encoder counts, left and right")


class Decision(Payload):
    """A decision and its outcome; published when the command has been driven."""

    time: float = Field(description="seconds on the robot's clock; wall clock for a real robot")
    sequence: int = Field(ge=0, description="counts the decisions of a run from 0")
    frame_time: float = Field(description="stamp of the frame that was decided on, seconds")
    situation: Situation
    alternatives: list[Alternative]
    command: str = Field(description="the command that was driven")
    steps: int = Field(ge=0, description="steps that the wave of activity took")
    sequence_ahead: list[Ahead] = Field(description="the best hypothetical sequence")
    hypotheses: list[Hypothesis] = Field(
        description="what was weighed, the best first: each next transition, best continued"
    )
    activities: list[float] = Field(
        description="of every neuron after the wave, 0 to 1; neuron = situation * commands +"
        " command that led into it; empty for planners without a wave"
    )
    features: list[float] = Field(
        description="what the receptive fields saw, 0 to 1: the channels of the first field, of"
        " the second, ..."
    )
    reinforcement: float = Field(description="earned by the command")
    total_reinforcement: float = Field(description="of the run so far")
    collided: bool
    infrared: list[int] = Field(
        min_length=8,
        max_length=8,
        description="the last proximity reading, 0 far to 1023 near, in the order of N's reply",
    )
    odometry: Odometry


class Phase(StrEnum):
    """Where in its life a run is."""

    STARTING = "starting"
    DRIVING = "driving"
    LATE = "late"
    RECOVERING = "recovering"
    STOPPED = "stopped"
    FAILED = "failed"


class State(Payload):
    """What a controller is doing, with what."""

    phase: Phase
    planner: str
    port: str
    camera: str
    map: str
    driven: int = Field(ge=0, description="commands driven so far")
    limit: int = Field(ge=0, description="commands after which the run ends")
    reason: str = Field(default="", description="why it is late, recovering, stopped or failed")


class Command(Payload):
    """A motor command: an arc."""

    name: str
    turn: float = Field(description="radians, left positive")
    way: float = Field(description="metres")


class Fields(Payload):
    """Receptive fields around the robot: Gaussian profiles over azimuth."""

    sectors: int = Field(
        ge=0,
        description="how many, evenly around, clockwise from straight behind; 0: other eyes",
    )
    width: float = Field(ge=0.0, description="standard deviation of a profile, radians")
    channels: list[str] = Field(description="opponent channels, in the order of the features")


class Eye(Payload):
    """Where the mirror lies in a frame, and what it shows; straight ahead is up."""

    width: int = Field(description="of a frame, pixels")
    height: int = Field(description="of a frame, pixels")
    centre_x: float = Field(description="pixels from the left")
    centre_y: float = Field(description="pixels from the top")
    inner: float = Field(description="radius of the lowest elevation, pixels")
    outer: float = Field(description="radius of the highest elevation, pixels")
    low: float = Field(description="that lowest elevation, radians")
    high: float = Field(description="that highest elevation, radians")


class Learned(Payload):
    """What a run drives by: the map in numbers, and how to read frames and decisions."""

    situations: int = Field(ge=0, description="visual situations that the map knows")
    transitions: int = Field(ge=0, description="transitions between neurons that have occurred")
    commands: list[Command] = Field(description="in the order of neurons")
    fields: Fields
    eye: Eye


class Link(Payload):
    """How the serial line to the robot does."""

    time: float = Field(description="seconds on the robot's clock; wall clock for a real robot")
    exchanges: int = Field(ge=0, description="requests that were answered, so far")
    failures: int = Field(ge=0, description="requests that were not, so far")
    recent: int = Field(ge=0, description="requests answered since the last sample")
    mean: float = Field(ge=0.0, description="of their round trips, seconds; 0 without any")
    worst: float = Field(ge=0.0, description="of their round trips, seconds")
