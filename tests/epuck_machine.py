"""Actions of programs at an e-puck's line, in any order, as a state machine for Hypothesis.

The robot is in-process. Whatever was sent before, it soon answers what it is asked; a request in
text and a command in a row have the answers that the tables of their firmware say.
"""

from itertools import count
from math import isfinite
from typing import Any

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from in_process import open_robot
from khepera_protocol.epuck import codes, letters
from khepera_protocol.epuck.codes import Code
from khepera_protocol.epuck.generations import BTCOM, GCTRONIC, GCTRONIC2, Generation
from khepera_protocol.zenoh.payloads import Reset

from khepera_emulator.ports.protocol_khepera import Serial

TIMEOUT = 2.5
SILENCE = 0.3
ATTEMPTS = 20

PROFILES = [(GCTRONIC, "epuck"), (BTCOM, "epuck"), (GCTRONIC2, "epuck2")]
FLUSH = b"\0" * 40 + b"\r\r"
"""Ends whatever was begun: a command's parameters, a row, a line."""

NUMBERS = "ACEgINOQ"
"""Letters that are answered by a line of numbers in all firmwares that know them."""


class EpuckMachine(RuleBasedStateMachine):
    """A program at an e-puck."""

    def __init__(self) -> None:
        super().__init__()
        self._port: Serial | None = None
        self._marks = count(1)
        self._now = 0.0
        self._faulty = False

    @property
    def port(self) -> Serial:
        """The robot's, once it is switched on."""
        assert self._port is not None
        return self._port

    def teardown(self) -> None:
        if self._port:
            self._port.close()

    @initialize(
        profile=st.sampled_from(PROFILES),
        arena=st.sampled_from(["corridor", "open-box", "toys"]),
        seed=st.integers(0, 999),
        baud=st.sampled_from(["auto", "unpaced", "9600"]),
        fault=st.sampled_from(["", "", "flip:p=0.05,n=3", "drop:p=0.3,n=4", "reset:p=0.2,n=2"]),
    )
    def switch_on(
        self, profile: tuple[Generation, str], arena: str, seed: int, baud: str, fault: str
    ) -> None:
        generation, model = profile
        options = f"model={model}&profile={generation.name}&seed={seed}&baud={baud}"
        options += f"&fault={fault}" if fault else ""
        rate = 9600 if baud == "9600" else 115_200
        url = f"khepera://{arena}?{options}"
        self._port = open_robot(url, baudrate=rate, timeout=TIMEOUT)
        self.generation = generation
        self._faulty = bool(fault)
        self._settled()

    @rule(letter=st.sampled_from(NUMBERS), end=st.sampled_from([b"\r", b"\n"]))
    def ask_in_text(self, letter: str, end: bytes) -> None:
        known = letter in self.generation.letters
        self.port.write(letter.encode() + end)
        if self._faulty:
            self._settled()
            return
        line = self.port.read_until(b"\n")
        assert line.endswith(b"\r\n")
        if known:
            letters.reply_numbers(letter, line[:-2])

    @rule(data=st.data())
    def send_a_row(self, data: st.DataObject) -> None:
        table = sorted(self.generation.codes.values(), key=lambda code: code.byte)
        chosen: list[Code] = data.draw(st.lists(st.sampled_from(table), max_size=5))
        sent, due = b"", 0
        for code in chosen:
            parameters = data.draw(st.binary(min_size=code.parameters, max_size=code.parameters))
            sent += bytes([code.byte]) + parameters
            if code.answer is None:
                due += codes.PICTURE_HEAD + self.port.emulator.robot.panel.picture.size
            else:
                due += code.answer + codes.SOUND_BUFFER * (code.name == "U" and code.answer > 0)
        self.port.write(sent + b"\0")
        said = self._wait(SILENCE + due * 10 / 9600)
        assert self._faulty or len(said) == due

    @rule(
        letter=st.sampled_from(sorted(letters.LETTERS)),
        words=st.lists(st.integers(-70_000, 70_000).map(str) | st.sampled_from(["", "x", "1.5"])),
    )
    def send_numbers(self, letter: str, words: list[str]) -> None:
        self.port.write(",".join([letter, *words]).encode() + b"\r")
        self._settled()

    @rule(garbage=st.binary(min_size=1, max_size=200))
    def write_garbage(self, garbage: bytes) -> None:
        self.port.write(garbage)
        self._settled()

    @rule(seed=st.none() | st.integers(0, 99))
    def reset(self, seed: int | None) -> None:
        self.port.emulator.reset(Reset(seed=seed))
        self.port.reset_input_buffer()
        self._settled()

    @precondition(lambda self: not self._faulty)
    @rule(seconds=st.sampled_from([0.01, 0.5]))
    def let_time_pass(self, seconds: float) -> None:
        assert self._wait(seconds) == b""

    @invariant()
    def time_passes_and_the_robot_is_somewhere(self) -> None:
        if not self._port:
            return
        assert self.port.now >= self._now
        self._now = self.port.now
        pose = self.port.emulator.truth().pose
        assert isfinite(pose.x + pose.y + pose.heading)

    def _wait(self, seconds: float) -> bytes:
        self.port.timeout = seconds
        said: bytes = self.port.read(100_000)
        self.port.timeout = TIMEOUT
        return said

    def _settled(self) -> None:
        """Whatever was said and done before: the robot soon answers what it is asked."""
        said: Any = b""
        for mark in map(next, [self._marks] * ATTEMPTS):
            self._wait(SILENCE)
            self.port.write(FLUSH)
            self._wait(TIMEOUT)
            value = mark % 1000
            self.port.write(b"D,0,0\rP,%d,7\rQ\r" % value)
            said = self._wait(SILENCE)
            if said.endswith(b"d\r\np\r\nq,%d,7\r\n" % value):
                return
        raise AssertionError(f"no answer after {ATTEMPTS} requests, at last {said!r}")
