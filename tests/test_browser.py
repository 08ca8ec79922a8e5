"""The dashboard in a real browser; skipped where there is no Chromium with its driver."""

import json
import re
import shutil
import ssl
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from itertools import combinations
from pathlib import Path

import pytest
import zenoh
from as_type import as_type, not_none
from controller_helpers import a_decision, a_state, free_endpoint, wait_until_watched
from dashboard_process import PATIENCE, dashboard
from khepera_protocol.zenoh.controller_payloads import Phase
from khepera_protocol.zenoh.keys import CONTROLLER, EMULATOR
from khepera_protocol.zenoh.payloads import Outline, Reset
from selenium.webdriver import Chrome
from watching_helpers import a_life, json_event, truth

from macor_hil.monitor.dashboard.passwords import hash_password
from macor_hil.telemetry.examples import EXAMPLES
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
    options.add_argument("--host-resolver-rules=MAP lab.test 127.0.0.1")
    options.accept_insecure_certs = True
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


def shows(selector: str, number: int) -> Callable[[Chrome], bool]:
    def found(driver: Chrome) -> bool:
        return count(driver, selector) == number

    return found


def size(browser: Chrome, width: int, height: int) -> None:
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )


def test_a_robot_appears_drives_goes_and_comes_again(browser: Chrome) -> None:
    endpoint = free_endpoint()
    life = a_life()
    size(browser, 1280, 800)
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint, "--robot", "khepera") as address,
    ):
        visit(browser, address)
        until(browser, says("waiting for a robot"))
        wait_until_watched(session, "macor/khepera/decision", "khepera/khepera/truth")
        for _ in range(2):
            with Player(session, "khepera") as player:
                player.publish(life[0])
                until(browser, says("nobody drives"))
                driven = iter(range(4))
                for event in life[1:-2]:
                    player.publish(event)
                    # a watcher that cannot follow loses decisions, as it should
                    if isinstance(event, Arrival) and event.leaf == "state":
                        until(browser, says(f"driving, {next(driven)} of 40 commands"))
                until(browser, says("command 2: situation 17"))
                until(browser, shows("#plans [data-kind=best]", 1))
                until(browser, shows("#plans [data-kind=hypothesis]", 1))
                until(browser, shows("#columns i", 150))
                until(browser, shows("#columns i.now", 1))
                until(browser, shows("#profiles [data-kind=field]", 12))
                until(browser, shows("#rewards [data-kind=reward]", 3))
                until(browser, shows("#infrared [data-kind=sensor]", 8))
                until(browser, shows("#exchanges tr", 1))
                until(browser, lambda driver: driver.execute_script(PAINTED))
            until(browser, says("the robot has gone; last run vanished after 3 of 40 commands"))
            until(browser, shows("#plans [data-kind]", 0))
            until(browser, shows("#camera-card[data-stale]", 1))
        errors = [each for each in browser.get_log("browser") if each["level"] == "SEVERE"]
    assert errors == []
    assert hosts(browser) == {"127.0.0.1"}


PAINTED = """
const canvas = document.getElementById("panorama");
const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
return data.some((value) => value > 0);
"""
"""Tells whether the panorama was unwrapped in the browser."""


BROKEN = """
from macor_hil.monitor.dashboard.drawings import charts
def infrared(form, readings):
    raise ZeroDivisionError("a defect")
charts.infrared = infrared
from macor_hil.cli import main
main()
"""


def test_a_page_whose_drawing_fails_says_so(browser: Chrome) -> None:
    with dashboard("--connect", free_endpoint(), code=BROKEN) as address:
        visit(browser, address)
        until(browser, says("please report it: ZeroDivisionError"))


def hosts(browser: Chrome) -> set[str]:
    """Return the hosts that the page asked for anything."""
    log = "".join(each["message"] for each in browser.get_log("performance"))
    return set(re.findall(r'"url":"(?:https?|wss?)://([^:/"]+)', log))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from macor_hil.telemetry.recordings.recording import Recorder

    life = a_life(60)
    hit = next(k for k, event in enumerate(life) if getattr(event, "leaf", "") == "decision")
    life[hit] = json_event(CONTROLLER, "decision", a_decision(0, collided=True), 1.8)
    path = tmp_path_factory.mktemp("recording") / "drive.mcap"
    with Recorder(path, "khepera") as recorder:
        for event in life:
            recorder.write(event)
    return path


@pytest.fixture(scope="module")
def played(recording: Path) -> Iterator[str]:
    """The address of a dashboard that plays a recording."""
    with dashboard(str(recording)) as address:
        yield address


def plays(driver: Chrome) -> bool:
    return bool(
        driver.execute_script("return document.getElementById('play').innerText === 'Pause'")
    )


def test_every_page_plays_a_recording_for_itself(browser: Chrome, played: str) -> None:
    visit(browser, played)
    until(browser, says("of 40 commands"))
    first = browser.current_window_handle
    browser.execute_script("document.getElementById('play').click()")
    until(browser, lambda driver: not plays(driver))
    browser.switch_to.new_window("tab")
    visit(browser, played)
    until(browser, says("of 40 commands"))
    assert plays(browser)
    browser.close()
    browser.switch_to.window(first)
    assert not plays(browser)


def test_a_recording_is_scrubbed_by_keyboard(browser: Chrome, played: str) -> None:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.select import Select

    def press(key: str) -> None:
        ActionChains(browser).send_keys(key).perform()

    visit(browser, played)
    until(browser, says("of 40 commands"))
    press(Keys.SPACE)
    until(browser, lambda driver: not plays(driver))
    press(Keys.HOME)
    until(browser, says("0.0 / 61.0 s"))
    for _ in range(3):
        press(Keys.ARROW_RIGHT)
    until(browser, says("3.0 / 61.0 s"))
    until(browser, says("command 1: situation 17"))
    press("p")  # a second before the collision
    until(browser, says("0.8 / 61.0 s"))
    assert count(browser, "#moments i.collision") == 1
    press(Keys.END)
    until(browser, says("61.0 / 61.0 s"))
    until(browser, says("the robot has gone"))
    Select(browser.find_element("id", "speed")).select_by_value("16")
    until(browser, lambda driver: '"speed":16.0' in sent(driver))


def sent(browser: Chrome) -> str:
    """Return what came over WebSockets since the last look."""
    messages = [json.loads(each["message"])["message"] for each in browser.get_log("performance")]
    frames = [each for each in messages if each["method"] == "Network.webSocketFrameReceived"]
    return "".join(frame["params"]["response"]["payloadData"] for frame in frames)


def measures(browser: Chrome) -> tuple[int, int]:
    """Return the width and height of all that there is."""
    script = "const e = document.documentElement; return [e.scrollWidth, e.scrollHeight]"
    width, height = browser.execute_script(script)
    return width, height


@pytest.mark.parametrize(
    ("width", "height"), [(1280, 800), pytest.param(1920, 1080, marks=pytest.mark.long)]
)
def test_everything_is_seen_at_once(browser: Chrome, played: str, width: int, height: int) -> None:
    size(browser, width, height)
    visit(browser, played)
    until(browser, says("situation 17"))
    assert measures(browser) == (width, height)
    assert browser.execute_script(SCROLLED) == []
    assert text_sizes(browser) == {13 if width == 1280 else 15}


SCROLLED = """
return [...document.querySelectorAll(".lane")].filter((e) => e.scrollHeight > e.clientHeight);
"""

SIZES = """
const seen = [...document.querySelectorAll("main *, header *")].filter((e) => {
  const text = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  return text && e.getClientRects().length && !["title", "OPTION"].includes(e.tagName);
});
return seen.map((e) => {
  const drawing = e.closest("svg");
  const size = parseFloat(getComputedStyle(e).fontSize);
  return Math.round(drawing ? size * drawing.getScreenCTM().a : size);
});
"""


def text_sizes(browser: Chrome) -> set[int]:
    """Return the sizes in pixels of all text that is seen, also of that in drawings."""
    return set(browser.execute_script(SIZES))


def test_a_phone_shows_cards_one_below_the_other_and_some_folded(
    browser: Chrome, played: str
) -> None:
    size(browser, 400, 860)
    visit(browser, played)
    until(browser, says("situation 17"))
    assert measures(browser)[0] <= 400
    tops = browser.execute_script(
        "return [...document.querySelectorAll('.card')].filter(c => c.offsetParent)"
        ".map(c => c.getBoundingClientRect().top)"
    )
    assert len(set(tops)) == len(tops)
    assert count(browser, "details.card:not([open])") >= 4
    size(browser, 1280, 800)  # turned, or moved to a larger screen
    until(browser, shows("#columns-card[open]", 1))
    size(browser, 400, 860)
    until(browser, shows("#columns-card[open]", 0))
    browser.execute_script("document.querySelector('#columns-card summary').click()")
    until(browser, shows("#columns-card[open]", 1))
    assert measures(browser)[0] <= 400


AXE = """
const done = arguments[arguments.length - 1];
const told = (fault) => fault.id + ": " + fault.nodes.map((node) => node.target).join(", ");
axe.run().then((found) => done(found.violations.map(told)));
"""


@pytest.mark.parametrize("scheme", ["dark", pytest.param("light", marks=pytest.mark.long)])
def test_an_accessibility_checker_finds_no_fault(browser: Chrome, played: str, scheme: str) -> None:
    axe = pytest.importorskip("axe_core_python")
    size(browser, 1280, 800)
    feature = {"name": "prefers-color-scheme", "value": scheme}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
    visit(browser, played)
    until(browser, says("situation 17"))
    browser.execute_script("document.getElementById('play').click()")
    until(browser, lambda driver: not plays(driver))
    source = (Path(axe.__file__).parent / "axe.min.js").read_text("utf-8")
    browser.execute_cdp_cmd("Runtime.evaluate", {"expression": source})
    assert browser.execute_async_script(AXE) == []


def test_a_robot_is_placed_with_the_mouse(browser: Chrome) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    endpoint = free_endpoint()
    asked: list[Reset] = []
    size(browser, 1280, 800)
    connect = ("--connect", endpoint, "--robot", "khepera")
    with open_session([endpoint], []) as session, Player(session, "khepera") as player:

        def answer(query: zenoh.Query) -> None:
            with query:
                asked.append(Reset.parse(not_none(query.payload).to_bytes()))
                query.reply(query.key_expr, truth(9.0, 0.3).model_dump_json())

        with (
            session.declare_queryable("khepera/khepera/reset", answer),
            dashboard(*connect, "--allow-control") as address,
        ):
            for event in a_life()[:3]:
                player.publish(event)
            visit(browser, address)
            until(browser, shows("#bodies [data-kind=robot]", 1))
            # an empty field is no zero: nothing is asked for
            field = browser.find_element("css selector", "input[aria-label='x, cm']")
            field.clear()
            browser.find_element("xpath", "//button[text()='Place']").click()
            assert browser.switch_to.active_element == field
            browser.find_element("xpath", "//button[text()='With the mouse']").click()
            arena = browser.find_element("id", "arena")
            drag = ActionChains(browser).move_to_element(arena).click_and_hold()
            drag.move_by_offset(0, -40).release().perform()
            until(browser, says("khepera stands at x 30.0 cm, y 0.0 cm"))
    (reset,) = asked
    assert not_none(reset.pose).heading == pytest.approx(1.5708, abs=0.01)


NAMES = """
return [...document.querySelectorAll("#bodies text")].map((e) => {
  const { left, right, top, bottom } = e.getBoundingClientRect();
  return [left, right, top, bottom];
});
"""


def test_names_of_robots_that_stand_close_can_all_be_read(browser: Chrome) -> None:
    endpoint = free_endpoint()
    room = as_type(Outline, EXAMPLES[Outline]).model_copy(update={"world": "of three"})
    size(browser, 1280, 800)
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint) as address,
        ExitStack() as stack,
    ):
        for k in range(3):
            player = stack.enter_context(Player(session, f"khepera-{k}"))
            player.publish(a_life()[0])
            player.publish(json_event(EMULATOR, "arena", room, 0.1))
            player.publish(json_event(EMULATOR, "truth", truth(0.2, 0.1 + 0.06 * k), 0.2))
        visit(browser, address)
        until(browser, shows("#bodies text", 3))
        boxes = browser.execute_script(NAMES)
        for first, second in combinations(boxes, 2):
            apart = first[1] <= second[0] or second[1] <= first[0]
            assert apart or first[3] <= second[2] or second[3] <= first[2]


REASON = "no answer from the robot at rfc2217://127.0.0.1:4003 in 0.6 s; " * 8


@pytest.mark.parametrize("width", [1280, 400])
def test_the_reason_of_a_failure_is_read_in_full(browser: Chrome, width: int) -> None:
    endpoint = free_endpoint()
    size(browser, width, 800)
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint, "--robot", "khepera") as address,
        Player(session, "khepera") as player,
    ):
        for event in a_life()[:6]:
            player.publish(event)
        failed = a_state(Phase.FAILED, reason=REASON)
        player.publish(json_event(CONTROLLER, "state", failed, 0.8))
        visit(browser, address)
        until(browser, says(REASON.strip()))
        assert browser.find_element("id", "driver").text == "controller failed, 3 of 40 commands"
        assert browser.find_element("id", "driver").size["height"] < 30  # one line
        assert measures(browser)[0] <= width
        assert width == 400 or measures(browser)[1] == 800


@pytest.mark.long
def test_a_password_opens_the_page(browser: Chrome) -> None:
    hashed = hash_password("open sesame")
    with dashboard("--connect", free_endpoint(), "--password-hash", hashed) as address:
        visit(browser, address)
        log_in(browser, "wrong")
        log_in(browser, "open sesame")
        until(browser, says("waiting for a robot"))


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    """A certificate that nobody has signed, and its key."""
    files = tmp_path / "lab.pem", tmp_path / "lab.key"
    subject = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"]
    key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes"]
    out = ["-out", str(files[0]), "-keyout", str(files[1])]
    subprocess.run(
        ["openssl", "req", "-x509", "-days", "2", *key, *subject, *out],
        check=True,
        capture_output=True,
    )
    return files


OPENS = """
const [address, done] = arguments;
// what the page's own policy forbids is never sent, and never closed
document.addEventListener("securitypolicyviolation", () => done("kept in"));
const socket = new WebSocket(address);
socket.onopen = () => done("open");
socket.onclose = () => done("closed");
"""
"""Tells whether a WebSocket of the present page is let in, or even gets out of the page."""


class Elsewhere(BaseHTTPRequestHandler):
    """A page that may connect to anything, of another program on this machine."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html>elsewhere")

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def elsewhere(certificate: tuple[Path, Path]) -> Iterator[str]:
    """Serve a page of another program over TLS; gives its address."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*certificate)
    with ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere) as server:
        server.socket = context.wrap_socket(server.socket, server_side=True)
        thread = threading.Thread(target=server.serve_forever, args=(0.05,))
        thread.start()
        try:
            yield f"https://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.long
@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")
def test_a_page_over_tls_shows_live_data_to_who_knows_the_password(
    browser: Chrome, certificate: tuple[Path, Path]
) -> None:
    endpoint = free_endpoint()
    doors = ["--password-hash", hash_password("open sesame")]
    doors += ["--certificate", str(certificate[0]), "--key", str(certificate[1])]
    size(browser, 1280, 800)
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint, "--robot", "khepera", *doors) as address,
        Player(session, "khepera") as player,
    ):
        browser.delete_all_cookies()
        assert address.startswith("https://127.0.0.1:")
        live = f"{address.replace('https', 'wss')}/live"
        visit(browser, f"{address}/login")
        # its own page, without the password
        assert browser.execute_async_script(OPENS, live) == "closed"
        log_in(browser, "wrong")
        until(browser, says("That is not the password"))
        assert not browser.get_cookies()
        log_in(browser, "open sesame")
        until(browser, says("waiting for a robot"))
        (cookie,) = browser.get_cookies()
        assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, "Strict")
        for event in a_life(1)[:-2]:
            player.publish(event)
        until(browser, says("driving, 1 of 40 commands"))
        until(browser, lambda driver: driver.execute_script(PAINTED))
        assert browser.execute_async_script(OPENS, live) == "open"
        # its own page, to another program
        with elsewhere(certificate) as other:
            there = other.replace("https", "wss")
            assert browser.execute_async_script(OPENS, there) == "kept in"
            # from a page of elsewhere, which the browser sends the cookie for: cookies know no port
            visit(browser, other)
            until(browser, says("elsewhere"))
            assert [each["name"] for each in browser.get_cookies()] == [cookie["name"]]
            assert browser.execute_async_script(OPENS, live) == "closed"
        # by another name that leads here
        visit(browser, address.replace("127.0.0.1", "lab.test"))
        until(browser, says("not for this page or name"))


def log_in(browser: Chrome, password: str) -> None:
    from selenium.webdriver.support.expected_conditions import staleness_of

    until(browser, shows("input[type=password]", 1))
    field = browser.find_element("id", "password")
    field.send_keys(password)
    field.submit()
    until(browser, staleness_of(field))
