"""Guards the dashboard: for pages of its own names, and browsers that know its password.

A page from elsewhere, open in the same browser, can send requests to this machine: by a name of its
own that leads here (DNS rebinding; its `Host` gives it away), or as what it is (its `Origin` does).
Scripts of neither may see a robot. A port that SSH or a proxy forwards is another number under the
same names.

Where a password is set, everything but the page that asks for it needs a session: a random token in
a cookie that scripts cannot read and other sites cannot send.
"""

import asyncio
import secrets
import time
from collections import deque
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any, Final
from urllib.parse import parse_qs

from macor_hil.monitor.dashboard.passwords import is_password

LOOPBACK: Final = frozenset({"127.0.0.1", "localhost", "[::1]"})
"""Names of this machine for itself."""

LOGIN: Final = "/login"
WRONG: Final = "wrong"
"""Name in the query of the page that asks again."""

_OPEN: Final = frozenset({LOGIN, "/page.css", "/icon.svg"})
"""Paths that are served before the password is known."""

_COOKIE: Final = "macor-session"
_LASTS: Final = 12 * 3600
"""Seconds of a session."""

_SESSIONS: Final = 1_000
_TRIES: Final = 10
_PER: Final = 60.0
"""So many passwords are tried in so many seconds, by all browsers together."""

_LONGEST_FORM: Final = 2_000
"""Bytes of the form with the password."""

_HEADERS: Final = (
    (
        b"content-security-policy",
        b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:;"
        b" connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cache-control", b"no-store"),
)

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]


class Access:
    """Passes on requests and WebSockets of those who may; for any ASGI app.

    Args:
        app: whom to.
        names: hosts by which browsers may call this server.
        password_hash: of the password, see `passwords`; empty: none is asked for.
        secure: whether browsers reach it over TLS alone: the cookie is sent over nothing else.
        clock: seconds.
    """

    def __init__(
        self,
        app: App,
        names: frozenset[str] = LOOPBACK,
        password_hash: str = "",
        *,
        secure: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._app = app
        self._names = names
        self._hash = password_hash
        self._secure = secure
        self._clock = clock
        self._sessions: dict[str, float] = {}
        self._tried: deque[float] = deque(maxlen=_TRIES)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = scope["headers"]
        if not is_ours(headers, self._names):
            await _refuse(scope, receive, send)
        elif not self._hash:
            await self._app(scope, receive, _with_headers(send))
        elif scope["path"] == LOGIN and scope["type"] == "http" and scope["method"] == "POST":
            await self._log_in(headers, receive, send)
        elif scope["path"] in _OPEN or self._has_session(headers):
            await self._app(scope, receive, _with_headers(send))
        elif scope["type"] == "http" and scope["path"] == "/":
            await _answer(send, 303, b"", [(b"location", LOGIN.encode())])
        else:
            await _refuse(scope, receive, send)

    def _has_session(self, headers: list[tuple[bytes, bytes]]) -> bool:
        ends = self._sessions.get(_cookie(headers))
        return ends is not None and self._clock() < ends

    async def _log_in(
        self, headers: list[tuple[bytes, bytes]], receive: Receive, send: Send
    ) -> None:
        """Begin a session for who knows the password; browsers say where a form comes from."""
        form = await _read(receive)
        now = self._clock()
        if form is None or not any(name == b"origin" for name, _ in headers):
            await _answer(send, 400, b"This is not the form of the page.\n")
        elif len(self._tried) == _TRIES and now - self._tried[0] < _PER:
            words = b"Too many passwords were tried; wait a minute.\n"
            await _answer(send, 429, words, [(b"retry-after", b"60")])
        else:
            self._tried.append(now)
            given = parse_qs(form.decode(errors="replace")).get("password", [""])[0]
            # it takes a tenth of a second on purpose, in which others are served
            if await asyncio.to_thread(is_password, given, self._hash):
                self._tried.clear()
                await _answer(send, 303, b"", [(b"location", b"/"), self._new_cookie(now)])
            else:
                await _answer(send, 303, b"", [(b"location", f"{LOGIN}?{WRONG}=1".encode())])

    def _new_cookie(self, now: float) -> tuple[bytes, bytes]:
        self._sessions = {token: end for token, end in self._sessions.items() if now < end}
        while len(self._sessions) >= _SESSIONS:
            self._sessions.pop(next(iter(self._sessions)))
        token = secrets.token_urlsafe(32)
        self._sessions[token] = now + _LASTS
        parts = [f"{_COOKIE}={token}", "Path=/", f"Max-Age={_LASTS}", "HttpOnly", "SameSite=Strict"]
        return b"set-cookie", "; ".join([*parts, *(["Secure"] * self._secure)]).encode()


def is_ours(headers: list[tuple[bytes, bytes]], names: frozenset[str] = LOOPBACK) -> bool:
    """Return whether a request is for this server by one of its names, and from its own page."""
    hosts = [value.lower() for name, value in headers if name == b"host"]
    origins = [value.lower() for name, value in headers if name == b"origin"]
    if len(hosts) != 1 or len(origins) > 1:
        return False
    (host,) = hosts
    name, colon, port = host.decode("latin-1").rpartition(":")
    if not colon or port.endswith("]"):
        name, port = host.decode("latin-1"), "80"
    if name not in names or not port.isdecimal():
        return False
    return all(origin in (b"http://" + host, b"https://" + host) for origin in origins)


def _cookie(headers: list[tuple[bytes, bytes]]) -> str:
    """Return the session's token that a browser sends; empty without one."""
    for name, value in headers:
        if name == b"cookie":
            try:
                morsel = SimpleCookie(value.decode("latin-1")).get(_COOKIE)
            except CookieError:
                continue
            if morsel is not None:
                return morsel.value
    return ""


async def _read(receive: Receive) -> bytes | None:
    """Return the body of a request; None where it is longer than a form."""
    body: bytes = b""
    while True:
        message = await receive()
        body += message.get("body", b"")
        if len(body) > _LONGEST_FORM:
            return None
        if not message.get("more_body"):
            return body


def _with_headers(send: Send) -> Send:
    async def send_on(message: Message) -> None:
        if message["type"] == "http.response.start":
            message["headers"] = [*message.get("headers", ()), *_HEADERS]
        await send(message)

    return send_on


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
    else:
        words = b"The dashboard is not for this page or name; open the address that it told.\n"
        await _answer(send, 403, words, [(b"connection", b"close")])


async def _answer(
    send: Send, status: int, body: bytes, headers: list[tuple[bytes, bytes]] | None = None
) -> None:
    all_headers = [(b"content-type", b"text/plain"), *(headers or []), *_HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": all_headers})
    await send({"type": "http.response.body", "body": body})
