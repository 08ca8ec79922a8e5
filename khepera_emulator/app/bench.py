"""The bench of running emulators: where their robots are, and being put elsewhere."""

from collections.abc import Iterator
from contextlib import contextmanager

import zenoh
from khepera_protocol.text import did_you_mean, in_order, printable
from khepera_protocol.zenoh.ask import PATIENCE, AskError, ask
from khepera_protocol.zenoh.keys import EMULATOR_ALIVE, RESET, TRUTH, Key
from khepera_protocol.zenoh.payloads import Reset, Truth
from khepera_protocol.zenoh.session import open_session

from khepera_emulator.app.options import BenchOptions
from khepera_emulator.errors import EmulatorError


class Bench:
    """Robots that are asked over Zenoh.

    Args:
        session: an open session, which stays its owner's.
        robot: name of the only one that counts; None: all that are found.
        where: text for messages that says where they are looked for.

    Raises:
        EmulatorError: no emulator answers, or it has no such robot.
    """

    def __init__(self, session: zenoh.Session, robot: str | None, where: str) -> None:
        self._session = session
        there = _names(session)
        if not there:
            raise EmulatorError(
                f"no emulator answers {where}; start one with `khepera-emulator run`, or name its"
                " --listen endpoint with --connect"
            )
        if robot is not None and robot not in there:
            hint = did_you_mean(robot, there)
            raise EmulatorError(f"there is no robot {robot!r}; {hint}there are {_listed(there)}")
        self.names = there if robot is None else [robot]

    @property
    def only(self) -> str:
        """The name of the robot, where there is but one.

        Raises:
            EmulatorError: there are several.
        """
        if len(self.names) > 1:
            raise EmulatorError(
                f"there are several robots, {_listed(self.names)}: name one with --robot"
            )
        return self.names[0]

    def truth(self, robot: str) -> Truth:
        """Return where a robot is.

        Raises:
            EmulatorError: it does not answer.
        """
        return self._ask(robot, TRUTH)

    def reset(self, robot: str, reset: Reset) -> Truth:
        """Put a robot somewhere, powered on afresh; return where it is then.

        Raises:
            EmulatorError: the place is not free, or the robot does not answer.
        """
        return self._ask(robot, RESET, reset)

    def _ask(self, robot: str, key: Key, request: Reset | None = None) -> Truth:
        try:
            return ask(self._session, robot, key, Truth, request)
        except AskError as error:
            raise EmulatorError(str(error)) from None


@contextmanager
def open_bench(options: BenchOptions) -> Iterator[Bench]:
    """Open the bench that options name.

    Raises:
        EmulatorError: no emulator answers, it has no such robot, or no session can be opened.
    """
    file = options.zenoh_config
    where = f"as {file} says" if file else f"on {', '.join(options.connect)}"
    with open_session([], options.connect, file, error=EmulatorError) as session:
        yield Bench(session, options.robot, where)


def _names(session: zenoh.Session) -> list[str]:
    """Return the names of all robots that are switched on, in order."""
    replies = session.liveliness().get(EMULATOR_ALIVE.of("*"), timeout=PATIENCE)
    keys = [str(reply.ok.key_expr) for reply in replies if reply.ok]
    return sorted({key.split("/")[1] for key in keys}, key=in_order)


def _listed(names: list[str]) -> str:
    return printable(", ".join(names), 500)
