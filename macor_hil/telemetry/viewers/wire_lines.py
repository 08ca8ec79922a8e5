"""A serial line as its watchers are told of it, in whatever way its robot speaks."""

from collections.abc import Iterator

from khepera_protocol.zenoh.payloads import Wire

from macor_hil.hardware.robots.form import Listener, Passed
from macor_hil.hardware.robots.forms import form_of


class WireLines:
    """Puts pieces together, each way on its own."""

    def __init__(self) -> None:
        self._listener: Listener | None = None
        self._spoken = ("", "")

    def take(self, wire: Wire) -> Iterator[Passed]:
        """Yield what has come to its end."""
        spoken = wire.robot_kind, wire.dialect
        if self._listener is None or spoken != self._spoken:
            self._spoken = spoken
            self._listener = form_of(wire.robot_kind).listener(wire.dialect)
        for entry in wire.entries:
            yield from self._listener.take(entry)

    def lose(self) -> None:
        """Forget halves: what would have made them whole did not come."""
        if self._listener is not None:
            self._listener.lose()
