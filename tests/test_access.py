"""The dashboard's guard: passwords, sessions, and the options that others' reach takes."""

import asyncio
import re
from collections.abc import Mapping
from typing import Any

import pytest
from khepera_protocol.options import OptionError
from pydantic import ValidationError

from macor_hil.cli.watching import DashboardOptions
from macor_hil.monitor.dashboard import access as door
from macor_hil.monitor.dashboard.access import LOOPBACK, Access, Receive, Scope, Send
from macor_hil.monitor.dashboard.passwords import hash_password, is_hash, is_password

PASSWORD = "correct horse"
HASH = hash_password(PASSWORD)
HOST = "127.0.0.1:8080"
NAMES = LOOPBACK | {"lab.example.org"}


async def behind(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers whatever comes through."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        return
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"in"})


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def access(clock: Clock | None = None, *, secure: bool = False) -> Access:
    return Access(behind, NAMES, HASH, secure=secure, clock=clock or Clock())


def ask(
    guard: Access,
    path: str = "/",
    *,
    body: bytes = b"",
    kind: str = "http",
    **headers: str,
) -> tuple[Any, dict[str, str]]:
    """The answer to a request: a status or a WebSocket's message, and headers."""
    pairs = {"host": HOST, "origin": f"http://{HOST}", **headers}
    scope: Scope = {
        "type": kind,
        "method": "POST" if body else "GET",
        "path": path,
        "headers": [(name.encode(), value.encode()) for name, value in pairs.items() if value],
    }
    sent: list[Mapping[str, Any]] = []

    async def receive() -> dict[str, Any]:
        return {"type": f"{kind}.request", "body": body, "more_body": False}

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(guard(scope, receive, send))
    first = sent[0]
    got = {name.decode(): value.decode() for name, value in first.get("headers", ())}
    return first.get("status", first["type"]), got


def log_in(guard: Access, password: str = PASSWORD, **headers: str) -> tuple[Any, str]:
    """Status of a log-in, and the cookie that it gives."""
    status, got = ask(guard, "/login", body=f"password={password}".encode(), **headers)
    return status, got.get("set-cookie", "").partition(";")[0]


def test_a_hash_is_another_one_every_time_and_holds_no_password() -> None:
    again = hash_password(PASSWORD)
    assert again != HASH
    assert PASSWORD not in HASH
    assert is_hash(HASH)
    assert is_password(PASSWORD, again)
    assert not is_password("correct horsf", HASH)
    assert not is_password("", HASH)


def test_what_is_no_hash_is_no_ones_password() -> None:
    plain, weak = HASH.replace("scrypt", "plain"), HASH.replace("32768", "2")
    for broken in ("", "x", HASH[:-4], plain, weak, "a:" * 6):
        assert not is_hash(broken)
        assert not is_password(PASSWORD, broken)


def test_without_a_session_there_is_only_the_page_that_asks_for_the_password() -> None:
    guard = access()
    assert ask(guard, "/")[0] == 303
    assert ask(guard, "/login")[0] == 200
    assert ask(guard, "/page.js")[0] == 403
    assert ask(guard, "/live", kind="websocket")[0] == "websocket.close"
    assert ask(guard, "/live", kind="websocket", cookie="macor-session=x")[0] == "websocket.close"


def test_the_password_opens_a_session_which_ends() -> None:
    clock = Clock()
    guard = access(clock)
    assert log_in(guard, "wrong") == (303, "")
    status, cookie = log_in(guard)
    assert (status, cookie.partition("=")[0]) == (303, "macor-session")
    assert ask(guard, "/page.js", cookie=cookie)[0] == 200
    assert ask(guard, "/live", kind="websocket", cookie=cookie)[0] == "websocket.accept"
    # from another site, the browser may send the cookie, and the origin gives it away
    for origin in ("http://evil.example", "null", "https://lab.example.org"):
        there = ask(guard, "/live", kind="websocket", cookie=cookie, origin=origin)
        assert there[0] == "websocket.close"
    clock.now += 13 * 3600
    assert ask(guard, "/page.js", cookie=cookie)[0] == 403


def test_the_cookie_is_hidden_from_scripts_and_other_sites() -> None:
    for secure in (False, True):
        _, got = ask(access(secure=secure), "/login", body=f"password={PASSWORD}".encode())
        assert {"HttpOnly", "SameSite=Strict"} <= set(got["set-cookie"].split("; "))
        assert ("Secure" in got["set-cookie"]) == secure


def test_passwords_cannot_be_tried_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock()
    # each takes a tenth of a second otherwise
    monkeypatch.setattr(door, "is_password", lambda given, _: given == PASSWORD)
    guard = access(clock)
    tried = [log_in(guard, f"guess {k}")[0] for k in range(12)]
    assert tried == [303] * 10 + [429] * 2
    assert log_in(guard)[0] == 429  # not even the right one
    clock.now += 61
    assert log_in(guard)[1]


def test_a_form_of_another_page_or_too_long_is_refused() -> None:
    guard = access()
    assert log_in(guard, origin="")[0] == 400
    assert log_in(guard, origin="http://evil.example")[0] == 403
    assert log_in(guard, host="evil.example")[0] == 403
    assert log_in(guard, "x" * 5000)[0] == 400


def test_names_that_were_given_count_and_no_others() -> None:
    guard = access()
    for host, status in (
        ("lab.example.org", 303),
        ("LAB.example.org:8443", 303),
        ("evil.lab.example.org", 403),
        ("lab.example.org.evil.example", 403),
    ):
        assert ask(guard, "/", host=host, origin="")[0] == status


def test_every_answer_forbids_scripts_and_frames_of_others() -> None:
    for path in ("/", "/login", "/nowhere"):
        policy = ask(access(), path)[1]["content-security-policy"]
        assert "script-src 'self';" in policy
        assert "frame-ancestors 'none'" in policy


SAFE: dict[str, Any] = {
    "host": "192.0.2.1",
    "name": ("lab.example.org",),
    "password_hash": HASH,
    "behind_proxy": True,
}


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"password_hash": ""}, "takes a --password-hash"),
        ({"host": "127.0.0.1", "password_hash": ""}, "takes a --password-hash"),
        ({"password_hash": PASSWORD}, "is none that"),
        ({"behind_proxy": False}, "--certificate and --key"),
        ({"name": ()}, "takes --name"),
        ({"certificate": "cert.pem"}, "go together"),
        ({"host": "0.0.0.0", "password_hash": ""}, "takes a --password-hash"),
        ({"host": "localhost.evil.example", "behind_proxy": False}, "--certificate and --key"),
    ],
)
def test_a_page_for_others_needs_password_and_tls(changes: dict[str, Any], complaint: str) -> None:
    DashboardOptions(**SAFE)
    with pytest.raises((ValidationError, OptionError), match=re.escape(complaint)):
        DashboardOptions(**{**SAFE, **changes})
