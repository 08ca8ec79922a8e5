"""Jumps in an hour's recording: how long they take, and how much is read.

Writes a recording of an hour (a decision and a picture a second, ten true poses, twenty exchanges
on the serial line), then begins to play it at places drawn from a seed, lets a page of the
dashboard leap there, and reads it all once.
`python benchmarks/seeking.py` prints the figures.
"""

import random
import resource
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from khepera_protocol.zenoh.keys import EMULATOR
from khepera_protocol.zenoh.payloads import Wire, WireEntry
from watching_helpers import BEGIN, SECOND, a_life, json_event, truth

from macor_hil.monitor.dashboard.playing import RecordingSource, Timeline
from macor_hil.telemetry.recordings.recording import Recorder, has_index, play_recording

_SECONDS = 3600
_JUMPS = 50


def main() -> None:
    """Measure, and print."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hour.mcap"
        count = _write(path)
        places = random.Random(1)
        times, busy = [], []
        for _ in range(_JUMPS):
            begin = places.uniform(1.0, _SECONDS - 1.0)
            start, worked = time.perf_counter(), time.process_time()
            _, events = play_recording(path, begin)
            next(iter(events))
            times.append(time.perf_counter() - start)
            busy.append(time.process_time() - worked)
        before = _memory()
        timeline = Timeline(partial(play_recording, path), has_index=has_index(path))
        page = RecordingSource(timeline)
        leaps = []
        for _ in range(_JUMPS):
            worked = time.process_time()
            page.seek(places.uniform(0.0, page.duration))
            page.poll()
            leaps.append(time.process_time() - worked)
        shown = _memory()
        start = time.perf_counter()
        read = sum(1 for _ in play_recording(path)[1])
        whole = time.perf_counter() - start
        rows = [
            ("size of an hour", f"{path.stat().st_size / 1e6:.0f} MB, {count:,} events"),
            ("a jump to its first event, median", f"{1000 * median(times):.0f} ms"),
            ("of it the processor, median", f"{1000 * median(busy):.0f} ms"),
            ("the same, longest of 50", f"{1000 * max(busy):.0f} ms"),
            (
                "a leap of a page of the dashboard, processor, median",
                f"{1000 * median(leaps):.0f} ms",
            ),
            ("the same, longest of 50", f"{1000 * max(leaps):.0f} ms"),
            ("memory that the dashboard takes for it", f"{(shown - before) / 1024:.0f} MB"),
            ("reading it all", f"{whole:.1f} s, {read:,} events"),
            ("memory that reading it all takes", f"{(_memory() - shown) / 1024:.0f} MB"),
        ]
        for name, value in rows:
            print(f"| {name} | {value} |")  # noqa: T201


def _write(path: Path) -> int:
    count = 0
    with Recorder(path, "khepera") as recorder:
        for event in a_life(_SECONDS):
            recorder.write(event)
            count += 1
            if getattr(event, "leaf", "") == "frame":
                second = (event.received - BEGIN) / SECOND
                for k in range(10):
                    at = second + 0.04 * k
                    count += 2
                    entries = [
                        WireEntry(time=at, what="request", text="N\n"),
                        WireEntry(time=at, what="reply", text="n,0,0,0,0,0,0,0,0\r\n"),
                    ]
                    recorder.write(json_event(EMULATOR, "truth", truth(at, 0.1), at))
                    recorder.write(
                        json_event(EMULATOR, "wire", Wire(first=0, entries=entries * 2), at)
                    )
    return count


def _memory() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


if __name__ == "__main__":
    main()
