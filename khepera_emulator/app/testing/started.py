"""A robot in a process of its own, on a pseudo-terminal: `khepera_emulator.start`."""

import socket
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Self, TypeVar

from khepera_protocol.options import OptionError, from_strings, to_strings
from khepera_protocol.validation import first_fault
from khepera_protocol.zenoh.payload_model import PayloadError
from khepera_protocol.zenoh.payloads import Reset, Truth
from pydantic import ConfigDict, Field, ValidationError

from khepera_emulator.app.control import Answer, Request
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.wire_log import Entry, read_log
from khepera_emulator.robot.options import RobotOptions

# without -P a file of the program under test might be taken for a library's
_COMMAND: Final = (sys.executable, "-P", "-m", "khepera_emulator.app.cli", "run", "--control")
_NAME: Final = "khepera-emulator: "
"""Beginning of the sentence that says why it has ended."""

_PATIENCE: Final = 60.0
"""Seconds that a start, or an answer, may take on a busy machine."""

_LAST_WORDS: Final = 5.0
"""Seconds that an emulator may take to end before it is killed."""


def start(
    arena: str | Path = "corridor", *, folder: Path | None = None, **options: Any
) -> "StartedRobot":
    """Switch on a robot in a process of its own, on a pseudo-terminal.

        with khepera_emulator.start(arena="corridor", seed=1) as robot:
            subprocess.run(["./my-program", robot.port], check=True)
            assert not robot.truth().touched

    Args:
        arena: name of an arena, or path of a TOML file.
        folder: see `StartedRobot`.
        options: those of `khepera-emulator run` that make a robot, such as `seed=1` and
            `fault=["drop:p=0.01"]`, and `speed`.

    Raises:
        EmulatorError: an option names nothing that there is, or the system refuses something.
    """
    return StartedRobot(options_of(StartOptions, {"arena": arena, **options}), folder)


_O = TypeVar("_O", bound=RobotOptions)


def options_of(model: type[_O], values: Mapping[str, Any]) -> _O:
    """Read the options of one robot from values by their names; a list gives an option repeatedly.

    Raises:
        EmulatorError: an option is unknown or has a value that does not fit.
    """
    pairs = [
        (name, str(each))
        for name, value in values.items()
        for each in (value if isinstance(value, list | tuple) else [value])
        if each is not None
    ]
    try:
        options = from_strings(model, pairs)
    except OptionError as error:
        raise EmulatorError(str(error)) from None
    if options.robots > 1:
        raise EmulatorError(
            "robots: several in one world are started with `khepera-emulator run --robots`"
        )
    return options


class StartOptions(RobotOptions):
    """Options of a robot that is started for a test."""

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    speed: float = Field(default=1.0, ge=0.01, le=1000.0, description="Speed-up of its time.")


class StartedRobot:
    """A robot that lives in real time; use as a context, or call `close`.

    Its process ends with `close`, and with the process that has started it, however that ends.
    It takes no Ctrl-C from the terminal: the program under test may still talk to it then.

    Args:
        options: what it is made from.
        folder: place of its wire log; None: a temporary one, which goes with the robot.

    Attributes:
        port: path of its pseudo-terminal, for the program under test.
        log_file: its wire log, written as it runs; `khepera-emulator replay` plays it again.
        pid: number of its process.

    Raises:
        EmulatorError: it cannot be started; the message is what the emulator says.
        OSError: the folder cannot be written.
    """

    def __init__(self, options: StartOptions, folder: Path | None = None) -> None:
        with ExitStack() as stack:
            if folder is None:
                folder = Path(stack.enter_context(TemporaryDirectory(prefix="khepera-")))
            folder = folder.absolute()  # a test may go elsewhere
            self.log_file = folder / "wire.jsonl"
            self._errors = folder / "emulator.txt"
            self._control, theirs = socket.socketpair()
            stack.callback(self._control.close)
            with theirs, self._errors.open("wb") as errors:
                self._process = subprocess.Popen(
                    [*_COMMAND, "--no-zenoh", f"--record={self.log_file}", *_flags(options)],
                    stdin=theirs.fileno(),
                    stdout=theirs.fileno(),
                    stderr=errors,
                    start_new_session=True,
                )
            self.pid = self._process.pid
            stack.callback(self._end)
            self._control.settimeout(_PATIENCE)
            self._answers = stack.enter_context(self._control.makefile("rb"))
            self.port = self._line().partition(" on ")[2]
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Switch the robot off, and wait for the end of its process."""
        self._stack.close()

    def truth(self) -> Truth:
        """Return where the robot really is, and whether it touches or has touched something.

        Raises:
            EmulatorError: its process has ended.
        """
        return self._ask(Request())

    def place(self, x: float, y: float, heading: float = 0.0) -> Truth:
        """Put the robot somewhere, at rest and powered on afresh.

        Args:
            x: metres.
            y: metres.
            heading: radians, counter-clockwise from the x axis.

        Raises:
            EmulatorError: the place is not free, and nothing has changed; or its process has ended.
        """
        return self._reset(pose={"x": x, "y": y, "heading": heading})

    def reset(self, *, seed: int | None = None, random: bool = False) -> Truth:
        """Put the robot where it started, at rest and powered on afresh.

        Args:
            seed: start all chance anew, and put all things back; None: chance goes on.
            random: a free place drawn by chance instead of the start.

        Raises:
            EmulatorError: the seed is none, or the robot's process has ended.
        """
        return self._reset(seed=seed, random=random)

    @property
    def wire_log(self) -> tuple[Entry, ...]:
        """All that has passed on the line up to now, in order; the last may be of a moment ago.

        Raises:
            EmulatorError: the log cannot be read: it has gone with a robot that is closed.
        """
        with suppress(EmulatorError):  # an answer comes after all that it must be behind
            self.truth()
        return read_log(self.log_file).entries

    def _reset(self, **wanted: Any) -> Truth:
        try:
            reset = Reset.model_validate(wanted)
        except ValidationError as error:
            raise EmulatorError(first_fault(error, "the reset")) from None
        return self._ask(Request(reset=reset))

    def _ask(self, request: Request) -> Truth:
        with suppress(OSError):  # it has ended, or is closed: there is no answer either
            self._control.sendall(request.model_dump_json(exclude_none=True).encode() + b"\n")
        try:
            answer = Answer.parse(self._line().encode())
        except PayloadError as error:
            raise EmulatorError(f"what the emulator says is no answer: {error}") from None
        if answer.truth is None:
            raise EmulatorError(answer.error)
        return answer.truth

    def _line(self) -> str:
        """Return the next line that the emulator says.

        Raises:
            EmulatorError: it says none any more.
        """
        try:
            line = self._answers.readline()
        except TimeoutError:
            raise EmulatorError(f"the emulator has said nothing for {_PATIENCE:g} s") from None
        except (OSError, ValueError):
            line = b""
        if not line.endswith(b"\n"):
            raise EmulatorError(self._reason())
        return line.decode().rstrip("\n")

    def _reason(self) -> str:
        """Return a sentence that says why the emulator says nothing any more."""
        if self._control.fileno() < 0:
            return "the robot is switched off"
        try:
            status = self._process.wait(_LAST_WORDS)
        except subprocess.TimeoutExpired:
            return "the emulator does not answer"
        said: list[str] = []
        with suppress(OSError):  # a test may have taken the folder away
            said = self._errors.read_text("utf-8", "replace").strip().splitlines()
        if said and said[-1].startswith(_NAME):
            return said[-1].removeprefix(_NAME)
        return f"the emulator has ended with status {status}" + (f": {said[-1]}" if said else "")

    def _end(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(_LAST_WORDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _flags(options: StartOptions) -> list[str]:
    """Return the options of the command line that say the same."""
    return [f"--{name}={value}" for name, value in to_strings(options)]
