"""A system without a pseudo-terminal: what Windows lacks is hidden from this project's modules.

Run as a program, it does what its argument says, as far as that works there.
"""

import builtins
import os
import pkgutil
import select
import signal
import socket
import sys
import threading
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

HIDDEN = frozenset({"fcntl", "termios", "tty", "pty", "resource", "pwd", "grp"})
OURS = ("khepera_", "macor_hil")
LACKING: dict[ModuleType, tuple[str, ...]] = {
    os: (
        *("eventfd", "eventfd_read", "eventfd_write", "EFD_CLOEXEC", "EFD_NONBLOCK"),
        *("openpty", "O_NONBLOCK", "O_CLOEXEC", "O_NOFOLLOW", "fork", "getuid"),
    ),
    select: ("poll", "epoll"),
    signal: ("SIGHUP", "SIGQUIT", "SIGUSR1", "pthread_kill", "pthread_sigmask", "setitimer"),
    socket: ("TCP_KEEPIDLE",),
}
TERMINAL_ONLY = (
    "khepera_emulator.ports.pty",
    "khepera_emulator.ports.terminal",
    "khepera_emulator.ports.inotify",
)


def hide() -> None:
    """Hide it all; libraries that are imported later may have the modules, and not the rest."""
    import cv2  # noqa: F401
    import serial  # noqa: F401
    import zenoh  # noqa: F401

    real, locks = builtins.__import__, windows_locks()

    def found(name: str, scope: Any = None, *rest: Any, **others: Any) -> Any:
        asked_by = str((scope or {}).get("__name__", ""))
        if asked_by.startswith(OURS) and name in HIDDEN:
            raise ImportError(f"{name} is hidden")
        if asked_by.startswith(OURS) and name == "msvcrt":
            return locks
        return real(name, scope, *rest, **others)

    vars(builtins)["__import__"] = found
    for module, names in LACKING.items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)


def windows_locks() -> Any:
    """Return a stand-in for the module by which files are locked on Windows."""
    import fcntl

    def locking(descriptor: int, mode: int, count: int) -> None:
        assert mode == msvcrt.LK_NBLCK
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, count, 0, os.SEEK_CUR)
        except OSError:
            raise PermissionError(13, "Permission denied") from None

    msvcrt: Any = ModuleType("msvcrt")
    msvcrt.LK_NBLCK, msvcrt.locking = 2, locking
    return msvcrt


def import_all() -> None:
    """Import every module of the project but those of the terminal, and of extras not there."""
    for package in ("khepera_protocol", "khepera_emulator", "macor_hil"):
        root = import_module(package)
        for found in pkgutil.walk_packages(root.__path__, f"{package}."):
            if found.name not in TERMINAL_ONLY and not found.name.endswith("__main__"):
                import_module(found.name)


def train_and_drive(folder: Path) -> None:
    """Train a map in this process, and drive trials and a run by it."""
    from macor_hil.cli.program import app

    there = ["--map", str(folder / "a.npz")]
    app(["train", *there, "--tuning", "20", "--random", "150"], standalone_mode=False)
    app(["trials", *there, "--trials", "1"], standalone_mode=False)
    url = "khepera://corridor?seed=1"
    app(["run", *there, "--port", url, "--commands", "3"], standalone_mode=False)


def serve() -> None:
    """Serve a robot on a TCP port, and ask it something."""
    import serial as pyserial

    from khepera_emulator.app.daemon import Daemon
    from khepera_emulator.line.clock import Clock
    from khepera_emulator.ports.tcp import TcpPort
    from khepera_emulator.robot.emulator import Emulator
    from khepera_emulator.robot.options import UrlOptions

    emulator = Emulator(UrlOptions.from_url("khepera://corridor").setup())
    daemon = Daemon(emulator, Clock())
    port = TcpPort("127.0.0.1:0")
    daemon.add(emulator, port)
    thread = threading.Thread(target=daemon.run)
    thread.start()
    try:
        with pyserial.serial_for_url(port.url, timeout=5) as line:
            line.write(b"H\n")
            assert line.read_until(b"\n") == b"h,0,0\r\n"
    finally:
        daemon.stop()
        thread.join()
        port.close()
        emulator.close()


if __name__ == "__main__":
    hide()
    match sys.argv[1:]:
        case ["import"]:
            import_all()
        case ["drive", folder]:
            train_and_drive(Path(folder))
        case ["serve"]:
            serve()
