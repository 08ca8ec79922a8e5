"""`make pyserial-suite`: pySerial's own tests on a pseudo-terminal of the emulator.

In the robot's place an echo answers, as the suite expects of a loop. The suite comes from
pySerial's source distribution, which pip fetches into a temporary folder. Prints what failed;
docs/ports.md explains each. Exit status 1 when anything failed that is not explained there.
"""

import re
import select
import subprocess
import sys
import tarfile
import threading
from pathlib import Path
from tempfile import TemporaryDirectory

import serial

from khepera_emulator.ports.pty import PtyPort

PERIOD = 0.05
PATIENCE = 600.0
MUCH = 4096
EXPLAINED = frozenset(
    {
        "test.Test0_DataWires.test1_RTS",
        "test.Test0_DataWires.test2_DTR",
        "test.Test0_DataWires.test3_RI",
        "test.Test3_Timeout.test2_Loopback",
        "test.Test4_Nonblocking.test2_Loopback",
        "test.Test_MoreTimeouts.test_WriteTimeout",
        "test_cancel.TestCancelWrite.test_cancel_once",
        "test_high_load.TestHighLoad.test1_WriteWriteReadLoopback",
        "test_readline.Test_Readline.test_for_in",
        "test_rs485.Test_RS485_class.test_RS485_class",
    }
)
"""Cases that fail, or may fail, on a pseudo-terminal; see docs/ports.md."""


def main() -> None:
    with TemporaryDirectory() as folder:
        suite = fetch(Path(folder))
        port, ended = PtyPort(), threading.Event()
        thread = threading.Thread(target=echo, args=(port, ended))
        thread.start()
        try:
            said = run(suite, port.url)
        finally:
            ended.set()
            thread.join()
            port.close()
    failed = set(re.findall(r"^(?:FAIL|ERROR): \w+ \(([\w.]+)\)", said, re.MULTILINE))
    others = ", ".join(sorted(failed - EXPLAINED)) or "nothing"
    sys.stdout.write(f"{said}\nfailed beyond what docs/ports.md explains: {others}\n")
    sys.exit(bool(failed - EXPLAINED) or "Ran " not in said)


def fetch(folder: Path) -> Path:
    """Get the tests of the pySerial that is installed."""
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-binary", ":all:", "--no-build-isolation", "--dest", str(folder)]
    subprocess.run([*pip, *options, f"pyserial=={serial.__version__}"], check=True)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as source:
        source.extractall(folder, filter="data")
    return folder / archive.name.removesuffix(".tar.gz") / "test"


def run(suite: Path, url: str) -> str:
    """Return the suite's report on a port."""
    command = [sys.executable, "run_all_tests.py", url, "-v"]
    done = subprocess.run(
        command,
        cwd=suite,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    return done.stdout


def echo(port: PtyPort, ended: threading.Event) -> None:
    """Say to each client what it has said, until the end."""
    said = b""
    while not ended.is_set():
        select.select(port.descriptors(room=True), (), (), PERIOD)
        for chunk in port.receive(MUCH):
            said = said + chunk if chunk else b""
        if said and not port.changed():
            port.write(said)
            said = b""


if __name__ == "__main__":
    main()
