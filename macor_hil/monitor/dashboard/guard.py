"""Lets only pages of this machine use the dashboard.

A page from elsewhere, open in the same browser, can send requests to this machine: by a name of its
own that leads here (DNS rebinding; its `Host` gives it away), or as what it is (its `Origin` does).
Scripts of neither may see a robot. A port that SSH forwards is another number under the same names.
"""

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final

NAMES: Final = frozenset({"127.0.0.1", "localhost", "[::1]"})
"""Names of this machine for itself."""

_REFUSED: Final = (
    b"The dashboard is for browsers on this machine: open http://127.0.0.1 and its port.\n"
)

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]


class Guard:
    """Passes on requests and WebSockets that come from this machine's own pages; for any ASGI app.

    Args:
        app: whom to.
    """

    def __init__(self, app: App) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it with 403."""
        if scope["type"] not in ("http", "websocket") or is_ours(scope["headers"]):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            headers = [(b"content-type", b"text/plain"), (b"connection", b"close")]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": _REFUSED})


def is_ours(headers: list[tuple[bytes, bytes]]) -> bool:
    """Return whether a request is for this machine by its name, and from a page of this server."""
    hosts = [value.lower() for name, value in headers if name == b"host"]
    origins = [value.lower() for name, value in headers if name == b"origin"]
    if len(hosts) != 1 or len(origins) > 1:
        return False
    (host,) = hosts
    name, colon, port = host.decode("latin-1").rpartition(":")
    if not colon or port.endswith("]"):
        name, port = host.decode("latin-1"), "80"
    if name not in NAMES or not port.isdecimal():
        return False
    return all(origin in (b"http://" + host, b"https://" + host) for origin in origins)
