"""A recording and its layout in Foxglove Studio itself; skipped where `make viewer` was not run."""

import json
import re
import shutil
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from khepera_protocol.zenoh.controller_payloads import Decision
from mcap.writer import Writer
from selenium.webdriver import Chrome
from watching_helpers import a_life

from macor_hil.telemetry.recordings.recording import Recorder
from macor_hil.telemetry.viewers.layout import layout

VIEWER = Path(__file__).parent / "viewer"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
PATIENCE = 90.0

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(300),
    pytest.mark.skipif(
        not (CHROMIUM and DRIVER and (VIEWER / "node_modules").exists()),
        reason="no Chromium with chromedriver, or no viewer: make viewer",
    ),
]


class Server(SimpleHTTPRequestHandler):
    """Serves the viewer, and a folder beside it; of files also parts, which the viewer asks for."""

    def __init__(self, *arguments: object, made: Path, **more: object) -> None:
        self._made = made
        super().__init__(*arguments, directory=str(VIEWER), **more)  # type: ignore[arg-type]

    def translate_path(self, path: str) -> str:
        made = self._made / path.partition("?")[0].lstrip("/")
        return str(made) if made.is_file() else super().translate_path(path)

    def log_message(self, *_: object) -> None:
        pass

    def end_headers(self) -> None:
        self.send_header("Accept-Ranges", "bytes")
        super().end_headers()

    def do_GET(self) -> None:
        file = Path(self.translate_path(self.path))
        part = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        if not part or not file.is_file():
            super().do_GET()
            return
        data = file.read_bytes()
        begin, end = int(part[1]), int(part[2] or len(data) - 1)
        piece = data[begin : end + 1]
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {begin}-{begin + len(piece) - 1}/{len(data)}")
        self.send_header("Content-Length", str(len(piece)))
        self.end_headers()
        self.wfile.write(piece)


@pytest.fixture
def shown(tmp_path: Path) -> Iterator[Callable[[str], Chrome]]:
    """Opens a recording of the test's folder in a browser, with the layout."""
    from selenium import webdriver

    (tmp_path / "layout.json").write_text(json.dumps(layout("khepera")))
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Server, made=tmp_path))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for argument in (
        *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,900"),
        *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    ):
        options.add_argument(argument)
    service = webdriver.ChromeService(executable_path=DRIVER)
    with webdriver.Chrome(options=options, service=service) as driver:
        here = f"http://127.0.0.1:{server.server_port}"

        def show(file: str) -> Chrome:
            driver.get(f"{here}/index.html?ds=remote-file&ds.url={here}/{file}")
            return driver

        yield show
    server.shutdown()
    server.server_close()


def wait_for(driver: Chrome, condition: Callable[[str], bool]) -> str:
    """The page's text, once it is as wanted."""
    from selenium.webdriver.support.wait import WebDriverWait

    said = [""]

    def met(_: Chrome) -> bool:
        said[0] = driver.execute_script("return document.body ? document.body.innerText : ''")
        return condition(said[0])

    WebDriverWait(driver, PATIENCE, poll_frequency=0.5).until(met, f"{said[0]}")
    return said[0]


def problems(driver: Chrome) -> str:
    """The text of the viewer while it lists problems."""
    script = (
        "[...document.querySelectorAll('button')].find(b => b.innerText.startsWith('Problems'))"
    )
    driver.execute_script(f"{script}.click()")
    return wait_for(driver, lambda said: "Problems" in said)


def test_a_recording_opens_with_its_layout_and_no_problem(
    tmp_path: Path, shown: Callable[[str], Chrome]
) -> None:
    with Recorder(tmp_path / "drive.mcap", "khepera") as recorder:
        for event in a_life(5):
            recorder.write(event)
    driver = shown("drive.mcap")
    said = wait_for(
        driver, lambda said: "macor.Decision" in said and "foxglove/khepera/plan" in said
    )
    for title in ("Arena", "Camera", "Reinforcement", "Infrared", "Run"):
        assert title in said
    assert "Unknown panel type" not in said
    assert "No issues found" in problems(driver) or "No problems" in problems(driver)


def test_a_schema_that_it_cannot_read_is_a_problem(
    tmp_path: Path, shown: Callable[[str], Chrome]
) -> None:
    schema = json.dumps(Decision.model_json_schema()).encode()  # with references
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        number = writer.register_schema("macor.Decision", "jsonschema", schema)
        channel = writer.register_channel("macor/khepera/decision", "json", number)
        writer.add_message(channel, log_time=1, data=b"{}", publish_time=1)
        writer.finish()
    driver = shown("drive.mcap")
    wait_for(driver, lambda said: "Problems\n1" in said)
    assert "macor/khepera/decision" in problems(driver)
