"""The example configurations of docs/zenoh: who gets in, and who may do what."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh
from controller_helpers import PATIENCE, a_decision, a_state, free_endpoint, wait_until_watched
from khepera_protocol.zenoh.config import MOST_MESSAGE
from khepera_protocol.zenoh.session import read_configuration
from typer.testing import CliRunner, Result
from watching_helpers import a_life

from khepera_emulator.app.side_channel import open_zenoh as emulator_session
from khepera_emulator.errors import EmulatorError
from macor_hil.cli.program import app
from macor_hil.errors import CameraLostError, TelemetryError
from macor_hil.hardware.cameras.zenoh_camera import ZenohCamera
from macor_hil.telemetry.publisher import Publisher
from macor_hil.telemetry.recordings.recording import Recorder, read_recording
from macor_hil.telemetry.session import open_session
from macor_hil.telemetry.wishes.stop_key import ask_to_stop, stop_key

QUIET = "scouting: {multicast: {enabled: false}}"
DOCS = Path(__file__).parents[1] / "docs" / "zenoh"
SILENCE = 0.5
"""Seconds after which nothing more is taken to come."""

pytestmark = [
    pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl"),
    pytest.mark.usefixtures("router"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Certificates, and the examples with a free port and paths of these."""
    folder = tmp_path_factory.mktemp("zenoh")
    subprocess.run(["sh", str(DOCS / "certificates.sh"), str(folder / "certificates")], check=True)
    port = free_endpoint().rpartition(":")[2]

    def write(name: str, example: str, **changes: str) -> None:
        text = (DOCS / example).read_text().replace("7446", port)
        text = text.replace('"certificates/', f'"{folder}/certificates/')
        for old, new in changes.items():
            text = text.replace(old, new)
        (folder / name).write_text(text)

    write("router.json5", "router.json5")
    for name in ("emulator", "controller", "watcher"):
        write(f"{name}.json5", "client.json5", watcher=name)
    hurried = (folder / "watcher.json5").read_text().replace("10000", "1000")
    own = "connect_certificate", "connect_private_key", "enable_mtls"
    kept = [line for line in hurried.splitlines() if not line.strip().startswith(own)]
    (folder / "stranger.json5").write_text("\n".join(kept))
    # signed by an authority of its own, and trusting ours
    subprocess.run(["sh", str(DOCS / "certificates.sh"), str(folder / "forged")], check=True)
    others = {
        "forger": ("certificates/watcher", "forged/watcher"),
        "doubter": ("certificates/ca.pem", "forged/ca.pem"),
        "thief": ("watcher.key", "emulator.key"),
        "lost": (port, free_endpoint().rpartition(":")[2]),
        "plain": ("tls/127", "tcp/127"),
    }
    for name, (old, new) in others.items():
        (folder / f"{name}.json5").write_text(hurried.replace(old, new))
    return folder


@pytest.fixture(scope="module")
def router(folder: Path) -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh.Config.from_file(str(folder / "router.json5"))) as session:
        yield session


@contextmanager
def sessions(folder: Path, *names: str) -> Iterator[list[zenoh.Session]]:
    with ExitStack() as stack:
        yield [
            stack.enter_context(open_session([], [], folder / f"{name}.json5")) for name in names
        ]


def heard(session: zenoh.Session, key: str) -> SimpleQueue[zenoh.Sample]:
    queue: SimpleQueue[zenoh.Sample] = SimpleQueue()
    session.declare_subscriber(key, queue.put)
    return queue


def nothing(queue: SimpleQueue[zenoh.Sample]) -> bool:
    with pytest.raises(Empty):
        queue.get(timeout=SILENCE)
    return True


def test_a_watcher_hears_the_controller_and_may_ask(folder: Path) -> None:
    with sessions(folder, "controller", "watcher") as (controller, watcher):
        queue = heard(watcher, "macor/khepera/decision")
        wait_until_watched(controller, "macor/khepera/decision")
        controller.put("macor/khepera/decision", "left")
        assert queue.get(timeout=PATIENCE).payload.to_string() == "left"


def test_a_watcher_can_neither_publish_nor_stop(folder: Path) -> None:
    stops: list[str] = []
    with (
        sessions(folder, "controller", "watcher", "controller") as (controller, watcher, other),
        stop_key(controller, "khepera", stops.append),
    ):
        queue = heard(other, "macor/khepera/**")
        wait_until_watched(controller, "macor/khepera/state")
        watcher.put("macor/khepera/state", "all is well")
        watcher.put("macor/khepera/stop", '{"stop": true}')
        with pytest.raises(TelemetryError, match="nobody answers"):
            ask_to_stop(watcher, "khepera")
        assert nothing(queue)
        assert not stops
        ask_to_stop(other, "khepera")
        assert stops


def test_a_watcher_cannot_be_taken_for_the_camera(folder: Path) -> None:
    def picture_of(level: int) -> bytes:
        image = np.zeros((16, 16, 3), np.uint8)
        image[:8] = level
        return cv2.imencode(".png", image)[1].tobytes()

    def answering(session: zenoh.Session, level: int, asked: list[int]) -> zenoh.Queryable[None]:
        def answer(query: zenoh.Query) -> None:
            with query:
                asked.append(1)
                query.reply("khepera/khepera/camera", picture_of(level))

        return session.declare_queryable("khepera/khepera/camera", answer, complete=True)

    asked: list[int] = []
    stranger_asked: list[int] = []
    with (
        sessions(folder, "emulator", "controller", "watcher") as (emulator, controller, watcher),
        answering(watcher, 50, stranger_asked),
    ):
        camera = ZenohCamera(controller, "khepera/khepera/camera")
        with pytest.raises(CameraLostError):
            camera.grab()
        with answering(emulator, 200, asked):
            assert camera.grab().image.max() == 200
    assert asked
    assert not stranger_asked


def macor_hil(*arguments: int | Path | str) -> Result:
    return CliRunner(env={"COLUMNS": "80"}).invoke(app, list(map(str, arguments)))


def test_a_watcher_can_use_the_monitor_and_the_recorder(folder: Path, tmp_path: Path) -> None:
    watcher = "--zenoh-config", folder / "watcher.json5"
    with sessions(folder, "controller") as (session,), Publisher(session, "khepera") as publisher:
        publisher.state(a_state(driven=3), 1.0)
        publisher.decision(a_decision(3))
        seen = macor_hil("monitor", "--once", *watcher)
        done = macor_hil("record", tmp_path / "drive.mcap", "--for", 2, *watcher)
    assert seen.exit_code == 0, seen.output
    assert "driving, 3 of 40" in seen.stdout
    assert done.exit_code == 0, done.output
    events = read_recording(tmp_path / "drive.mcap")[1]
    assert {"state", "decision"} <= {event.leaf for event in events if hasattr(event, "leaf")}


@pytest.mark.parametrize(("name", "heard_of"), [("watcher", False), ("controller", True)])
def test_only_who_may_publish_can_replay(
    folder: Path, tmp_path: Path, name: str, heard_of: bool
) -> None:
    with Recorder(tmp_path / "drive.mcap", "khepera") as recorder:
        for event in a_life(1):
            recorder.write(event)
    with sessions(folder, "controller") as (listener,):
        queue = heard(listener, "macor/khepera/**")
        config = "--zenoh-config", folder / f"{name}.json5"
        done = macor_hil("replay", tmp_path / "drive.mcap", "--speed", 2, *config)
        assert done.exit_code == 0, done.output
        assert queue.get(timeout=PATIENCE) if heard_of else nothing(queue)


def test_a_watcher_s_stop_is_not_taken(folder: Path) -> None:
    stops: list[str] = []
    with (
        sessions(folder, "controller") as (session,),
        stop_key(session, "khepera", stops.append),
    ):
        refused = macor_hil("stop", "--zenoh-config", folder / "watcher.json5")
        assert isinstance(refused.exception, TelemetryError)
        assert not stops
        assert macor_hil("stop", "--zenoh-config", folder / "controller.json5").exit_code == 0
        assert stops


def test_a_watcher_cannot_reset_the_robot_or_look_at_its_truth(folder: Path) -> None:
    with sessions(folder, "emulator", "controller", "watcher") as (emulator, controller, watcher):

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply("khepera/khepera/reset", "done")

        with emulator.declare_queryable("khepera/khepera/reset", answer):
            while not list(controller.get("khepera/khepera/reset", timeout=PATIENCE)):
                pass  # until the router has heard of it
            assert not list(watcher.get("khepera/khepera/reset", timeout=SILENCE))


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("stranger", "refuses a program without certificate"),
        ("forger", "refuses this program's certificate, .*forged/watcher.pem"),
        ("doubter", "is not to be trusted by root_ca_certificate, .*forged/ca.pem: "),
        ("thief", "watcher.pem, and connect_private_key, .*emulator.key, are no pair"),
        ("lost", "nobody listens on tls/127.0.0.1:"),
        ("plain", "a program listens on tcp/127.0.0.1:.*, and does not let this one in"),
    ],
)
def test_who_gets_nothing_is_told_why(folder: Path, name: str, reason: str) -> None:
    config = folder / f"{name}.json5"
    with (
        pytest.raises(TelemetryError, match=f"{name}.json5 says: .*{reason}") as failure,
        open_session([], [], config),
    ):
        pass
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("opened", [open_session, emulator_session])
def test_a_file_that_cannot_be_used_is_named(
    tmp_path: Path, folder: Path, opened: Callable[..., Any]
) -> None:
    (tmp_path / "cake.json5").write_text("flour")
    text = (folder / "watcher.json5").read_text()
    for name, old in (("ca", "ca.pem"), ("key", "watcher.key")):
        (tmp_path / f"{name}.json5").write_text(text.replace(old, "nowhere"))
    for name, reason in (
        ("none", "none.json5: No such file"),
        ("cake", "cake.json5 says: .*expected"),
        ("ca", "its transport/link/tls/root_ca_certificate, .*nowhere: No such file"),
        ("key", "its transport/link/tls/connect_private_key, .*nowhere: No such file"),
    ):
        config = tmp_path / f"{name}.json5"
        refused = pytest.raises((TelemetryError, EmulatorError), match=reason)
        with refused, opened([], [], config):
            pass


def test_what_a_file_says_of_shared_memory_and_of_long_messages_does_not_count(
    tmp_path: Path,
) -> None:
    for name, text in (("yes", "true"), ("no", "false")):
        transport = f"{{shared_memory: {{enabled: {text}}}}}"
        file = tmp_path / f"{name}.json5"
        file.write_text(f"{{mode: 'peer', {QUIET}, transport: {transport}}}")
        config = read_configuration(file)
        assert config.get_json("transport/shared_memory/enabled") == "false"
        assert config.get_json("transport/link/rx/max_message_size") == str(MOST_MESSAGE)
