"""One browser: it gets what has changed since what it was sent, and says what it wishes.

The next difference is taken when the last one is on its way: a browser behind a slow line sees
fewer moments, and none that are old.
"""

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from html import escape
from typing import Any, Final

from khepera_protocol.zenoh.payload_model import PayloadError
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected

from macor_hil.errors import MacorError
from macor_hil.monitor.dashboard.board import Part, Parts
from macor_hil.monitor.dashboard.failures import Failures
from macor_hil.monitor.dashboard.sources import LiveView, RecordingView, Shown, View
from macor_hil.monitor.dashboard.steering import STEERS
from macor_hil.monitor.dashboard.wishes import FASTEST, SLOWEST, Look, Wish

PERIOD: Final = 0.1
"""Seconds between two looks at what is new."""

LONGEST: Final = 4_000
"""Bytes of a wish."""

_GONE: Final = (WebSocketDisconnect, WebSocketDisconnected)
"""A browser has gone: while it was listened to, or while it was told something."""

_ABSENT: Final = object()

Steer = Callable[[str, Wish], str]
"""Carries out a wish for a robot; it waits for an answer, in a thread of its own."""


class Connection:
    """A browser's connection.

    Args:
        socket: accepted.
        view: what it looks at.
        failures: what went wrong in pages.
        steer: carries out wishes that steer; None: they are refused.
    """

    def __init__(
        self, socket: WebSocket, view: View, failures: Failures, steer: Steer | None
    ) -> None:
        self._socket = socket
        self._view = view
        self._failures = failures
        self._steer = steer
        self._shown = Shown({}, b"")
        self._sent: Parts = {}
        self._picture = b""

    async def serve(self) -> None:
        """Serve it until it goes."""
        tasks = [asyncio.create_task(each) for each in (self._tell(), self._listen())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception) and not isinstance(result, _GONE):
                raise result

    async def _tell(self) -> None:
        """Send what has changed, again and again."""
        while True:
            with self._failures:
                self._shown = self._view.show()
            # what fails leaves the page as it was, but for these words
            parts: Parts = {**self._shown.parts, "trouble": escape(self._failures.words())}
            if changed := difference(self._sent, parts):
                self._sent = parts
                await self._send({"parts": changed})
            if self._shown.picture is not self._picture:
                self._picture = self._shown.picture
                await self._socket.send_bytes(self._picture)
            await asyncio.sleep(PERIOD)

    async def _listen(self) -> None:
        """Take wishes, one after the other."""
        while True:
            text = await self._socket.receive_text()
            try:
                wish = Wish.parse(text.encode(errors="replace"), LONGEST)
                said = await self._carry_out(wish)
            except (PayloadError, MacorError) as error:
                await self._send({"said": str(error), "bad": True})
            else:
                if said:
                    await self._send({"said": said})

    async def _carry_out(self, wish: Wish) -> str:
        view = self._view
        if wish.do in STEERS:
            if self._steer is None:
                raise MacorError("this dashboard only watches; start it with --allow-control")
            return await asyncio.to_thread(self._steer, view.robot, wish)
        if isinstance(view, LiveView) and wish.do == "choose":
            view.robot = wish.robot
            self._picture = b""
        elif isinstance(view, RecordingView):
            _play(view, wish)
        return ""

    async def _send(self, message: dict[str, Any]) -> None:
        await self._socket.send_text(json.dumps(message, ensure_ascii=False, separators=(",", ":")))


def difference(sent: Parts, parts: Parts) -> Parts:
    """Return the parts that a browser has to be sent, None for children that are no more."""
    changed: dict[str, Part] = {
        name: part
        for name, part in parts.items()
        if (known := sent.get(name, _ABSENT)) is not part and known != part
    }
    return changed | {name: None for name in sent if name not in parts}


async def serve(
    socket: WebSocket,
    open_view: Callable[[Look], View],
    failures: Failures,
    steer: Steer | None,
) -> None:
    """Serve a browser from its first word to its last one."""
    await socket.accept()
    with suppress(*_GONE):
        try:
            look = Look.parse((await socket.receive_text()).encode(errors="replace"), LONGEST)
        except PayloadError as error:
            await socket.send_text(json.dumps({"said": str(error), "bad": True}))
            await socket.close(1008)
            return
        await Connection(socket, open_view(look), failures, steer).serve()


def _play(view: RecordingView, wish: Wish) -> None:
    player = view.player
    match wish.do:
        case "toggle":
            player.toggle()
        case "seek":
            player.seek(wish.value)
        case "leap":
            player.seek(player.position + wish.value)
        case "speed":
            player.speed = min(max(wish.value, SLOWEST), FASTEST)
