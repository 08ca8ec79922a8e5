"""The dashboard in a real browser; skipped where there is no Chromium with its driver."""

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from as_type import not_none
from controller_helpers import free_endpoint, wait_until_watched
from dashboard_process import PATIENCE, dashboard
from selenium.webdriver import Chrome
from watching_helpers import a_life

from macor_hil.telemetry.feed import Arrival
from macor_hil.telemetry.recordings.player import Player
from macor_hil.telemetry.session import open_session

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="no Chromium with chromedriver on this machine"
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Chrome]:
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = not_none(CHROMIUM)
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    service = webdriver.ChromeService(executable_path=DRIVER)
    with webdriver.Chrome(options=options, service=service) as driver:
        driver.implicitly_wait(0)
        yield driver


def visit(browser: Chrome, address: str) -> None:
    """Open a page as soon as it is served."""
    from selenium.common.exceptions import WebDriverException

    def opened(driver: Chrome) -> bool:
        try:
            driver.get(address)
        except WebDriverException:
            return False
        return True

    until(browser, opened)


def until(browser: Chrome, condition: Callable[[Chrome], object]) -> object:
    from selenium.webdriver.support.wait import WebDriverWait

    return WebDriverWait(browser, PATIENCE, poll_frequency=0.1).until(condition)


def says(text: str) -> Callable[[Chrome], bool]:
    def found(driver: Chrome) -> bool:
        said: str = driver.execute_script("return document.body ? document.body.innerText : ''")
        return text in said

    return found


def count(driver: Chrome, selector: str) -> int:
    script = "return document.querySelectorAll(arguments[0]).length"
    number: int = driver.execute_script(script, selector)
    return number
    return number


def shows(selector: str, number: int) -> Callable[[Chrome], bool]:
    def found(driver: Chrome) -> bool:
        return count(driver, selector) == number

    return found


def test_a_robot_appears_drives_goes_and_comes_again(browser: Chrome) -> None:
    endpoint = free_endpoint()
    life = a_life()
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint) as address,
    ):
        visit(browser, address)
        until(browser, says("waiting for a robot"))
        wait_until_watched(session, "macor/khepera/decision", "khepera/khepera/truth")
        for _ in range(2):
            with Player(session, "khepera") as player:
                player.publish(life[0])
                until(browser, says("robot there, nobody drives it"))
                driven = iter(range(4))
                for event in life[1:-2]:
                    player.publish(event)
                    # a watcher that cannot follow loses decisions, as it should
                    if isinstance(event, Arrival) and event.leaf == "state":
                        until(browser, says(f"driving, {next(driven)} of 40 commands"))
                until(browser, says("command 2: situation 17"))
                until(browser, shows(".arena [data-kind=best]", 1))
                until(browser, shows(".arena [data-kind=hypothesis]", 1))
                until(browser, shows("[data-kind=neuron]", 150))
                until(browser, shows("[data-kind=field]", 12))
                until(browser, shows("[data-kind=reward]", 3))
                until(browser, shows("[data-kind=sensor]", 8))
                until(browser, says("> H"))
            until(browser, says("waiting for a robot"))
        errors = [each for each in browser.get_log("browser") if each["level"] == "SEVERE"]
    assert [each for each in errors if "favicon" not in each["message"]] == []
    assert hosts(browser) == {"127.0.0.1"}


BROKEN = """
import sys
from macor_hil.monitor.dashboard import charts
def infrared(readings):
    raise ZeroDivisionError("a defect")
charts.infrared = infrared
from macor_hil.cli import main
main()
"""


def test_a_page_whose_drawing_fails_says_so(browser: Chrome) -> None:
    with dashboard("--connect", free_endpoint(), code=BROKEN) as address:
        visit(browser, address)
        until(browser, says("the page failed 1 times, please report it: ZeroDivisionError"))
        assert says("waiting for a robot")(browser)


def test_every_page_plays_a_recording_for_itself(browser: Chrome, recording: Path) -> None:
    with dashboard(str(recording)) as address:
        visit(browser, address)
        until(browser, says("of 40 commands"))
        first = browser.current_window_handle
        browser.execute_script("document.querySelector('button').click()")
        until(browser, lambda driver: "PLAY" in text_of_button(driver).upper())
        browser.switch_to.new_window("tab")
        visit(browser, address)
        until(browser, says("of 40 commands"))
        assert "PAUSE" in text_of_button(browser).upper()
        browser.close()
        browser.switch_to.window(first)
        assert "PLAY" in text_of_button(browser).upper()


def hosts(browser: Chrome) -> set[str]:
    """Return the hosts that the page asked for anything."""
    log = "".join(each["message"] for each in browser.get_log("performance"))
    return set(re.findall(r'"url":"(?:https?|wss?)://([^:/"]+)', log))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from macor_hil.telemetry.recordings.recording import Recorder

    path = tmp_path_factory.mktemp("recording") / "drive.mcap"
    with Recorder(path, "khepera") as recorder:
        for event in a_life(60):
            recorder.write(event)
    return path


def test_a_recording_is_scrubbed_by_keyboard(browser: Chrome, recording: Path) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    def press(key: str) -> None:
        ActionChains(browser).send_keys(key).perform()

    with dashboard(str(recording)) as address:
        visit(browser, address)
        until(browser, says("of 40 commands"))
        press(Keys.SPACE)
        until(browser, lambda driver: "PLAY" in text_of_button(driver).upper())
        press(Keys.HOME)
        until(browser, says("0.0 / 61.0 s"))
        for _ in range(3):
            press(Keys.ARROW_RIGHT)
        until(browser, says("3.0 / 61.0 s"))
        until(browser, says("command 1: situation 17"))
        press(Keys.ARROW_LEFT)
        until(browser, says("2.0 / 61.0 s"))
        until(browser, says("command 0: situation 17"))
        press(Keys.END)
        until(browser, says("61.0 / 61.0 s"))
        until(browser, says("waiting for a robot"))


def text_of_button(driver: Chrome) -> str:
    text: str = driver.execute_script("return document.querySelector('button').innerText")
    return text


@pytest.mark.parametrize("width", [360, 1500])
def test_nothing_is_wider_than_the_screen(browser: Chrome, recording: Path, width: int) -> None:
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False},
    )
    with dashboard(str(recording)) as address:
        visit(browser, address)
        until(browser, says("situation 17"))
        wide = browser.execute_script("return document.documentElement.scrollWidth")
        cards = browser.execute_script(
            "return [...document.querySelectorAll('.card')].map(c => c.getBoundingClientRect().top)"
        )
    assert wide <= width
    # one below the other on a narrow screen, side by side on a wide one
    assert (len(set(cards)) == len(cards)) == (width == 360)
