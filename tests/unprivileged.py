"""Code that runs as a user without privileges: root may do what is refused to others."""

import os
import signal
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest

NOBODY = 65534
LONGEST = 60
"""Seconds after which the process is ended."""


def give_up_root() -> None:
    """Become nobody, for good."""
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)


def as_nobody(function: Callable[[], None]) -> None:
    """Call a function in a process of an unprivileged user; its failure is the test's.

    It must import nothing: an interpreter's files may be root's alone.
    """
    if os.geteuid() != 0:
        function()
        return
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(reader)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(LONGEST)
            try:
                give_up_root()
            except OSError:
                status = 2
                raise
            function()
            status = 0
        except BaseException:
            os.write(writer, traceback.format_exc().encode()[-4000:])
        finally:
            os._exit(status)
    os.close(writer)
    with open(reader, "rb") as pipe:  # noqa: PTH123 - a descriptor
        said = pipe.read().decode()
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if status == 2:
        pytest.skip(f"nobody else can be become here: {said.splitlines()[-1]}")
    assert status == 0, said


def enter_from_outside(folder: Path) -> None:
    """Let everybody reach a folder of pytest's, which makes them for its own user."""
    made = ("pytest-", "popen-", "test_")  # pytest's own, one of its workers, the test's
    for each in [folder, *folder.parents]:
        if each.stat().st_uid == os.getuid() and each.name.startswith(made):
            each.chmod(each.stat().st_mode | 0o011)
