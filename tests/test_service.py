"""The live loop: what it publishes, and that the robot stands after every way out."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from queue import Queue, SimpleQueue
from typing import Any, TypeVar

import pytest
import serial
import zenoh
from as_type import as_type, not_none
from controller_helpers import PATIENCE, ask_until, free_endpoint, receive, watching
from emulator_process import EmulatorProcess, emulator
from interrupting import signal_after
from khepera_protocol.zenoh.controller_payloads import Decision, Phase, State
from khepera_protocol.zenoh.payloads import Pose, Truth
from made_once import made_once
from short_training import train_shortly

import macor_hil.hardware.devices
import macor_hil.runs.live_run
import macor_hil.telemetry.publisher
from khepera_emulator.ports.protocol_khepera import Serial
from macor_hil.errors import CameraError, MacorError, MapError, RobotError, TelemetryError
from macor_hil.hardware.address import PortAddress
from macor_hil.hardware.bench import ZenohBench
from macor_hil.hardware.cameras.camera import Camera, Frame
from macor_hil.hardware.cameras.camera_watch import CameraWatch
from macor_hil.hardware.cameras.catalogue import CameraAddress
from macor_hil.hardware.khepera import Khepera, open_port
from macor_hil.mind.catalogue import build_brain
from macor_hil.mind.map_file import save_map
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
from macor_hil.runs.run_reporter import Ending
from macor_hil.safety.interruption import Interruption, undisturbed
from macor_hil.telemetry.sender import Sender
from macor_hil.telemetry.session import open_session

PORT = "khepera://corridor?seed=1&drift=none"
STOP = b"D,0,0\n"
MOVING = 0.05
STANDING = 0.004
"""m/s: half a unit of the speed controller."""

SETTLING = 0.1
"""Seconds from full speed to rest; an arc that nobody stops takes longer."""


@pytest.fixture(scope="module")
def map_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of a very short training: it knows a few situations around the start."""

    def train(folder: Path) -> None:
        train_shortly(folder / "short.npz", PORT, random=80)

    return made_once(tmp_path_factory, "map-of-service", train) / "short.npz"


@pytest.fixture
def config(map_file: Path) -> RunOptions:
    """Six commands on an embedded robot, unwatched; a failure ends the run."""
    return RunOptions(port=PORT, map_file=map_file, commands=6, listen=(), connect=(), recovery=0.0)


def changed(config: RunOptions, **options: Any) -> RunOptions:
    return config.model_copy(update=options)


class Tap:
    """Record of what went to the port of a run, and of the speed when the robot was switched off.

    `meddle` hears every request once it is on the line, before its reply is read.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.requests: list[bytes] = []
        self.speed = 0.0
        self.opened: Serial | None = None
        self.meddle: Callable[[bytes], None] = lambda _: None
        self._monkeypatch = monkeypatch
        monkeypatch.setattr(macor_hil.hardware.devices, "open_port", self._open)

    def _open(self, url: PortAddress, baud: int) -> Serial:
        self.opened = port = as_type(Serial, open_port(url, baud))
        write, close = port.write, port.close

        def tapped_write(data: bytes) -> int:
            count = write(data)
            self.requests.append(data)
            self.meddle(data)
            return count

        def tapped_close() -> None:
            if port.is_open:
                port.emulator.advance(port.now + SETTLING)
                self.speed = self.speed_now()
            close()

        self._monkeypatch.setattr(port, "write", tapped_write)
        self._monkeypatch.setattr(port, "close", tapped_close)
        return port

    @property
    def port(self) -> Serial:
        """The port, which has been opened."""
        return not_none(self.opened)

    def speed_now(self) -> float:
        """Speed of the faster wheel, m/s."""
        truth: Truth = self.port.emulator.truth()
        return max(map(abs, truth.speed))

    def in_mid_drive(self, act: Callable[[], object], arc: int = 2) -> None:
        """Do something once, while the robot is driving its arc of this number."""

        def meddle(data: bytes) -> None:
            if data == b"N\n" and self.count(b"C") == arc and self.speed_now() > MOVING:
                self.meddle = lambda _: None
                act()

        self.meddle = meddle

    def count(self, letter: bytes) -> int:
        return sum(data.startswith(letter) for data in self.requests)

    def assert_stopped(self) -> None:
        """A stop followed the last drive, and the robot stood when it was switched off."""
        assert not self.port.is_open
        last_drive = max(n for n, data in enumerate(self.requests) if data.startswith(b"C"))
        assert any(data.endswith(STOP) for data in self.requests[last_drive:])
        assert self.speed < STANDING


@pytest.fixture
def tap(monkeypatch: pytest.MonkeyPatch) -> Tap:
    return Tap(monkeypatch)


def raising(error: BaseException) -> Callable[..., None]:
    def act(*_: bytes) -> None:
        raise error

    return act


def states(samples: Any) -> Iterator[State]:
    while True:
        yield State.model_validate_json(receive(samples).payload.to_bytes())


def test_a_run_drives_its_commands_and_leaves_the_robot_standing(
    config: RunOptions, tap: Tap
) -> None:
    heard: list[Decision] = []
    report = serve(config, heard.append)
    assert report.ending is Ending.COMMANDS
    assert not report.collided
    assert report.commands == len(heard) == tap.count(b"C") == 6
    assert report.reinforcement == pytest.approx(sum(d.reinforcement for d in heard))
    assert [d.sequence for d in heard] == list(range(6))
    assert heard[-1].total_reinforcement == pytest.approx(report.reinforcement)
    tap.assert_stopped()


def test_odometry_follows_the_robot_from_the_start_that_is_given(
    config: RunOptions, tap: Tap
) -> None:
    heard, truth = [], []

    def on_step(decision: Decision) -> None:
        heard.append(decision)
        truth.append(tap.port.emulator.truth().pose)

    serve(config, on_step, start=Pose(x=1.0, y=2.0, heading=0.0))
    poses = [decision.odometry.pose for decision in heard]
    moved = [(pose.x - poses[0].x, pose.y - poses[0].y) for pose in poses]
    really = [(pose.x - truth[0].x, pose.y - truth[0].y) for pose in truth]
    for way, real_way in zip(moved, really, strict=True):
        assert way == pytest.approx(real_way, abs=0.002)  # the emulator's corridor begins eastward
    assert poses[0].x == pytest.approx(1.021, abs=0.002)
    assert poses[0].y == pytest.approx(2.0, abs=0.005)
    assert heard[0].odometry.counters[0] > 0


def test_a_collision_ends_the_run(config: RunOptions, tap: Tap) -> None:
    report = serve(changed(config, commands=200, planner="reactive"))
    assert report.ending is Ending.COLLISION
    assert report.collided
    assert report.commands < 200
    tap.assert_stopped()


def test_the_same_run_gives_the_same_decisions(config: RunOptions) -> None:
    first: list[Decision] = []
    second: list[Decision] = []
    serve(config, first.append)
    serve(config, second.append)
    assert first == second


def test_watchers_receive_every_decision_and_the_states_around_them(config: RunOptions) -> None:
    endpoint = free_endpoint()
    heard: list[Decision] = []
    keys = [f"macor/robby/{leaf}" for leaf in ("decision", "frame", "state")]
    with open_session([endpoint], []) as session:
        queues: list[SimpleQueue[zenoh.Sample]] = [SimpleQueue() for _ in keys]
        for key, queue in zip(keys, queues, strict=True):
            session.declare_subscriber(key, queue.put)
        serve(changed(config, robot="robby", connect=(endpoint,)), heard.append)
        decisions, frames, said = queues
        for decision in heard:
            sample = receive(decisions)
            assert Decision.model_validate_json(sample.payload.to_bytes()) == decision
        for _ in range(7):  # before the first command and after each
            assert receive(frames).payload.to_bytes().startswith(b"\xff\xd8")
        phases = []
        for state in states(said):
            phases.append((state.phase, state.driven))
            if state.phase is Phase.STOPPED:
                break
    assert phases[-2:] == [(Phase.DRIVING, 6), (Phase.STOPPED, 6)]
    assert state.reason == "all commands driven"


Told = TypeVar("Told", Decision, State)


def latest(session: zenoh.Session, kind: type[Told], holds: Callable[[Told], bool]) -> Told:
    def read(sample: zenoh.Sample) -> Told:
        return kind.model_validate_json(sample.payload.to_bytes())

    key = f"macor/khepera/{kind.__name__.lower()}"
    return read(ask_until(session, key, lambda sample: holds(read(sample))))


def test_a_late_joiner_finds_the_latest_decision_while_the_run_goes_on(config: RunOptions) -> None:
    endpoint = free_endpoint()
    heard: list[Any] = []

    def join(decision: Decision) -> None:
        if decision.sequence == 3:
            with watching(endpoint) as (session,):
                heard.append(latest(session, Decision, lambda decision: decision.sequence >= 3))
                heard.append(latest(session, State, lambda state: state.driven >= 4))
            heard.append(decision)

    serve(changed(config, listen=(endpoint,)), join)
    told, state, made = heard
    assert told == made
    assert (state.phase, state.driven, state.limit) == (Phase.DRIVING, 4, 6)
    assert (state.planner, state.port) == ("anticipative", PORT)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_in_the_middle_of_an_exchange_stops_the_robot(
    config: RunOptions, tap: Tap, number: int
) -> None:
    before = signal.getsignal(number)
    tap.in_mid_drive(lambda: signal.raise_signal(number))
    report = serve(changed(config, commands=1000))
    assert report.ending is Ending.INTERRUPTED
    assert report.signal == signal.Signals(number).name
    assert report.commands == 1
    assert tap.count(b"C") == 2
    tap.assert_stopped()
    assert signal.getsignal(number) is before


def test_the_robot_stands_before_a_last_picture_is_waited_for(
    config: RunOptions, tap: Tap, monkeypatch: pytest.MonkeyPatch
) -> None:
    speeds = []

    class Watch(CameraWatch):
        def __exit__(self, *raised: Any) -> None:
            speeds.append(tap.speed_now())
            super().__exit__(*raised)

    monkeypatch.setattr(macor_hil.runs.live_run, "CameraWatch", Watch)
    tap.in_mid_drive(lambda: signal.raise_signal(signal.SIGTERM))
    serve(config)
    assert speeds[0] < 2 * STANDING  # its controllers settle when the stop is confirmed


def test_a_keyboard_interrupt_from_elsewhere_stops_the_robot_too(
    config: RunOptions, tap: Tap
) -> None:
    tap.in_mid_drive(raising(KeyboardInterrupt()))
    assert serve(config).ending is Ending.INTERRUPTED
    tap.assert_stopped()


def test_impatient_ctrl_c_at_every_request_does_not_prevent_the_stop(
    config: RunOptions, tap: Tap
) -> None:
    def interrupt() -> None:
        tap.meddle = lambda _: signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    tap.in_mid_drive(interrupt)
    assert serve(config).ending is Ending.INTERRUPTED
    tap.assert_stopped()
    confirmed = len(tap.requests) - tap.requests[::-1].index(STOP)  # its reply was waited for,
    assert tap.requests[confirmed] == b"E\n"  # and seen to be true


def test_a_signal_while_the_robot_is_being_stopped_waits_until_it_stands(
    config: RunOptions, tap: Tap
) -> None:
    def meddle(data: bytes) -> None:
        if data.endswith(STOP) and tap.count(b"C") == 6:
            tap.meddle = lambda _: None
            signal.raise_signal(signal.SIGINT)

    tap.meddle = meddle
    report = serve(config)
    assert (report.ending, report.signal) == (Ending.COMMANDS, "SIGINT")
    tap.assert_stopped()


def test_an_interruption_raises_once_and_then_holds_back_until_released() -> None:
    with Interruption() as interruption:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        assert interruption.name == "SIGTERM"
        interruption.release()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_was_lost_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("macor_hil.safety.interruption.time.monotonic", lambda: now[0])
    with Interruption() as interruption:
        for _ in range(3):
            now[0] += 2.0
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
        interruption.hold()
        now[0] += 2.0
        signal.raise_signal(signal.SIGINT)


def test_an_interruption_leaves_no_lock_of_a_queue_locked_wherever_it_comes() -> None:
    """As pySerial's RFC 2217 client reads: the stop of the robot waits for the same queue."""
    calls, came = 0, [True]
    while came:
        calls, came, raised = calls + 1, [], False
        received: Queue[bytes] = Queue()
        received.put(b"x")
        with Interruption():
            try:
                sys.setprofile(signal_after(calls, came))
                received.get(timeout=1.0)
                sys.setprofile(None)
                end = time.monotonic() + PATIENCE
                while came and time.monotonic() < end:
                    pass
            except KeyboardInterrupt:
                raised = True
            finally:
                sys.setprofile(None)
        assert raised is bool(came), f"after call {calls}"
        assert received.mutex.acquire(timeout=1.0), f"locked by a signal after call {calls}"
    assert calls > 3


def test_a_wait_within_a_condition_is_interrupted_all_the_same() -> None:
    with Interruption():
        threading.Timer(0.05, os.kill, [os.getpid(), signal.SIGINT]).start()
        with pytest.raises(KeyboardInterrupt):
            threading.Event().wait(PATIENCE)


def test_a_terminal_that_was_left_on_purpose_may_close() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as `nohup` does
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGHUP)
        assert not interruption.name
    finally:
        signal.signal(signal.SIGHUP, before)


def test_signals_are_held_back_without_an_interruption_too() -> None:
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append("SIGINT"))
    try:
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            assert came == []
        assert came == ["SIGINT"]
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_interrupt_that_got_lost_in_a_callback_still_ends_the_run(
    config: RunOptions, tap: Tap
) -> None:
    def lose() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)

    tap.in_mid_drive(lose)
    report = serve(config)
    assert (report.ending, report.signal) == (Ending.INTERRUPTED, "SIGTERM")
    tap.assert_stopped()


def test_a_run_in_another_thread_leaves_signals_alone(config: RunOptions) -> None:
    reports = []
    thread = threading.Thread(target=lambda: reports.append(serve(config)))
    thread.start()
    thread.join(PATIENCE)
    assert reports[0].ending is Ending.COMMANDS


class BlindAfter:
    """A camera that fails at its picture of a number."""

    live = False

    def __init__(self, camera: Camera, pictures: int, error: BaseException) -> None:
        self.camera, self.pictures, self.error = camera, pictures, error

    def grab(self) -> Frame:
        self.pictures -= 1
        if self.pictures < 0:
            raise self.error
        return self.camera.grab()

    def close(self) -> None:
        self.camera.close()


@pytest.mark.parametrize("error", [CameraError("no picture"), ZeroDivisionError("a defect")])
def test_a_camera_that_fails_stops_the_robot_and_the_failure_is_published(
    config: RunOptions, tap: Tap, monkeypatch: pytest.MonkeyPatch, error: BaseException
) -> None:
    real = CameraAddress.open
    monkeypatch.setattr(CameraAddress, "open", lambda *a, **k: BlindAfter(real(*a, **k), 3, error))
    endpoint = free_endpoint()
    said: SimpleQueue[zenoh.Sample] = SimpleQueue()
    with open_session([endpoint], []) as session:
        session.declare_subscriber("macor/khepera/state", said.put)
        with pytest.raises(type(error)):
            serve(changed(config, connect=(endpoint,)))
        failed = next(state for state in states(said) if state.phase is Phase.FAILED)
    assert failed.reason == str(error)
    assert failed.driven == 2
    tap.assert_stopped()


def test_the_end_of_the_thread_that_tells_is_heard_and_stops_the_robot(
    config: RunOptions, tap: Tap, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A defect where pictures are encoded, in mid-drive; the camera would never be missed."""
    monkeypatch.setattr(threading, "excepthook", lambda _: None)
    senders: list[Sender] = []

    def made() -> Sender:
        senders.append(Sender())
        return senders[-1]

    monkeypatch.setattr(macor_hil.telemetry.publisher, "Sender", made)

    def die() -> None:
        senders[0].carry_out(lambda: 1 / 0)
        senders[0]._thread.join(PATIENCE)

    tap.in_mid_drive(die)
    with pytest.raises(TelemetryError, match="division by zero"):
        serve(changed(config, listen=(free_endpoint(),), commands=1000))
    assert tap.count(b"C") == 2  # the stop comes within that command
    tap.assert_stopped()


def test_an_error_in_mid_drive_stops_the_robot(config: RunOptions, tap: Tap) -> None:
    tap.in_mid_drive(raising(ZeroDivisionError()))
    with pytest.raises(ZeroDivisionError):
        serve(config)
    tap.assert_stopped()


def test_a_garbled_reply_in_mid_drive_is_asked_for_again(config: RunOptions, tap: Tap) -> None:
    def garble() -> None:
        tap.port.reset_input_buffer()
        tap.port.emulator.write(b"\x80\n")

    tap.in_mid_drive(garble)
    assert serve(config).commands == 6
    assert tap.count(b"?") == 3  # to connect, for the garble, to stop
    tap.assert_stopped()


def test_a_lost_link_is_said_as_clearly_as_that_no_stop_got_through(
    config: RunOptions, tap: Tap
) -> None:
    def cut() -> None:
        tap.meddle = raising(serial.SerialException("device disconnected"))
        raise serial.SerialException("device disconnected")

    tap.in_mid_drive(cut)
    with pytest.raises(RobotError) as failure:
        serve(config)
    said = str(failure.value)
    assert said.startswith(r"sent b'N\n', then the serial port failed: device disconnected")
    assert "NOT confirmed a stop" in said
    assert "21 mm at most" in said
    assert not tap.port.is_open


def test_an_interrupt_without_a_confirmed_stop_is_an_error(config: RunOptions, tap: Tap) -> None:
    def interrupt() -> None:
        tap.meddle = raising(serial.SerialException("device disconnected"))
        signal.raise_signal(signal.SIGINT)

    tap.in_mid_drive(interrupt)
    with pytest.raises(RobotError, match="NOT confirmed a stop"):
        serve(config)


def test_the_robot_is_stopped_when_there_is_no_such_camera(config: RunOptions, tap: Tap) -> None:
    with pytest.raises(CameraError, match="nonsense"):
        serve(changed(config, camera="nonsense"))
    assert tap.requests[-2:] == [STOP, b"E\n"]
    assert not tap.port.is_open


def test_what_cannot_be_used_is_named_before_anything_moves(
    config: RunOptions, tap: Tap, tmp_path: Path
) -> None:
    with pytest.raises(MapError, match="there is no map"):
        serve(changed(config, map_file=tmp_path / "none.npz"))
    with pytest.raises(MacorError, match=r"no planner 'bold'; there are anticipative, reactive"):
        serve(changed(config, planner="bold"))
    with pytest.raises(TelemetryError, match="robot's name"):
        serve(changed(config, robot="a/*", listen=(free_endpoint(),)))
    empty = tmp_path / "empty.npz"
    save_map(empty, build_brain(), {})
    with pytest.raises(MacorError, match="no situations"):
        serve(changed(config, map_file=empty))
    endpoint = free_endpoint()
    with open_session([endpoint], []), pytest.raises(TelemetryError, match="already"):
        serve(changed(config, listen=(endpoint,)))
    assert tap.opened is None


RUNNER = """
import sys
from pathlib import Path
from macor_hil.errors import MacorError
from macor_hil.runs.live_run import serve
from macor_hil.runs.options import RunOptions
port, map_file, connect = sys.argv[1:]
try:
    report = serve(
        RunOptions(
            port=port, map_file=Path(map_file), baud=57600, commands=10_000, listen=(),
            connect=(connect,), recovery=0.0,
        ),
        lambda decision: print("step", flush=True),
    )
    print(report.ending.value, report.signal)
except MacorError as error:
    print(error)
"""


class Live:
    """An emulator on a pseudo-terminal, and a controller that drives it, as processes."""

    def __init__(self, running: EmulatorProcess, endpoint: str, map_file: Path) -> None:
        self.running, self.endpoint = running, endpoint
        arguments = [running.path, str(map_file), endpoint]
        self.controller = subprocess.Popen(
            [sys.executable, "-c", RUNNER, *arguments], stdout=subprocess.PIPE, text=True
        )

    def wait_for_a_step(self) -> None:
        line = not_none(self.controller.stdout).readline()
        assert line == "step\n", line

    def last_words(self) -> list[str]:
        said, _ = self.controller.communicate(timeout=PATIENCE)
        return [line for line in said.splitlines() if line != "step"]


@pytest.fixture
def live(map_file: Path) -> Iterator[Live]:
    endpoint = free_endpoint()
    with emulator("--listen", endpoint, "--drift", "none", "--baud", "57600") as running:
        driving = Live(running, endpoint, map_file)
        try:
            yield driving
        finally:
            driving.controller.kill()
            driving.controller.communicate()


@pytest.mark.wall_clock
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_real_controller_stops_a_real_line_at_a_signal(live: Live, number: int) -> None:
    live.wait_for_a_step()
    with open_session([], [live.endpoint]) as session:
        bench = ZenohBench(session, "khepera")
        while max(bench.truth().speed) < MOVING:
            assert live.controller.poll() is None  # until it is under way again
        os.kill(live.controller.pid, number)
        assert live.last_words() == [f"interrupted {signal.Signals(number).name}"]
        assert live.controller.returncode == 0
        assert max(map(abs, bench.truth().speed)) < STANDING
    port = open_port(live.running.path, 57600)
    try:
        left, right = Khepera(port).status()
    finally:
        port.close()
    assert left.speed_mode  # a D came after the last C
    assert right.speed_mode


@pytest.mark.wall_clock
def test_a_real_emulator_that_dies_is_a_clear_error(live: Live) -> None:
    live.wait_for_a_step()
    live.running.end(signal.SIGKILL)
    (said,) = live.last_words()
    assert "the serial port failed" in said
    assert "NOT confirmed a stop" in said
