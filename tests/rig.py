"""A whole bench in processes: emulator, a camera that can fail, controller, a stop watch.

The stop watch reads the emulator's own clock and speeds: what is measured is what the robot did.
"""

import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import zenoh
from emulator_process import PATIENCE, EmulatorProcess, free_endpoint
from khepera_protocol.zenoh.payloads import Reset
from router import Router

from macor_hil.errors import BenchError
from macor_hil.hardware.bench import ZenohBench
from macor_hil.telemetry.session import open_session

MOVING = 0.012
"""m/s: the wheels turn; a command at speed 2 has just begun."""

STANDING = 0.004
"""m/s: half a unit of the speed controller."""

RELAYED = "relay/camera"
Sample = tuple[float, float]
"""A time of the robot's clock, and the speed of its faster wheel."""

_REST = 0.6
"""Seconds without motion that are no pause between two commands."""


class Closing(Protocol):
    """Anything on a rig that is ended with it."""

    def close(self) -> None: ...


class CameraRelay:
    """Passes the emulator's pictures on under another key, or does as its `mode` says.

    Modes: pass, lost (no answer), frozen, late, dark, small, garbage.
    """

    def __init__(self, session: zenoh.Session, robot: str = "khepera") -> None:
        self.mode = "pass"
        self._session = session
        self._key = f"khepera/{robot}/camera"
        self._last: tuple[bytes, bytes] | None = None
        self._queryable = session.declare_queryable(RELAYED, self._take)

    def _take(self, query: zenoh.Query) -> None:
        # an answer may take long, and the next question must not wait for it
        threading.Thread(target=self._answer, args=(query,), daemon=True).start()

    def _answer(self, query: zenoh.Query) -> None:
        with query, suppress(zenoh.ZError):  # its session may be closed meanwhile
            mode = self.mode
            if mode == "lost":
                time.sleep(3.0)
                return
            if mode == "late":
                time.sleep(0.8)
            if mode != "frozen" or self._last is None:
                replies = [r.ok for r in self._session.get(self._key, timeout=2.0) if r.ok]
                if not replies:
                    return
                stamp = replies[0].attachment
                assert stamp is not None
                self._last = replies[0].payload.to_bytes(), stamp.to_bytes()
            data, attachment = self._last
            query.reply(RELAYED, self._spoil(data, mode), attachment=attachment)

    @staticmethod
    def _spoil(data: bytes, mode: str) -> bytes:
        if mode == "garbage":
            return b"\xff\xd8 no picture"
        if mode not in ("dark", "small"):
            return data
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        image = picture // 20 if mode == "dark" else cv2.resize(picture, (80, 80))
        return cv2.imencode(".png", image)[1].tobytes()


class Controller:
    """A controller process; what it says is in `lines` as it comes."""

    def __init__(self, command: Sequence[str], **popen: Any) -> None:
        self.process: subprocess.Popen[str] = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **popen
        )
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        self._output, self._errors = self.process.stdout, self.process.stderr
        self.lines: list[str | None] = []
        self.times: list[float] = []  # when each line came, seconds
        self._came = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self._output:
            with self._came:
                self.lines.append(line.rstrip("\n"))
                self.times.append(time.monotonic())
                self._came.notify_all()
        with self._came:
            self.lines.append(None)
            self._came.notify_all()

    def wait_for(
        self, condition: Callable[[list[str | None]], bool], patience: float = PATIENCE
    ) -> None:
        """Wait until what has been said meets a condition."""
        with self._came:
            met = self._came.wait_for(lambda: condition(self.lines) or None in self.lines, patience)
        if not met or not condition(self.lines):
            said = [line for line in self.lines if line != "step"]
            errors = self._errors.read() if self.process.poll() is not None else ""
            raise AssertionError(f"the controller said {said} after {self.steps()} steps {errors}")

    def steps(self) -> int:
        return self.lines.count("step")

    def wait_for_steps(self, more: int = 1, patience: float = PATIENCE) -> None:
        wanted = self.steps() + more
        self.wait_for(lambda lines: lines.count("step") >= wanted, patience)

    def end(self) -> str:
        """Wait for the end; what was said last."""
        self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        return next((line for line in reversed(self.lines) if line not in (None, "step")), "")

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        self._output.close()
        self._errors.close()


class Rig:
    """Emulator on a linked terminal, relay and bench; controllers on demand.

    With a router, controllers reach the camera through that alone, and there is no relay unless it
    is asked for.

    Args:
        folder: of its files.
        options: of the emulator.
        baud, arena: of the emulator, too.
        relay: whether pictures come by a relay; None: unless there is a router.
        routed: whether there is a router.
        log: file that takes what the emulator tells on standard error.
    """

    def __init__(
        self,
        folder: str | Path,
        *options: str,
        baud: int = 57600,
        arena: str = "open-box",
        relay: bool | None = None,
        routed: bool = False,
        log: Path | None = None,
    ) -> None:
        self.folder = Path(folder)
        self.link = self.folder / "robot"
        self.endpoint, self.controller_endpoint = free_endpoint(), free_endpoint()
        self.baud = baud
        self.router = Router(self.folder) if routed else None
        self._relayed = not routed if relay is None else relay
        self.log = log
        self._options = (
            *("--arena", arena, "--link", str(self.link), "--listen", self.endpoint),
            *("--baud", str(baud), *options),
            *(("--connect", self.router.endpoint) if self.router else ()),
        )
        self.emulator = self._started()
        self.join_zenoh()
        self.controllers: list[Closing] = []

    def join_zenoh(self) -> None:
        """Open the session of bench and relay."""
        self._stack = ExitStack()
        # pictures that pass the relay go on to a router, where there is one
        ends = [self.endpoint, *([self.router.endpoint] if self.router and self._relayed else [])]
        self.session = self._stack.enter_context(open_session([], ends))
        self.bench = ZenohBench(self.session, "khepera")
        self.relay = CameraRelay(self.session) if self._relayed else None

    def leave_zenoh(self) -> None:
        """Close the session of bench and relay."""
        self._stack.close()

    def restart_emulator(self) -> None:
        self.emulator.end(9)
        self.emulator = self._started()

    def _started(self) -> EmulatorProcess:
        if self.log is None:
            return EmulatorProcess(*self._options)
        with self.log.open("ab") as file:
            return EmulatorProcess(*self._options, stderr=file)

    def controller(self, map_file: Path, **fields: object) -> Controller:
        """Start a controller on the relayed camera."""
        values = {
            "port": str(self.link),
            "map_file": str(map_file),
            "camera": f"zenoh:{RELAYED}" if self.relay else "zenoh",
            "baud": self.baud,
            "commands": 10_000,
            "planner": "reactive",
            "listen": [self.controller_endpoint],
            "connect": [self.endpoint],
            **({"zenoh_config": str(self.router.client)} if self.router else {}),
            **fields,
        }
        script = Path(__file__).with_name("controller_process.py")
        return self.start([sys.executable, str(script), json.dumps(values)])

    def start(self, command: Sequence[str], **popen: Any) -> Controller:
        controller = Controller(command, **popen)
        self.controllers.append(controller)
        return controller

    def truth(self) -> Sample:
        """Clock and speed of the faster wheel."""
        truth = self.bench.truth()
        return truth.time, max(map(abs, truth.speed))

    def wait_until_moving(self, patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while True:
            with suppress(BenchError):  # an emulator that has just come back
                if self.truth()[1] >= MOVING:
                    return
            assert time.monotonic() < end, "the robot does not move"

    def time_to_stand(self, longest: float = 5.0) -> float:
        """Seconds on the emulator's clock from now until the robot stands for good."""
        start = self.truth()[0]
        last_moving = start
        while True:
            now, speed = self.truth()
            if speed > STANDING:
                last_moving = now
            if now - last_moving > _REST or now - start > longest:
                return last_moving - start

    def motion(self, until: float) -> list[Sample]:
        """Clock and speed, again and again until a time of the robot's clock."""
        samples = [self.truth()]
        while samples[-1][0] < until:
            samples.append(self.truth())
        return samples

    def stops_within(self, limit: float, attempt: Callable[[], object], attempts: int = 3) -> bool:
        """Return whether the robot stops in time; a machine busy with others gets more tries.

        `attempt` makes it stop. A robot that only ends its command takes more than a second.
        """
        times: list[float] = []
        for _ in range(attempts):
            attempt()
            times.append(self.time_to_stand())
            if times[-1] < limit:
                return True
        raise AssertionError(f"the robot stood after {times} s")

    def make_ready(self) -> float:
        """As new: no controller, a good camera, the robot at its start; its clock at that time."""
        self.end_controllers()
        if self.relay:
            self.relay.mode = "pass"
        return self.bench.reset(Reset(seed=1)).time

    def end_controllers(self) -> None:
        while self.controllers:
            self.controllers.pop().close()

    def close(self) -> None:
        self.end_controllers()
        self._stack.close()
        self.emulator.end()
        if self.router:
            self.router.kill()


@contextmanager
def rig(folder: str | Path, *options: str, **settings: Any) -> Iterator[Rig]:
    # who is started in the background by a shell ignores Ctrl-C, and so would all programs here
    signal.signal(signal.SIGINT, signal.default_int_handler)
    bench = Rig(folder, *options, **settings)
    try:
        yield bench
    finally:
        bench.close()


def longest_stretch(samples: Sequence[Sample], *, moving: bool) -> float:
    """Seconds that the wheels turned, or stood, at a stretch."""
    longest, begin = 0.0, None
    for now, speed in samples:
        if (speed > STANDING) is not moving:
            begin = None
        elif begin is None:
            begin = now
        else:
            longest = max(longest, now - begin)
    return longest


__all__ = [
    "MOVING",
    "STANDING",
    "BenchError",
    "CameraRelay",
    "Controller",
    "Rig",
    "longest_stretch",
    "rig",
    "zenoh",
]
