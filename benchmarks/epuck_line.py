"""An e-puck's line beside a Khepera's: exchanges a second, and a binary row in time."""

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from statistics import median

from figures import Figure, percentile
from khepera_protocol.epuck.codes import row
from khepera_protocol.epuck.packets import Actuators
from serial_line import Client, bare_pty, emulator

_EXCHANGES = 1500
_PACED = 200

_KHEPERA, _TEXT, _ROW = b"H\n", b"Q\r", row("Q")
_ACTUATE_AND_SENSE = row((0xF7, Actuators().pack()), 0xF8)
_PACKET = 103
_BAUD = 115_200
_IDEAL = (len(_ACTUATE_AND_SENSE) + _PACKET) * 10 / _BAUD
"""Seconds of all bytes on the wire."""


class EpuckLine:
    """Unpaced exchanges of an e-puck2 and of a Khepera in one run, and a binary row in time.

    The row of all actuators and all sensors is held against a bare pseudo-terminal that sleeps for
    the time of its bytes and answers with as many.
    """

    def __init__(self, stack: ExitStack) -> None:
        khepera, _ = stack.enter_context(emulator("unpaced"))
        epuck, _ = stack.enter_context(emulator("unpaced", "--model", "epuck2"))
        paced, _ = stack.enter_context(emulator("auto", "--model", "epuck2"))
        bare, _ = stack.enter_context(bare_pty("x" * (_PACKET - 2)))
        self._khepera, self._epuck = Client(khepera), Client(epuck)
        self._paced, self._bare = Client(paced, _BAUD), Client(bare)
        self._errors: dict[str, list[float]] = {"robot": [], "bare": []}

    def round(self) -> dict[str, float]:
        """Each kind of exchange, a quarter at a time in turn; then the rows."""
        ways: dict[str, Callable[[], object]] = {
            "khepera": lambda: self._khepera.by_chunk(_KHEPERA),
            "text": lambda: self._epuck.by_chunk(_TEXT),
            "row": lambda: _exchange(self._epuck, _ROW, 4),
        }
        times: dict[str, float] = dict.fromkeys(ways, 0.0)
        for _ in range(4):
            for name, exchange in ways.items():
                start = time.perf_counter()
                for _ in range(_EXCHANGES // 4):
                    exchange()
                times[name] += time.perf_counter() - start
        wait = f"{_IDEAL:.6f}\n".encode()
        for _ in range(_PACED):
            for name, client, request in (
                ("robot", self._paced, _ACTUATE_AND_SENSE),
                ("bare", self._bare, wait),
            ):
                start = time.perf_counter()
                _exchange(client, request, _PACKET)
                self._errors[name].append(time.perf_counter() - start - _IDEAL)
        return {name: _EXCHANGES / taken for name, taken in times.items()}

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Exchanges a second, and percentiles over all rounds."""
        rows = [
            Figure(
                f"exchanges/s of an e-puck2, unpaced, {title}",
                f"{medians[name]:,.0f}",
                f"Khepera {medians['khepera']:,.0f}",
                f"{medians[name] / medians['khepera']:.2f}",
            )
            for name, title in (("text", "text"), ("row", "binary row"))
        ]
        spread = {
            name: (median(errors), percentile([abs(each) for each in errors]))
            for name, errors in self._errors.items()
        }
        (robot, robot_99), (bare, bare_99) = spread["robot"], spread["bare"]
        rows.append(
            Figure(
                "wire time error, all actuators and sensors of an e-puck2, 115200 baud",
                f"{1e3 * robot:+.2f} ms, {1e3 * robot_99:.2f} ms",
                f"bare pty that sleeps {1e3 * _IDEAL:.1f} ms: {1e3 * bare:+.2f} ms,"
                f" {1e3 * bare_99:.2f} ms",
                f"{robot_99 / bare_99:.2f}",
            )
        )
        return rows


def _exchange(client: Client, request: bytes, size: int) -> bytes:
    client.port.write(request)
    reply: bytes = client.port.read(size)
    if len(reply) != size:
        raise TimeoutError(f"{len(reply)} bytes instead of {size} to {request!r}")
    return reply
