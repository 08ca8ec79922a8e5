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
    reason: str = Field(default="", description="why it has stopped or failed")
