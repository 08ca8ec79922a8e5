"""A recording trains a map: what was driven is learned as if it happened now."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from as_type import as_type, not_none
from khepera_protocol.zenoh.controller_payloads import Odometry
from khepera_protocol.zenoh.keys import CONTROLLER
from khepera_protocol.zenoh.payloads import Pose, Stamp
from planning import square
from typer.testing import CliRunner
from watching_helpers import BEGIN, SECOND, a_life

from macor_hil.cli.program import app
from macor_hil.commands import COMMANDS
from macor_hil.errors import CameraError, RecordingError
from macor_hil.hardware.cameras.camera import Frame
from macor_hil.hardware.devices import open_hardware
from macor_hil.hardware.driver import Driver
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.map_file import load_map
from macor_hil.mind.memories.graded import GradedMemory
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import NO_PLAN
from macor_hil.runs.agent import Agent, Step
from macor_hil.runs.decision_samples import decision_of
from macor_hil.runs.learning.recorded_drives import learn
from macor_hil.telemetry.feed import Arrival, Event, Presence
from macor_hil.telemetry.recordings.recording import Recorder

CHOICES = [0, 0, 1, 2, 0, 1]


def picture(frame: Frame) -> Arrival:
    data = cv2.imencode(".png", frame.image)[1].tobytes()
    stamp = Stamp(sequence=frame.sequence, time=frame.time)
    return Arrival(CONTROLLER, "frame", data, "image/png", stamp, received(frame.time))


def received(seconds: float) -> int:
    return BEGIN + round(seconds * SECOND)


@pytest.fixture(scope="module")
def drive() -> tuple[list[Arrival], list[Step]]:
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


def test_every_command_is_learned_with_what_it_earned(
    drive: tuple[list[Arrival], list[Step]],
) -> None:
    events, steps = drive
    brain = build_brain()
    assert learn(brain, [events], np.random.default_rng(0)) == len(steps)
    z, w_r = (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), what)
        for what in ("z", "w_r")
    )
    assert z.sum() == len(steps)
    present, _ = np.nonzero(z)
    by_command = z.sum(axis=1).reshape(-1, len(COMMANDS)).sum(axis=0)
    assert by_command.tolist() == [CHOICES.count(k) for k in range(3)]
    earned = {round(value, 2) for value in w_r[z > 0]}
    assert earned == {0.54, 0.62}
    assert as_type(PanoramaEyes, brain.eyes).fields.low != (0.0, 0.0, 0.0)
    assert len(present) > 0
    # each command counts as it was, and as its mirror image
    shared = as_type(GradedMemory, brain.memories["graded"]).counts.tried.sum(axis=0)
    left, right, straight = (CHOICES.count(k) for k in range(3))
    assert shared == pytest.approx([left + right, left + right, 2 * straight])


def test_a_frame_that_did_not_arrive_breaks_the_chain_and_nothing_else(
    drive: tuple[list[Arrival], list[Step]],
) -> None:
    events, steps = drive
    brain = build_brain()
    # without the frame between the third and the fourth command, both cannot be learned
    assert learn(brain, [events[:5] + events[6:]], np.random.default_rng(0)) == len(steps) - 2
    assert (
        square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").sum() == len(steps) - 2
    )


def learned_from(*recordings: Sequence[Event]) -> tuple[int, bytes, bytes]:
    brain = build_brain()
    driven = learn(brain, recordings, np.random.default_rng(0))
    return (
        driven,
        as_type(FuzzyArt, brain.clusterer).weights.tobytes(),
        square(as_type(SensorimotorMap, brain.memories["transitions"]), "z").tobytes(),
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_order_of_frames_and_decisions_in_the_file_does_not_matter(
    drive: tuple[list[Arrival], list[Step]], seed: int, caplog: pytest.LogCaptureFixture
) -> None:
    events, steps = drive
    # each up to three places from where it was
    places = np.arange(len(events)) + np.random.default_rng(seed).uniform(0.0, 3.0, len(events))
    mixed = [events[k] for k in np.argsort(places)]
    assert mixed != events
    assert learned_from(mixed) == learned_from(events)
    assert learned_from(events)[0] == len(steps)
    assert caplog.messages == []


def test_runs_in_one_recording_count_apart(drive: tuple[list[Arrival], list[Step]]) -> None:
    events, steps = drive
    # virtual time begins anew with every run, and numbers do with every controller
    alive = [Presence(CONTROLLER, True, BEGIN)]
    for between in (alive, [Presence(CONTROLLER, False, BEGIN), *alive]):
        assert learned_from([*alive, *events, *between, *events])[0] == 2 * len(steps)
    assert learned_from(events, events)[0] == 2 * len(steps)
    later = [at(event, 100.0) for event in events]
    assert learned_from([*events, *later])[0] == 2 * len(steps)
    # presence may be told after the first frame
    assert learned_from([*events, later[0], *alive, *later[1:]])[0] == 2 * len(steps)
    # whoever asks for the latest sample gets one that it may know
    assert learned_from([*events, *events[-2:]])[0] == len(steps)


def at(event: Arrival, later: float) -> Arrival:
    """The same event, as if it had happened later."""
    data = event.data
    if event.leaf == "decision":
        decision = json.loads(data)
        data = json.dumps({**decision, "frame_time": decision["frame_time"] + later}).encode()
    stamp = not_none(event.stamp).model_copy(update={"time": not_none(event.stamp).time + later})
    return replace(event, data=data, stamp=stamp)


def test_what_is_left_out_is_told(
    drive: tuple[list[Arrival], list[Step]], caplog: pytest.LogCaptureFixture
) -> None:
    events, steps = drive
    decision = events[2]
    odd = [
        replace(decision, data=b"{}"),
        replace(decision, data=json.dumps({**json.loads(decision.data), "command": "up"}).encode()),
        replace(events[0], data=events[0].data[:40]),
        replace(events[0], stamp=None),
    ]
    assert learned_from([*events[:5], *odd, *events[6:]])[0] == len(steps) - 2
    (said,) = caplog.messages
    assert said.startswith("left out: ")
    for part in (
        "decisions without the frame before them: 1",
        "decisions without the frame after them: 1",
        "decisions that cannot be read: 2",
        "frames without a picture or a stamp: 2",
    ):
        assert part in said


def test_frames_of_another_mirror_are_named(drive: tuple[list[Arrival], list[Step]]) -> None:
    events, steps = drive
    small = cv2.imencode(".png", np.full((8, 8, 3), 90, np.uint8))[1].tobytes()
    misfit = [replace(e, data=small) if e.leaf == "frame" else e for e in events]
    with pytest.raises(CameraError, match="the mirror is described for 160 x 160"):
        learned_from(misfit)
    assert learned_from([misfit[0], *events])[0] == len(steps)


def test_what_holds_no_drive_cannot_be_learned_from() -> None:
    with pytest.raises(RecordingError, match="no decision with the frames"):
        learn(build_brain(), [a_life(0)], np.random.default_rng(0))


def test_the_command_makes_a_map(drive: tuple[list[Arrival], list[Step]], tmp_path: Path) -> None:
    file, map_file = tmp_path / "drive.mcap", tmp_path / "map.npz"
    with Recorder(file, "khepera") as recorder:
        for event in drive[0]:
            recorder.write(event)
    arguments = ["learn", str(file), "--map", str(map_file)]
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert f"from {len(CHOICES)} commands" in result.stdout
    known = as_type(SensorimotorMap, load_map(map_file)[0].memories["transitions"])
    assert square(known, "z").sum() == len(CHOICES)
    assert "is there already" in str(CliRunner().invoke(app, arguments).exception)
