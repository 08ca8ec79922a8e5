"""Steering from outside: things, faults, and a run that is paused or changes its planner."""

import threading
import time
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import zenoh
from as_type import not_none
from controller_helpers import PATIENCE, free_endpoint
from khepera_protocol.zenoh.controller_payloads import Decision, Phase, State, Steer
from khepera_protocol.zenoh.payloads import FaultSwitch, Push
from made_once import made_once
from short_training import train_shortly
from test_khepera_url import ask, open_port

from khepera_emulator.errors import EmulatorError
from macor_hil.errors import MacorError, TelemetryError
from macor_hil.hardware.khepera import Khepera
from macor_hil.monitor.roster import Roster
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.steer_key import Helm, PausedError, ask_to_steer, steer_key

PORT = "khepera://corridor?seed=1&drift=none"


def ask_until_known(session: zenoh.Session) -> None:
    """Return when a steer key is known to a session, by a wish for nothing."""
    for _ in range(100):
        with suppress(TelemetryError):
            ask_to_steer(session, "khepera", Steer())
            return


def anything(_: Steer) -> None: ...


def test_things_are_put_elsewhere_if_there_is_room() -> None:
    with open_port("khepera://toys?seed=1") as port:
        emulator = port.emulator
        before = emulator.outline()
        assert before.things == 4
        after = emulator.push(Push(thing=0, x=0.1, y=-0.3))
        moved = after.solids[-4]
        assert sum(x for x, _ in moved.corners) / len(moved.corners) == pytest.approx(0.1)
        assert after.solids[-3:] == before.solids[-3:]
        pose = emulator.truth().pose
        for thing, x, y, why in (
            (4, 0.0, 0.0, "no thing 4"),
            (1, 9.0, 0.0, "outside the walls"),
            (1, 0.1, -0.3, "something is there"),
            (1, pose.x + 0.01, pose.y, "something is there"),
        ):
            with pytest.raises(EmulatorError, match=why):
                emulator.push(Push(thing=thing, x=x, y=y))
        assert emulator.outline() == after


def test_faults_are_switched_on_and_off_while_the_robot_lives() -> None:
    with open_port("khepera://corridor?seed=1") as port:
        emulator, healthy = port.emulator, ask(port, b"N\n")
        switched = emulator.switch_faults(FaultSwitch(on=["dead-sensor:sensor=2", "drop:p=1"]))
        assert switched.kinds == ["dead-sensor", "drop"]
        assert emulator.truth().faults == ("dead-sensor",)
        port.timeout = 0.2
        assert ask(port, b"B\n") == b""
        emulator.switch_faults(FaultSwitch(off=["drop", "flip"]))
        assert ask(port, b"B\n").startswith(b"b,")
        with pytest.raises(EmulatorError, match="rubbish"):
            emulator.switch_faults(FaultSwitch(on=["rubbish"], off=["dead-sensor"]))
        assert emulator.switch_faults(FaultSwitch()).kinds == ["dead-sensor"]
        assert emulator.switch_faults(FaultSwitch(off=["dead-sensor"])).kinds == []
        assert len(ask(port, b"N\n")) - len(healthy) in range(-8, 9)


def test_chance_of_the_other_faults_stays_as_it_is() -> None:
    def replies(meddle: bool) -> list[bytes]:
        with open_port("khepera://corridor?seed=1&fault=flip:p=0.02,dir=reply") as port:
            port.timeout = 0.2
            said = [ask(port, b"B\n") for _ in range(20)]
            if meddle:
                port.emulator.switch_faults(FaultSwitch(on=["dark-camera"], off=["stall"]))
            return said + [ask(port, b"B\n") for _ in range(20)]

    assert replies(meddle=True) == replies(meddle=False)


def test_a_course_waits_for_the_end_of_the_command_and_a_pause_does_not() -> None:
    helm = Helm(anything)
    assert not helm.wants
    assert helm.take(Steer()) == "nothing to do"
    assert helm.take(Steer(planner="graded")) == "a new course after this command"
    assert helm.wants
    assert not_none(helm.course()).planner == "graded"
    assert helm.course() is None
    helm.guard()
    helm.take(Steer(pause=True))
    with pytest.raises(PausedError):
        helm.guard()
    looks = []

    def look() -> None:
        looks.append(1)
        helm.take(Steer(pause=False))

    helm.hold(look)
    assert looks
    helm.hold(look)
    assert len(looks) == 1  # nothing to wait for


def test_what_cannot_be_had_changes_nothing() -> None:
    def refuse(wish: Steer) -> None:
        raise MacorError(f"no planner {wish.planner}")

    helm = Helm(refuse)
    with pytest.raises(MacorError):
        helm.take(Steer(planner="x", pause=True))
    assert not helm.wants


def test_only_a_wish_on_exactly_the_key_steers() -> None:
    endpoint = free_endpoint()
    helm = Helm(anything)
    with (
        open_session([endpoint], []) as session,
        steer_key(session, "khepera", helm),
        open_session([], [endpoint]) as other,
    ):
        ask_until_known(other)
        for key, payload in (
            ("macor/*/steer", '{"pause":true}'),
            ("macor/khepera/steer", ""),
            ("macor/khepera/steer", '{"pause":1.5}'),
            ("macor/khepera/steer", '{"halt":true}'),
        ):
            list(other.get(key, payload=payload, timeout=PATIENCE))
            assert not helm.wants
        assert ask_to_steer(other, "khepera", Steer(pause=True)).startswith("pausing")
        assert helm.paused
    with open_session([], []) as alone, pytest.raises(TelemetryError, match="nobody answers"):
        ask_to_steer(alone, "khepera", Steer(pause=True))


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, random=80)

    return made_once(tmp_path_factory, "map-of-service", train) / "short.npz"


def ask_when_it_is_known(session: zenoh.Session, wish: Steer) -> str:
    """Ask a run that this session may not have found yet."""
    late = time.monotonic() + PATIENCE
    while True:
        try:
            return ask_to_steer(session, "khepera", wish)
        except TelemetryError as error:
            if "nobody answers" not in str(error) or time.monotonic() > late:
                raise


def test_a_run_is_paused_and_goes_on_by_another_planner(map_file: Path) -> None:
    endpoint = free_endpoint()
    options = RunOptions(
        port=PORT, map_file=map_file, commands=5, listen=(endpoint,), connect=(), steer_key=True
    )
    states: SimpleQueue[State] = SimpleQueue()
    said: list[Any] = []

    def resume(other: zenoh.Session) -> None:
        while states.get(timeout=PATIENCE).phase is not Phase.PAUSED:
            pass
        said.append(ask_to_steer(other, "khepera", Steer(pause=False)))

    def on_step(decision: Decision) -> None:
        if decision.sequence == 1:
            wish = Steer(planner="reactive", pause=True)
            said.append(ask_when_it_is_known(session, wish))
            with pytest.raises(TelemetryError, match="refuses"):
                ask_to_steer(session, "khepera", Steer(planner="nonsense"))

    with open_session([], [endpoint]) as session:

        def hear(sample: zenoh.Sample) -> None:
            states.put(State.parse(sample.payload.to_bytes()))

        with session.declare_subscriber("macor/khepera/state", hear):
            thread = threading.Thread(target=resume, args=(session,))
            thread.start()
            report = serve(options, on_step)
            thread.join()
    assert said == ["pausing, a new course after this command", "going on"]
    assert report.commands == 5 or report.collided
    last = states.get(timeout=PATIENCE)
    while last.phase is not Phase.STOPPED:
        last = states.get(timeout=PATIENCE)
    assert last.planner == "reactive"


def test_a_pause_stops_the_robot_in_mid_command(
    map_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    endpoint = free_endpoint()
    options = RunOptions(
        port=PORT, map_file=map_file, commands=4, listen=(endpoint,), connect=(), steer_key=True
    )
    moves: list[float] = []
    asked: list[float] = []
    stood: list[float] = []
    go_to, look, halt = Khepera.go_to, Khepera.proximity, Khepera.halt

    def go(robot: Khepera, *target: int) -> None:
        moves.append(robot.clock())
        go_to(robot, *target)

    def watch(robot: Khepera) -> tuple[int, ...]:
        if len(moves) == 2 and not asked and robot.clock() - moves[-1] > 0.3:
            asked.append(robot.clock())
            ask_when_it_is_known(session, Steer(pause=True))
        return look(robot)

    def stop(robot: Khepera) -> None:
        halt(robot)
        if asked and not stood:
            stood.append(robot.clock())
            ask_when_it_is_known(session, Steer(pause=False))

    monkeypatch.setattr(Khepera, "go_to", go)
    monkeypatch.setattr(Khepera, "proximity", watch)
    monkeypatch.setattr(Khepera, "halt", stop)
    with open_session([], [endpoint]) as session:
        report = serve(options, None)
    assert stood[0] - asked[0] < 0.3  # of 0.4 s to the end of the command
    assert len(moves) == report.commands + 1
    assert report.commands == 4 or report.collided


@pytest.mark.parametrize(
    ("wish", "planner", "goal"),
    [
        (Steer(planner="reactive"), "reactive", ""),
        (Steer(goal="red"), "goal", "red"),
        (Steer(planner="graded", goal=""), "graded", ""),
    ],
)
def test_a_course_is_planner_and_goal(wish: Steer, planner: str, goal: str) -> None:
    steered = RunOptions().steered(wish)
    assert (steered.planner_name, steered.goal) == (planner, goal)
    with pytest.raises(MacorError, match="no goal"):
        RunOptions().steered(Steer(goal="puce"))


def test_all_robots_that_there_are_are_found_by_their_names() -> None:
    endpoint = free_endpoint()

    def until(condition: Any) -> None:
        for _ in range(1000):
            roster.drain(0.01)
            if condition():
                return
            changed.wait(0.01)
        raise AssertionError(list(roster.robots))

    changed = threading.Event()
    with (
        open_session([endpoint], []) as session,
        Roster(session) as roster,
        open_session([], [endpoint]) as other,
    ):
        with other.liveliness().declare_token("khepera/b/alive"):
            token = other.liveliness().declare_token("macor/a/alive")
            stranger = other.liveliness().declare_token("macor/x y/alive")  # no robot's name
            until(lambda: len(roster.robots) == 2)
            assert list(roster.robots) == ["a", "b"]
            until(lambda: roster.robots["a"].watched.controlled.alive)
            until(lambda: roster.robots["b"].watched.emulated.alive)
            token.undeclare()
            stranger.undeclare()
        until(lambda: not any(each.watched.alive for each in roster.robots.values()))
        assert list(roster.robots) == ["a", "b"]
