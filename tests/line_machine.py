"""Actions of programs at a robot's line, in any order, as a state machine for Hypothesis.

The robot is in-process, so that steps take no real time. Whatever was done before, a line without
faults answers each request with one reply of its form and says nothing unasked; a line with faults
that end answers again when they have ended.
"""

from itertools import count
from math import inf, isfinite
from typing import Any
from urllib.parse import urlencode

from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)
from in_process import open_robot
from khepera_protocol.serial.commands import COMMANDS
from khepera_protocol.serial.messages import Request, parse_reply
from khepera_protocol.zenoh.payloads import Reset

from khepera_emulator.ports.protocol_khepera import Serial
from khepera_emulator.world.floor_plan import FloorPlan

TIMEOUT = 2.0
"""Seconds of the robot's time that a reply may take; virtual, they cost little."""

SILENCE = 0.3
"""Seconds of the robot's time without a byte after which it has said all, faults aside."""

ATTEMPTS = 40
"""Requests after which a line whose faults have ended must have answered."""

RARELY = 10
"""Steps between two openings or resets, at least."""

ends = st.sampled_from([b"\n", b"\r", b"\r\n"])
requests = st.sampled_from([row for row in COMMANDS.values() if not row.open_ended]).flatmap(
    lambda row: st.tuples(*(st.integers(f.low, f.high) for f in row.request)).map(
        lambda numbers: Request(row.letter, numbers)
    )
)
hits = st.integers(1, 4).map("n={}".format)
chances = st.sampled_from(["p=0.02", "p=0.3", "p=1"])
moments = st.sampled_from(["at=0.01", "at=0.2", "at=1.5"])
faults = st.one_of(
    st.tuples(
        st.sampled_from(["drop", "flip", "duplicate", "delay", "truncate", "stray"]), chances, hits
    ),
    st.tuples(st.sampled_from(["stall", "cut", "reset"]), chances, hits),
    st.tuples(st.sampled_from(["stray", "stall", "cut", "reset"]), moments),
).map(lambda words: f"{words[0]}:{','.join(words[1:])}")
robots = st.fixed_dictionaries(
    {
        "arena": st.sampled_from(["corridor", "open-box", "maze", "toys"]),
        "seed": st.integers(0, 999),
        "model": st.sampled_from(["khepera", "khepera2"]),
        "baud": st.sampled_from(["auto", "unpaced", "9600", "115200"]),
        "fault": st.lists(faults, max_size=2),
        "turret": st.sampled_from([[], ["gripper"], ["k213"]]),
    }
)


class LineMachine(RuleBasedStateMachine):
    """A program at a robot that it also opens anew.

    Attributes:
        steps: that all machines of this class have taken.
    """

    steps = 0

    def __init__(self) -> None:
        super().__init__()
        self._port: Serial | None = None
        self._now = -inf
        self._age = 0
        self._low = self._high = (0.0, 0.0)
        self._marks = count(1)

    @property
    def port(self) -> Serial:
        """The robot's, once it is switched on."""
        assert self._port is not None
        return self._port

    def teardown(self) -> None:
        if self._port:
            self._port.close()

    @initialize(robot=robots)
    def switch_on(self, robot: dict[str, Any]) -> None:
        options = dict(robot)
        url = f"khepera://{options.pop('arena')}?{urlencode(options, doseq=True)}"
        rate = int(robot["baud"]) if robot["baud"].isdecimal() else 9600
        self._port = open_robot(url, baudrate=rate, timeout=TIMEOUT)
        self.faulty = bool(robot["fault"])
        self.follows = robot["baud"] == "auto"
        self._started()

    # a new robot takes longer than all else
    @precondition(lambda self: self._age >= RARELY)
    @rule(robot=st.none() | robots)
    def reopen(self, robot: dict[str, Any] | None) -> None:
        self.port.close()
        if robot is None:
            self.port.open()
            self._started()
        else:
            self.switch_on(robot)

    @precondition(lambda self: self._age >= RARELY)
    @rule(seed=st.none() | st.integers(0, 99), random=st.booleans())
    def reset(self, seed: int | None, random: bool) -> None:
        self.port.emulator.reset(Reset(seed=seed, random=random))
        self.port.reset_input_buffer()
        self._age = 0
        if self.faulty:
            self._settled()

    @rule(request=requests, end=ends)
    def ask(self, request: Request, end: bytes) -> None:
        self.port.write(request.encode()[:-1] + end)
        self._answered(request)

    @rule(several=st.lists(requests, min_size=2, max_size=6), end=ends)
    def ask_back_to_back(self, several: list[Request], end: bytes) -> None:
        self.port.write(b"".join(each.encode()[:-1] + end for each in several))
        for each in several:
            self._answered(each)

    @rule(request=requests, pause=st.sampled_from([0.0, 0.001, 0.05]))
    def ask_byte_by_byte(self, request: Request, pause: float) -> None:
        for place, byte in enumerate(request.encode()):
            self._wait(pause if place else 0.0)
            self.port.write(bytes([byte]))
        self._answered(request)

    @rule(request=requests)
    def ask_by_polling(self, request: Request) -> None:
        self.port.write(request.encode())
        patience = self.port.now + TIMEOUT
        while not self.port.in_waiting and self.port.now < patience:
            pass
        self._answered(request)

    @rule(request=requests)
    def ask_and_flush(self, request: Request) -> None:
        self.port.write(request.encode())
        self.port.flush()
        self.port.reset_input_buffer()
        self._settled()

    @rule(garbage=st.binary(min_size=1, max_size=300))
    def write_garbage(self, garbage: bytes) -> None:
        self.port.write(garbage)
        self._settled()

    @rule(request=requests)
    def write_half_a_request(self, request: Request) -> None:
        self.port.write(request.encode()[:-1])
        self._settled()

    @rule(word=st.sampled_from([b"restart", b"help", b"net", b"memory", b"run sloader", b"S9"]))
    def run_a_tool(self, word: bytes) -> None:
        self.port.write(word + b"\n")
        self._settled()

    @rule(seconds=st.sampled_from([0.003, 0.02, 0.5, 3.0]))
    def let_time_pass(self, seconds: float) -> None:
        said = self._wait(seconds)
        assert self.faulty or said == b"", f"said unasked: {said!r}"

    @precondition(lambda self: self.follows)
    @rule(rate=st.sampled_from([9600, 19200, 38400, 115200]))
    def change_rate(self, rate: int) -> None:
        self.port.baudrate = rate

    @invariant()
    def time_passes_and_the_robot_is_in_its_arena(self) -> None:
        if not self._port:
            return
        LineMachine.steps += 1
        self._age += 1
        assert self.port.now >= self._now
        self._now = self.port.now
        pose = self.port.emulator.truth().pose
        assert isfinite(pose.heading)
        assert self._low[0] < pose.x < self._high[0]
        assert self._low[1] < pose.y < self._high[1]

    def _started(self) -> None:
        self._now = -inf
        self._age = 0
        self._low, self._high = FloorPlan(self.port.emulator.setup.arena).bounds()
        if self.faulty:
            self._settled()

    def _wait(self, seconds: float) -> bytes:
        self.port.timeout = seconds
        said = self.port.read(100_000)
        self.port.timeout = TIMEOUT
        return said

    def _answered(self, request: Request) -> None:
        """One reply of the request's form, at last."""
        if self.faulty:
            self._settled()
            return
        line = self.port.read_until(b"\n")
        assert line.endswith(b"\r\n"), f"{request} was answered by {line!r}"
        parse_reply(request, line[:-2])

    def _settled(self) -> None:
        """Whatever was said and done before: the robot soon answers what it is asked."""
        for mark in map(next, [self._marks] * ATTEMPTS):
            # the first line end completes what may have been begun
            self.port.write(b"\nG,%d,7\nP,0,0\nH\n" % mark)
            said = self._wait(SILENCE)
            # a robot that still rolls has counted on since
            if b"\r\ng\r\np\r\nh," in b"\r\n" + said and said.endswith(b"\r\n"):
                return
        raise AssertionError(f"no answer after {ATTEMPTS} requests, at last {said!r}")
