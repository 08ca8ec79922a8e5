"""Cost of the dashboard for each redraw and browser, from a recording: processor time and bytes.

    python benchmarks/dashboard.py runs/drive.mcap

plays the recording in steps of a tenth of a second, as the page is drawn, for one browser; and
once more for a second browser that looks at the same robot, which costs the difference alone.
"""

import json
import sys
import time
from pathlib import Path

from page import table

from macor_hil.monitor.dashboard.board import Board, Parts
from macor_hil.monitor.dashboard.connection import difference
from macor_hil.monitor.robot_state import RobotState
from macor_hil.telemetry.recordings.recording import read_recording

_STEP = 100_000_000
"""Nanoseconds between two redraws."""


def main() -> None:
    """Play the recording that the command line names, and print a table."""
    name, events = read_recording(Path(sys.argv[1]))
    watched, board = RobotState(name), Board()
    others = {name: watched}
    sent: Parts = {}
    picture = b""
    drawing = differing = 0.0
    redraws = text = pictures = 0
    rest = iter(events)
    event = next(rest, None)
    now = events[0].received
    while event is not None:
        now += _STEP
        while event is not None and event.received <= now:
            watched.take(event)
            event = next(rest, None)
        begin = time.process_time()
        parts = board.parts(watched, others, now * 1e-9)
        drawn = time.process_time()
        changed = difference(sent, parts)
        message = json.dumps({"parts": changed}, ensure_ascii=False, separators=(",", ":"))
        differing += time.process_time() - drawn
        drawing += drawn - begin
        sent = parts
        redraws += 1
        text += len(message.encode()) if changed else 0
        if board.picture is not picture:
            picture = board.picture
            pictures += len(picture)
    rows = [
        ("drawing, once for all browsers", f"{1000 * drawing / redraws:.2f} ms", ""),
        (
            "difference, for each browser",
            f"{1000 * differing / redraws:.2f} ms",
            f"{text / redraws / 1000:.2f} kB",
        ),
        ("pictures, for each browser", "", f"{pictures / redraws / 1000:.2f} kB"),
    ]
    total = 1000 * (drawing + differing) / redraws, (text + pictures) / redraws / 1000
    rows.append(("a redraw in all, one browser", f"{total[0]:.2f} ms", f"{total[1]:.2f} kB"))
    head = (f"{redraws} redraws", "processor", "sent")
    sys.stdout.write(table(head, rows) + "\n")


if __name__ == "__main__":
    main()
