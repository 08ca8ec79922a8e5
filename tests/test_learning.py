"""A recording trains a map: what was driven is learned as if it happened now."""

import cv2
import numpy as np
import pytest
from planning import square
from typer.testing import CliRunner
from watching_helpers import BEGIN, SECOND, a_life

from macor_hil.agent import NO_PLAN, Agent
from macor_hil.cli import app
from macor_hil.commands import COMMANDS
from macor_hil.drive import Driver
from macor_hil.errors import RecordingError
from macor_hil.hardware import open_hardware
from macor_hil.learning import learn
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.map_file import load_map
from macor_hil.telemetry.decisions import decision_of
from macor_hil.telemetry.feed import Arrival
from macor_hil.telemetry.recording import Recorder
from macor_hil.telemetry.schemas import Odometry
from protocol.keys import CONTROLLER
from protocol.side_channel import Pose, Stamp

CHOICES = [0, 0, 1, 2, 0, 1]


def picture(frame):
    data = cv2.imencode(".png", frame.image)[1].tobytes()
    stamp = Stamp(sequence=frame.sequence, time=frame.time)
    return Arrival(CONTROLLER, "frame", data, "image/png", stamp, received(frame.time))


def received(seconds):
    return BEGIN + round(seconds * SECOND)


@pytest.fixture(scope="module")
def drive():
    """Events of a short drive, and its steps."""
    events, steps = [], []
    choices = iter(CHOICES)
    odometry = Odometry(pose=Pose(x=0.0, y=0.0, heading=0.0), counters=(0, 0))
    with open_hardware("khepera://corridor?seed=1") as hardware:
        agent = Agent(build_brain(), Driver(hardware.robot), hardware.camera)
        view = agent.begin(learn=True)
        events.append(picture(view.frame))
        for number in range(len(CHOICES)):
            step = agent.step(view, lambda _: (next(choices), NO_PLAN), learn=True)
            view = step.after
            decision = decision_of(
                step,
                time=view.frame.time,
                sequence=number,
                total_reinforcement=0.0,
                odometry=odometry,
            )
            data = decision.model_dump_json().encode()
            stamp = Stamp(sequence=number, time=decision.time)
            events += [
                picture(view.frame),
                Arrival(
                    CONTROLLER, "decision", data, "application/json", stamp, received(decision.time)
                ),
            ]
            steps.append(step)
    return events, steps


def test_every_command_is_learned_with_what_it_earned(drive):
    events, steps = drive
    brain = build_brain()
    assert learn(brain, [events], np.random.default_rng(0)) == len(steps)
    z, w_r = (square(brain.memories["transitions"], what) for what in ("z", "w_r"))
    assert z.sum() == len(steps)
    present, _ = np.nonzero(z)
    by_command = z.sum(axis=1).reshape(-1, len(COMMANDS)).sum(axis=0)
    assert by_command.tolist() == [CHOICES.count(k) for k in range(3)]
    earned = {round(value, 2) for value in w_r[z > 0]}
    assert earned == {0.54, 0.62}
    assert brain.eyes.fields.low != (0.0, 0.0, 0.0)
    assert len(present) > 0
    # each command counts as it was, and as its mirror image
    shared = brain.memories["graded"].counts.tried.sum(axis=0)
    left, right, straight = (CHOICES.count(k) for k in range(3))
    assert shared == pytest.approx([left + right, left + right, 2 * straight])


def test_a_frame_that_did_not_arrive_breaks_the_chain_and_nothing_else(drive):
    events, steps = drive
    brain = build_brain()
    # without the frame between the third and the fourth command, both cannot be learned
    assert learn(brain, [events[:5] + events[6:]], np.random.default_rng(0)) == len(steps) - 2
    assert square(brain.memories["transitions"], "z").sum() == len(steps) - 2


def test_what_holds_no_drive_cannot_be_learned_from():
    with pytest.raises(RecordingError, match="no decision with the frames"):
        learn(build_brain(), [a_life(0)], np.random.default_rng(0))


def test_the_command_makes_a_map(drive, tmp_path):
    file, map_file = tmp_path / "drive.mcap", tmp_path / "map.npz"
    with Recorder(file, "khepera") as recorder:
        for event in drive[0]:
            recorder.write(event)
    arguments = ["learn", str(file), "--map", str(map_file)]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert f"from {len(CHOICES)} commands" in result.stdout
    assert square(load_map(map_file)[0].memories["transitions"], "z").sum() == len(CHOICES)
    assert "is there already" in str(CliRunner().invoke(app, arguments).exception)
