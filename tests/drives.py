"""Every program that drives a robot, as a process of its own on a rig; and every way to end one."""

import fcntl
import os
import select
import signal
import subprocess
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import serial
from emulator_process import PATIENCE, free_endpoint
from rig import Closing, Rig

MACOR_HIL = [sys.executable, "-m", "macor_hil.cli"]

SLOW = 2
"""Greatest wheel speed, counts / 10 ms: a command takes 1.7 s, a leg of a calibration 19 s."""

_LOOK = 20
"""Milliseconds between two looks at whether the terminal is to be closed."""

LEARNER = """
import signal
import sys
from functools import partial
import gymnasium
import macor_hil.environment.single as environments
from macor_hil.hardware.driver import DriveSettings
port, pictures, baud, name = sys.argv[1:]
environments.open_hardware = partial(environments.open_hardware, baud=int(baud))
env = gymnasium.make(
    f"khepera/{name}-v0", port=port, camera=f"images:{pictures}", drive=DriveSettings(speed=2)
).unwrapped
env.reset()
signal.signal(signal.SIGUSR1, lambda *_: 1 / 0)
while True:
    env.step(2 if name == "Commands" else [0.016, 0.016])
"""
"""A learner without any care for its end."""


def programs(rig: Rig, map_file: Path, port: str | Path | None = None) -> dict[str, list[str]]:
    """Commands that drive the rig's robot slowly for long, by name."""
    port = str(port or rig.link)
    line = ["--port", port, "--baud", str(rig.baud), "--speed", str(SLOW)]
    emulator = ["--connect", rig.endpoint]
    new = rig.folder / f"new-{free_endpoint().rpartition(':')[2]}"
    listen = ["--listen", free_endpoint()]
    many = ["--commands", "10000", "--planner", "reactive"]
    return {
        "run": [*MACOR_HIL, "run", *line, *emulator, *listen, *many, "--map", str(map_file)],
        "train": [*MACOR_HIL, "train", *line, *emulator, "--map", f"{new}.npz"],
        "trials": [*MACOR_HIL, "trials", *line, *emulator, "--map", str(map_file)],
        "calibrate": [
            *(*MACOR_HIL, "calibrate", *line, *emulator, "--emulated"),
            *("--side", "0.3", "--profile", f"{new}.json"),
        ],
        **{name: learner(rig, name, port) for name in ("Commands", "Wheels")},
    }


def learner(rig: Rig, name: str, port: str) -> list[str]:
    """A learner in an environment, whose camera shows pictures from files."""
    pictures = rig.folder / "pictures"
    if not pictures.exists():
        pictures.mkdir()
        for number in range(1000):
            cv2.imwrite(str(pictures / f"{number:04}.png"), _PICTURE)
    return [sys.executable, "-c", LEARNER, port, str(pictures), str(rig.baud), name]


_PICTURE = np.random.default_rng(1).integers(0, 255, (160, 160, 3), np.uint8)


class Drive:
    """A program on a terminal of its own.

    Args:
        controllers: where to put it, for its end.
        command: the program.
        output: whether its standard output is a pipe instead, which can be closed.
    """

    def __init__(
        self, controllers: list[Closing], command: list[str], *, output: bool = False, **popen: Any
    ) -> None:
        self._master, terminal = os.openpty()
        self._output: int | None
        self._output, given = os.pipe() if output else (None, terminal)
        self._closing = False
        self._came = threading.Condition()
        # a terminal that nobody reads from would hold up who writes to it
        self._reader = threading.Thread(target=self._read, daemon=True)

        def take_the_terminal() -> None:
            os.setsid()
            fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)

        self.process = subprocess.Popen(
            command,
            stdin=terminal,
            stdout=given,
            stderr=terminal,
            preexec_fn=take_the_terminal,
            **popen,
        )
        self.said = b""
        self._reader.start()
        for descriptor in {terminal, given}:
            os.close(descriptor)
        controllers.append(self)

    def signal(self, number: int) -> None:
        os.kill(self.process.pid, number)

    def close_terminal(self) -> None:
        self._closing = True
        self._reader.join()

    def close_output(self) -> None:
        assert self._output is not None
        os.close(self._output)
        self._output = None

    def wait_for(self, words: bytes) -> None:
        """Return when it has said something, at the end of a line or not."""
        with self._came:
            assert self._came.wait_for(lambda: words in self.said, PATIENCE), self.said

    def answer(self, line: bytes) -> None:
        """Type a line, or a key such as Ctrl-C."""
        os.write(self._master, line)

    def wait(self) -> int:
        """Its exit status."""
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        self.process.kill()
        self.process.wait(PATIENCE)
        self.close_terminal()
        if self._output is not None:
            self.close_output()

    def _read(self) -> None:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        while not self._closing:
            try:
                came = os.read(self._master, 4096) if poll.poll(_LOOK) else b""
            except OSError:  # nobody is at the other end any more
                time.sleep(_LOOK / 1000)
                continue
            with self._came:
                self.said += came
                self._came.notify_all()
        os.close(self._master)


class Cable:
    """A serial line between a program and the rig's robot that can be pulled.

    Attributes:
        port: the program's end.
    """

    def __init__(self, rig: Rig) -> None:
        self._robot = serial.Serial(str(rig.link), rig.baud, stopbits=2, timeout=0)
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._pulled = self._ended = False
        self._carrier = threading.Thread(target=self._carry, daemon=True)
        self._carrier.start()
        rig.controllers.append(self)

    def pull(self) -> None:
        self._pulled = True

    def close(self) -> None:
        self._ended = True
        self._carrier.join()
        self._robot.close()
        os.close(self._master)
        os.close(self._slave)

    def _carry(self) -> None:
        poll = select.poll()
        robot = self._robot.fileno()
        ends = {self._master: robot, robot: self._master}
        for end in ends:
            poll.register(end, select.POLLIN)
        while not self._ended:
            for end, _ in poll.poll(_LOOK):
                data = os.read(end, 4096)
                if not self._pulled:
                    os.write(ends[end], data)


WAYS_OUT: dict[str, Callable[[Drive], None]] = {
    "Ctrl-C": lambda drive: drive.signal(signal.SIGINT),
    "SIGTERM": lambda drive: drive.signal(signal.SIGTERM),
    "SIGHUP": lambda drive: drive.signal(signal.SIGHUP),
    "SIGQUIT": lambda drive: drive.signal(signal.SIGQUIT),
    "terminal closed": Drive.close_terminal,
}
"""Events that may end any of them."""

STATUSES = {"Ctrl-C": 130, "SIGTERM": 0, "SIGHUP": 0, "SIGQUIT": 130, "terminal closed": 0}
"""The end of a command of `macor-hil` then."""
