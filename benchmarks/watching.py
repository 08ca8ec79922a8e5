"""Those who watch a live drive: subscribers, recorder, dashboard; and what a recorder writes."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
from figures import Figure
from khepera_protocol.mirror import Mirror
from khepera_protocol.zenoh.controller_payloads import Decision
from khepera_protocol.zenoh.payloads import Stamp

from macor_hil.telemetry.examples import EXAMPLES
from macor_hil.telemetry.feed import Arrival
from macor_hil.telemetry.recordings.recording import Recorder

_PAIRS = 2000
_PAGE = 18457
_MEETING = 10.0
"""Seconds that recorder and dashboard may take to appear."""


class Recording:
    """Pairs of a picture and a decision, to a file on this machine's disk."""

    def __init__(self, stack: ExitStack) -> None:
        self._folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        rng = np.random.default_rng(0)
        mirror = Mirror()
        image = rng.integers(90, 130, (mirror.height, mirror.width, 3), dtype=np.uint8)
        self._picture = cv2.imencode(".jpg", image)[1].tobytes()
        self._decision = EXAMPLES[Decision].model_dump_json().encode()

    def round(self) -> dict[str, float]:
        """Write all pairs; pairs a second, and bytes a second."""
        stamp, path = Stamp(sequence=0, time=0.0), self._folder / "bench.mcap"
        pair = [
            Arrival("macor", "frame", self._picture, "image/jpeg", stamp, 0),
            Arrival("macor", "decision", self._decision, "application/json", stamp, 0),
        ]
        start = time.perf_counter()
        with Recorder(path, "khepera") as recorder:
            for _ in range(_PAIRS):
                for event in pair:
                    recorder.write(event)
        taken = time.perf_counter() - start
        return {"pairs": _PAIRS / taken, "bytes": path.stat().st_size / taken}

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Return how much faster it is than a robot that decides 1.3 times a second."""
        return [
            Figure(
                f"recorded pairs of picture ({len(self._picture) / 1000:.1f} kB) and decision/s",
                f"{medians['pairs']:,.0f}",
                f"{medians['bytes'] / 1e6:.0f} MB/s to disk; a robot decides 1.3 times a second",
                f"{medians['pairs'] / 1.3:,.0f} x what is needed",
            )
        ]


@contextmanager
def subscribers(endpoint: str, number: int, stuck: bool = False) -> Iterator[None]:
    """So many watchers of a controller that may come later; one of them stuck."""
    numbers = [(number - 1, ""), (1, "stuck")] if stuck else [(number, "")]
    with ExitStack() as stack:
        for each, how in numbers:
            script = str(Path(__file__).with_name("subscribers.py"))
            command = [sys.executable, script, endpoint, str(each), how]
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            stack.enter_context(process)
            stack.callback(process.kill)  # a stuck one hears nothing else
            assert process.stdout is not None
            process.stdout.readline()
        yield


@contextmanager
def recorder_and_dashboard(recording: Path, endpoints: Sequence[str]) -> Iterator[None]:
    """Run a recorder and a dashboard, each a process."""
    connect = [word for endpoint in endpoints for word in ("--connect", endpoint)]
    command = [sys.executable, "-u", "-m", "macor_hil.cli"]
    recorder = [*command, "record", str(recording), *connect]
    dashboard = [*command, "dashboard", "--port", str(_PAGE), *connect]
    with (
        subprocess.Popen(recorder, stdout=subprocess.PIPE) as first,
        subprocess.Popen(dashboard, stdout=subprocess.PIPE, text=True) as second,
    ):
        try:
            assert second.stdout is not None
            second.stdout.readline()
            end = time.monotonic() + _MEETING
            while time.monotonic() < end:
                with suppress(OSError):
                    if recording.stat().st_size > 1000:
                        break
                time.sleep(0.1)
            yield
        finally:
            for process in (first, second):
                process.terminate()
    recording.unlink(missing_ok=True)
