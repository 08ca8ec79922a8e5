"""Takes the dashboard's pictures: python docs/dashboard_pictures.py runs/corridor.npz FOLDER.

Needs Chromium with its driver and the extra `test`. The map is one of the corridor, as of
`make run`. Emulated robots drive meanwhile: one by this map, and four in an arena with toys, of
which other programs drive two. Every picture is taken as soon as the page says what it waits for.
"""

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import serial
from selenium import webdriver
from selenium.webdriver.support.wait import WebDriverWait

EMULATOR: Final = "tcp/127.0.0.1:17457"
CONTROLLER: Final = "tcp/127.0.0.1:17458"
_PATIENCE: Final = 120.0


class Screen(NamedTuple):
    """A screen: its size in pixels, and whether it is dark; height 0: as high as the page."""

    width: int
    height: int
    scheme: str = "dark"


_LATER: Final = r"\b[1-5]\d of 60 commands"
"""Ten commands have been driven, or more."""

LAPTOP: Final = Screen(1280, 800)


@contextmanager
def program(*words: str) -> Iterator[str]:
    """Run a program until the end of the context, in the present folder; gives its first line."""
    command = [sys.executable, "-u", "-m", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        finally:
            process.terminate()
            process.communicate()


@contextmanager
def dashboard(*words: str) -> Iterator[str]:
    """Serve the dashboard; gives its address."""
    with program("macor_hil.cli", "dashboard", "--port", "0", *words) as address:
        yield address


@contextmanager
def wanderer(terminal: Path) -> Iterator[None]:
    """Drive a robot by a program that knows nothing of this project: on, and away from walls."""
    over = threading.Event()

    def drive() -> None:
        with serial.Serial(str(terminal), 9600, timeout=1.0) as port:

            def ask(request: str) -> list[int]:
                port.write(f"{request}\n".encode())
                words = port.readline().decode(errors="replace").strip().split(",")[1:]
                return [int(word) for word in words if word.lstrip("-").isdigit()]

            ask("L,0,1")
            while not over.wait(0.05):
                near = max(ask("N")[1:5], default=0) > 200
                ask("D,-3,3" if near else "D,4,4")
                ask("H")
            ask("D,0,0")

    thread = threading.Thread(target=drive)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def take(path: Path, address: str, words: str, screen: Screen = LAPTOP) -> None:
    """Take a picture of a page once it says something, given as a regular expression."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or shutil.which("chromium-browser") or ""
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    with webdriver.Chrome(options=options, service=service) as browser:
        _resize(browser, screen.width, screen.height or 900)
        feature = {"name": "prefers-color-scheme", "value": screen.scheme}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        browser.get(address)
        waiting = WebDriverWait(browser, _PATIENCE)
        waiting.until(lambda seen: re.search(words, seen.find_element("tag name", "body").text))
        if not screen.height:
            height = browser.execute_script("return document.documentElement.scrollHeight")
            _resize(browser, screen.width, height)
        browser.save_screenshot(str(path))


def _resize(browser: webdriver.Chrome, width: int, height: int) -> None:
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def one_robot(folder: Path) -> None:
    """Take pictures of a robot that a controller drives, and of the drive's recording."""
    link, recorded = Path("runs/khepera"), Path("runs/drive.mcap")
    connect = ("--connect", EMULATOR, "--connect", CONTROLLER)
    with ExitStack() as stack:
        emulator = ("khepera_emulator.app.cli", "run", "--link", str(link), "--listen", EMULATOR)
        stack.enter_context(program(*emulator))
        address = stack.enter_context(dashboard(*connect))
        with ExitStack() as recorder:
            command = [sys.executable, "-m", "macor_hil.cli", "record", str(recorded), *connect]
            recording = recorder.enter_context(subprocess.Popen(command))
            recorder.callback(recording.terminate)
            run = ("run", "--port", str(link), "--camera", "zenoh", "--map", "runs/corridor.npz")
            drive = (
                *run,
                "--connect",
                EMULATOR,
                "--listen",
                CONTROLLER,
                "--planner",
                "anticipative",
                "--camera-limit",
                "0",
            )
            recorder.enter_context(program("macor_hil.cli", *drive, "--commands", "60"))
            take(folder / "dashboard.png", address, _LATER)
            take(folder / "dashboard-light.png", address, _LATER, Screen(1920, 1080, "light"))
            take(folder / "dashboard-narrow.png", address, _LATER, Screen(400, 0))
    with dashboard(str(recorded)) as address:
        take(folder / "dashboard-recording.png", address, _LATER)


def four_robots(folder: Path) -> None:
    """Take a picture of four robots, two driven by other programs, and the card to steer."""
    link = Path("runs/toy")
    robots = ("--robots", "4", "--arena", "toys", "--link", str(link), "--listen", EMULATOR)
    with (
        program("khepera_emulator.app.cli", "run", *robots),
        dashboard("--connect", EMULATOR, "--allow-control") as address,
        wanderer(Path("runs/toy-2")),
        wanderer(Path("runs/toy-3")),
    ):
        chosen = f"{address}/?robot=khepera-2"
        take(folder / "dashboard-robots.png", chosen, "another program drives")


def main() -> None:
    """Take all pictures."""
    map_file, folder = (Path(word).absolute() for word in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as work, contextlib.chdir(work):
        Path("runs").mkdir()
        shutil.copy(map_file, "runs/corridor.npz")
        one_robot(folder)
        four_robots(folder)


if __name__ == "__main__":
    main()
