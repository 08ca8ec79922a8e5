"""The dashboard's page: only browsers on this machine use it, and only its own scripts."""

import base64
import http.client
import json
import os
import socket
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from as_type import not_none
from controller_helpers import free_endpoint, wait_until_watched
from dashboard_process import PATIENCE, dashboard
from hostile_inputs import Hostile
from hypothesis import given, settings
from hypothesis import strategies as st
from khepera_protocol.zenoh.controller_payloads import Learned
from khepera_protocol.zenoh.keys import KEYS

from macor_hil.monitor.dashboard.access import LOOPBACK, is_ours
from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.session import open_session

SOCKET = "/live"
PATHS = ["/", SOCKET, "/page.js", "/login", "/nowhere"]
STRANGERS = [
    "evil.example",
    "evil.example:{port}",
    "127.0.0.1.evil.example:{port}",
    "localhost.evil.example",
    "evil-localhost:{port}",
    "127.0.0.1@evil.example:{port}",
    "192.168.1.2:{port}",
    "[::2]:{port}",
    "0.0.0.0:{port}",
    "127.0.0.1:{port}:80",
    "localhost:",
    "localhost:port",
    "",
]
OURS = ["127.0.0.1:{port}", "localhost:{port}", "[::1]:{port}", "LOCALHOST:9000", "localhost"]


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with dashboard("--connect", "tcp/127.0.0.1:9") as address:
        number = not_none(urlsplit(address).port)
        wait_for(number)
        yield number


def test_samples_of_no_robot_neither_stop_nor_swell_the_dashboard(hostile: Hostile) -> None:
    endpoint = free_endpoint()
    value = json.loads(EXAMPLES[Learned].model_dump_json())
    value["fields"]["sectors"] = 100_000
    sectors = json.dumps(value)
    keys = [f"{key.side}/khepera/{key.leaf}" for key in KEYS if key.published]
    evil = [
        (key, data)
        for key in (*keys, "**", "macor/**", "khepera/*/truth")
        for data in (sectors, "{}", "[" * 100_000, "9" * 100_000, "\x1b[2J", b"\xff" * 1000)
    ]
    with (
        open_session([endpoint], []) as session,
        dashboard("--connect", endpoint, "--robot", "khepera") as address,
    ):
        wait_until_watched(session, "macor/khepera/map")
        number = not_none(urlsplit(address).port)
        wait_for(number)
        for key, data in evil:
            hostile.count("page")
            session.put(key, data)
        status, body = ask(number, "/", [f"127.0.0.1:{number}"])
        assert (status, b"macor-hil" in body) == (200, True)
        assert open_websocket(number, f"127.0.0.1:{number}") == 101


def wait_for(port: int) -> None:
    """Return when the page is served."""
    end = time.monotonic() + PATIENCE
    while socket.socket().connect_ex(("127.0.0.1", port)):
        assert time.monotonic() < end


def ask(
    port: int, path: str, hosts: list[str], method: str = "GET", **headers: str
) -> tuple[int, bytes]:
    """Status of a request with these Host headers, and what came."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    for host in hosts:
        connection.putheader("Host", host)
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def open_websocket(port: int, host: str, origin: str | None = None) -> int:
    """Status line of a WebSocket's handshake, without any library between."""
    lines = [
        f"GET {SOCKET} HTTP/1.1",
        f"Host: {host}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}",
        "Sec-WebSocket-Version: 13",
        *([f"Origin: {origin}"] if origin else []),
    ]
    with socket.create_connection(("127.0.0.1", port), PATIENCE) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        return int(connection.recv(64).split()[1])


@pytest.mark.parametrize("host", OURS)
def test_pages_of_this_machine_are_served(port: int, host: str) -> None:
    here = host.format(port=port)
    status, body = ask(port, "/", [here])
    assert (status, b"macor-hil" in body) == (200, True)
    assert ask(port, "/page.js", [here], Origin=f"http://{here.lower()}")[0] == 200
    assert open_websocket(port, here) == 101
    assert open_websocket(port, here, f"http://{here.lower()}") == 101


@pytest.mark.parametrize("host", STRANGERS)
def test_a_name_that_leads_here_gets_nothing(port: int, host: str, hostile: Hostile) -> None:
    there = host.format(port=port)
    for path in PATHS:
        hostile.count("page")
        status, body = ask(port, path, [there])
        assert (status, b"not for this page" in body) == (403, True), path
    if there:
        assert open_websocket(port, there) == 403
        assert open_websocket(port, there, f"http://{there}") == 403


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "http://evil.example:{port}",
        "http://localhost:3000",
        "http://127.0.0.1",
        "http://localhost:{port}",  # asked as 127.0.0.1: another page all the same
        "null",
        "file://",
        "https://evil.example",
        "http://127.0.0.1:{port}.evil.example",
        "http://127.0.0.1:{port} http://evil.example",
    ],
)
def test_a_page_from_elsewhere_gets_nothing(port: int, origin: str, hostile: Hostile) -> None:
    here, there = f"127.0.0.1:{port}", origin.format(port=port)
    for path in PATHS:
        for method in ("GET", "POST", "OPTIONS"):
            hostile.count("page")
            assert ask(port, path, [here], method, Origin=there)[0] == 403
    assert open_websocket(port, here, there) == 403


def test_requests_without_a_name_or_with_two_get_nothing(port: int, hostile: Hostile) -> None:
    here = f"127.0.0.1:{port}"
    for hosts in ([], [here, "evil.example"], ["evil.example", here], [here, here]):
        hostile.count("page")
        assert ask(port, "/", hosts)[0] in (400, 403)
    hostile.count("page")
    with socket.create_connection(("127.0.0.1", port), PATIENCE) as connection:
        connection.sendall(b"GET / HTTP/1.0\r\n\r\n")
        assert connection.recv(64).split()[1] in (b"400", b"403")


def test_a_forwarded_host_does_not_count(port: int, hostile: Hostile) -> None:
    for name in ("X-Forwarded-Host", "Forwarded", "X-Host"):
        hostile.count("page")
        assert ask(port, "/", ["evil.example"], **{name: f"127.0.0.1:{port}"})[0] == 403


def test_names_and_origins_of_every_making(hostile: Hostile) -> None:
    texts = st.text(st.sampled_from("localhost127.:[]@/\\ \t\x00é%0"), max_size=24)
    names = st.one_of(
        texts, st.sampled_from(sorted(LOOPBACK)), st.builds("{}:{}".format, texts, texts)
    )

    @settings(max_examples=hostile.examples(300))
    @given(st.lists(names, max_size=2), st.lists(names, max_size=2))
    def passed_or_refused(hosts: list[str], origins: list[str]) -> None:
        hostile.count("page")
        headers = [(b"host", host.encode("latin-1")) for host in hosts]
        headers += [(b"origin", f"http://{origin}".encode("latin-1")) for origin in origins]
        if is_ours(headers):
            (host,) = hosts
            name = (
                host.lower().removesuffix(":" + host.rpartition(":")[2])
                if (not host.endswith("]"))
                else host.lower()
            )
            assert name in LOOPBACK or host.lower() in LOOPBACK
            assert all(origin.lower() == host.lower() for origin in origins)

    passed_or_refused()
