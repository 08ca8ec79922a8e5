"""Serves the page and its connections, to any number of browsers; nothing comes from elsewhere."""

import asyncio
import json
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Final

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from macor_hil.errors import MacorError
from macor_hil.mind.catalogue import PLANNERS
from macor_hil.mind.planners.destinations import NAMES as GOALS
from macor_hil.monitor.dashboard.access import LOGIN, LOOPBACK, WRONG, Access
from macor_hil.monitor.dashboard.connection import LONGEST, PERIOD, Steer, serve
from macor_hil.monitor.dashboard.failures import Failures
from macor_hil.monitor.dashboard.sources import View
from macor_hil.monitor.dashboard.wishes import Look

_FILES: Final = files("macor_hil.monitor.dashboard") / "page"
_MOST: Final = 64
"""Browsers at the same time."""

_ENDING: Final = 1
"""Seconds that connections may take to end."""


@dataclass(frozen=True)
class Doors:
    """Address of the page, and those whom it is served to.

    Attributes:
        host, port: address to listen on; port 0: a free one.
        names: hosts by which browsers may call the server.
        password_hash: see `passwords`; empty: no password.
        certificate, key: files for TLS; empty: none.
        proxied: whether a proxy in front of it speaks TLS with browsers.
    """

    host: str = "127.0.0.1"
    port: int = 8080
    names: frozenset[str] = field(default=LOOPBACK)
    password_hash: str = ""
    certificate: str = ""
    key: str = ""
    proxied: bool = False

    @property
    def secure(self) -> bool:
        """True where browsers come over TLS."""
        return bool(self.certificate) or self.proxied


def run(
    open_view: Callable[[Look], View],
    doors: Doors,
    ready: Callable[[str], None],
    poll: Callable[[], None] | None = None,
    steer: Steer | None = None,
) -> None:
    """Serve until Ctrl-C or SIGTERM.

    Args:
        open_view: gives what a browser looks at, by its first word.
        doors: where, and to whom.
        ready: called with the address when the page is served.
        poll: called again and again, whether a page is open or not.
        steer: carries out wishes that steer; None: the page only watches.

    Raises:
        MacorError: the port is taken, or the TLS files cannot be used.
    """
    failures = Failures()

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        polling = asyncio.create_task(_again_and_again(poll, failures)) if poll else None
        ready(address)
        yield
        if polling:
            polling.cancel()

    app = Access(
        application(open_view, failures, steer, lifespan),
        doors.names,
        doors.password_hash,
        secure=doors.secure,
    )
    _check_tls(doors)
    with _bound(doors) as listening:
        host, port = listening.getsockname()[:2]
        scheme = "https" if doors.certificate else "http"
        address = f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}"
        config = uvicorn.Config(
            app,
            log_level="warning",
            lifespan="on",
            proxy_headers=False,
            server_header=False,
            ws_max_size=LONGEST,
            limit_concurrency=2 * _MOST,
            timeout_graceful_shutdown=_ENDING,
            ssl_certfile=doors.certificate or None,
            ssl_keyfile=doors.key or None,
        )
        with suppress(KeyboardInterrupt):  # the way to end it
            uvicorn.Server(config).run(sockets=[listening])


def application(
    open_view: Callable[[Look], View],
    failures: Failures,
    steer: Steer | None = None,
    lifespan: Callable[[Starlette], AbstractAsyncContextManager[None]] | None = None,
) -> Starlette:
    """Return the pages and the WebSocket, without a guard; see `run` for the arguments."""
    there = 0

    async def live(browser: WebSocket) -> None:
        nonlocal there
        if there >= _MOST:
            await browser.close(1013)
            return
        there += 1
        try:
            with failures:
                await serve(browser, open_view, failures, steer)
        finally:
            there -= 1

    async def index(_: Request) -> Response:
        text = _file("index.html").replace("{steer}", "" if steer is None else "may-steer")
        text = text.replace("{choices}", json.dumps(_choices()).replace("<", "\\u003c"))
        return Response(text, media_type="text/html")

    async def login(request: Request) -> Response:
        wrong = "" if WRONG in request.query_params else "hidden"
        return Response(_file("login.html").replace("{wrong}", wrong), media_type="text/html")

    routes = [
        Route("/", index),
        Route(LOGIN, login),
        Route("/page.css", _sent("page.css", "text/css")),
        Route("/page.js", _sent("page.js", "text/javascript")),
        Route("/drawing.js", _sent("drawing.js", "text/javascript")),
        Route("/steering.js", _sent("steering.js", "text/javascript")),
        Route("/icon.svg", _sent("icon.svg", "image/svg+xml")),
        WebSocketRoute("/live", live),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


async def _again_and_again(action: Callable[[], None], failures: Failures) -> None:
    while True:
        with failures:
            action()
        await asyncio.sleep(PERIOD)


def _choices() -> dict[str, list[str]]:
    """Return the names that the page offers to choose from."""
    return {"planners": list(PLANNERS.names()), "goals": list(GOALS)}


def _sent(name: str, media: str) -> Callable[[Request], Response]:
    def send(_: Request) -> Response:
        return Response(_file(name), media_type=media)

    return send


def _file(name: str) -> str:
    return (_FILES / name).read_text("utf-8")


def _bound(doors: Doors) -> socket.socket:
    """Return a socket that listens.

    Raises:
        MacorError: the address cannot be had.
    """
    family = socket.AF_INET6 if ":" in doors.host else socket.AF_INET
    try:
        return socket.create_server((doors.host, doors.port), family=family)
    except OSError as error:
        raise MacorError(
            f"cannot serve on {doors.host}, port {doors.port}: {error.strerror}; give another"
            " --port or --host"
        ) from None


def _check_tls(doors: Doors) -> None:
    """See that certificate and key can be used.

    Raises:
        MacorError: they cannot.
    """
    if not doors.certificate:
        return
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(doors.certificate, doors.key)
    except (OSError, ssl.SSLError) as error:
        raise MacorError(
            f"cannot use {doors.certificate} and {doors.key} for TLS: {error}"
        ) from None
