"""A whole robot on a serial line, as a function of time: the core behind every port.

A port puts bytes in, lets time pass and takes bytes out. Nothing here reads a clock: `advance`
brings physics, interpreter and line to a given time, in the caller's thread, so that the same
bytes at the same times give the same bytes back. Robots of one world (`make_fleet`) have one time:
it passes for all of them when it passes for one.
"""

import logging
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from khepera_protocol.serial.errors import RequestError
from khepera_protocol.text import printable
from khepera_protocol.zenoh.payloads import FaultsOn, FaultSwitch, Outline, Pose, Push, Reset, Truth

from khepera_emulator.body.drift import draw_drift
from khepera_emulator.errors import EmulatorError
from khepera_emulator.line.fault import Happening
from khepera_emulator.line.fault_text import MOST_FAULTS, parse_fault
from khepera_emulator.line.faults import Faults
from khepera_emulator.line.uart import Uart, on_grid
from khepera_emulator.robot.ailments import Ailments
from khepera_emulator.robot.compiled.watcher import Arc, Driven, Watched, Watcher
from khepera_emulator.robot.fleet import Fleet
from khepera_emulator.robot.kind import Berth, Console, kind_of
from khepera_emulator.robot.rolling import Rolling
from khepera_emulator.robot.setup import Setup as Setup
from khepera_emulator.senses.camera import OmniCamera
from khepera_emulator.senses.renderers.view import Image
from khepera_emulator.world.free_space import Gap, anywhere, check_room, pose_of, random_pose
from khepera_emulator.world.outline import outline
from khepera_emulator.world.solids import Footprint

_log = logging.getLogger(__name__)


_MOST_REFUSALS = 20
"""Refused requests of a client that are logged one by one: garbage has many of them."""


def _log_fault(happening: Happening) -> None:
    _log.info("fault at %s", happening)


class _Streams(NamedTuple):
    """Independent random numbers for a robot's making, drives, camera, places and line."""

    making: np.random.Generator
    driving: np.random.Generator
    camera: np.random.Generator
    places: np.random.Generator
    line: np.random.Generator


def _streams(seed: int, number: int) -> _Streams:
    entropy = seed if number == 0 else (seed, number)
    return _Streams(*np.random.default_rng(entropy).spawn(5))


class Emulator:
    """One emulated robot with its world, its line and its camera.

    Args:
        setup: what it is made from.
        fleet: the robots whose world it shares; none: it has one of its own.

    Attributes:
        now: time that everything has been brought to, in seconds; a multiple of `uart.GRID`.
        uart: the serial line.
        start_pose: where it was put down at first.

    Raises:
        EmulatorError: its start is not free, or there is no room for it.
    """

    def __init__(self, setup: Setup, fleet: Fleet | None = None) -> None:
        self.setup = setup
        self._kind = kind_of(setup.model)
        dialect = self._kind.dialect(setup.model, setup.choices)
        self.uart = Uart(setup.baud, Faults(setup.faults, tell=_log_fault), dialect)
        self.now = 0.0
        self._fleet = fleet or Fleet(setup.arena, setup.model.radius, rigid=setup.rigid)
        self._number = len(self._fleet.members)
        self._next_rate: int | None = None
        self._later: list[tuple[float, bytes]] = []
        self._refusals = 0
        self._watcher: Watcher | None = None
        self._ailments: Ailments | None = None
        streams = _streams(setup.seed, self._number)
        # a robot keeps its wheels for life: a reset begins chance anew, not the robot
        self._drift = draw_drift(setup.drift, setup.model.wheel_base, streams.making)
        try:
            self.start_pose = self._find_start(streams.making)
        except EmulatorError:
            self.close()
            raise
        self._build(self.start_pose, streams)
        self._fleet.join(self)

    def close(self) -> None:
        """Give back the world, which is that of the whole fleet."""
        self._fleet.close()

    @property
    def fleet(self) -> Fleet:
        """The robots that it shares its world with, itself among them."""
        return self._fleet

    @property
    def robot(self) -> Any:
        """The robot of its kind, as its firmware finds it; another one after a seeded reset."""
        return self._robot

    @property
    def radius(self) -> float:
        """Of its body, in metres."""
        return self.setup.model.radius

    def write(self, data: bytes) -> None:
        """Put bytes of the client on the line, now."""
        self.uart.receive(data, self.now)

    def read(self, limit: int | None = None) -> bytes:
        """Take the bytes that have reached the client by now."""
        return self.uart.sent(self.now, limit)

    def hang_up(self) -> None:
        """Let the client leave the line; the robot does not notice and goes on."""
        self.uart.hang_up()
        if self._refusals > _MOST_REFUSALS:
            _log.info("robot %d has refused %d requests", self._number + 1, self._refusals)
        self._refusals = 0

    @property
    def moving(self) -> bool:
        """True if the wheels of a robot of this world turn or are driven, or a thing moves."""
        return self._fleet.moving

    def advance(self, until: float) -> None:
        """Let time pass: drive, carry out the requests that arrive, answer them."""
        self._fleet.advance(max(on_grid(until), self.now))

    def reach(self, moment: float) -> None:
        """Let time pass to a moment of the line, which is on the grid; see `advance`."""
        self._fleet.advance(moment if moment > self.now else self.now)

    def execute(self, line: Any, moment: float) -> None:
        """Carry out a request that has arrived at a moment; the reply goes on the line."""
        panel = self._robot.panel
        reply = self._firmware.execute(line)
        if self._robot.panel is not panel:
            # it has started again, and its banner comes at the rate of its jumpers
            self.uart.use_rate(None)
        self.uart.send(reply, moment)
        for seconds, more in self._later:
            self.uart.send_later(more, moment, seconds)
        self._later.clear()
        self._robot.heard()
        if self._next_rate is not None:
            self.uart.use_rate(self._next_rate)
            self._next_rate = None

    def watch(self, limit: int, until: float) -> Watched | None:
        """Answer a client that asks for the proximity sensors again and again; see `Watcher`."""
        return self._watch().watch(self._robot, self._fleet, self.uart, limit, until)

    def drive(self, arc: Arc) -> Driven | None:
        """Answer a client that drives an arc; see `Watcher`."""
        return self._watch().drive(self._robot, self._fleet, self.uart, arc)

    def _watch(self) -> Watcher:
        if self._watcher is None:
            self._watcher = Watcher()
        return self._watcher

    def _change_rate(self, rate: int) -> None:
        self._next_rate = rate  # the reply to the change still goes out at the rate before

    def _say_later(self, seconds: float, data: bytes) -> None:
        self._later.append((seconds, data))

    def _log_refusal(self, line: bytes, error: RequestError) -> None:
        self._refusals += 1
        if self._refusals <= _MOST_REFUSALS:
            request, why = printable(line, 60), printable(str(error), 120)
            _log.info("robot %d refuses '%s': %s", self._number + 1, request, why)
        elif self._refusals == _MOST_REFUSALS + 1:
            _log.info("robot %d refuses more than that", self._number + 1)

    def truth(self) -> Truth:
        """Return ground truth, now."""
        return self._robot.truth().model_copy(update={"time": self.now})

    def outline(self) -> Outline:
        """Return the arena from above, as it is now, to draw what happens in it."""
        things = self._fleet.world.things
        return outline(self.setup.arena, self.setup.model, [thing.footprint for thing in things])

    def mirror_image(self) -> Image:
        """Take a picture of the camera's mirror."""
        return self._seen(self._eye().mirror_image(self._view()))

    def panorama(self) -> Image:
        """Take a picture, unwrapped to a panorama."""
        return self._seen(self._eye().panorama(self._view()))

    def reset(self, reset: Reset) -> Truth:
        """Put the robot somewhere, powered on afresh, the line silent.

        With a seed the whole world is made anew, its things and all other robots back where they
        started, and the control periods are counted from now: what follows depends on the
        robots, the reset and the seed alone. Without, everything else stays as it is.

        Raises:
            EmulatorError: the pose is not free, or no free one was found; nothing has changed.
        """
        if reset.seed is None:
            pose = self._choose(reset, self._gap(self._robot.chassis), self._streams)
            self.uart.clear()
            self._robot.put_down(pose)
        else:
            self._reset_world(reset, reset.seed)
        return self.truth()

    @property
    def arrangement(self) -> tuple[tuple[float, float, float], ...]:
        """Places and headings of the things that robots can push; other ones once they moved."""
        things = self._fleet.world.things
        return tuple((each.footprint.x, each.footprint.y, each.heading) for each in things)

    def push(self, push: Push) -> Outline:
        """Put a thing somewhere else, at rest; everything else stays as it is.

        Raises:
            EmulatorError: there is no such thing, a robot holds it, or the place is not free.
        """
        self._fleet.push(push.thing, push.x, push.y)
        return self.outline()

    def switch_faults(self, switch: FaultSwitch) -> FaultsOn:
        """Switch faults of the robot and its line on and off.

        Raises:
            EmulatorError: one of them is no fault, or there are too many; nothing has changed.
        """
        faults = self.uart.faults
        new = [parse_fault(spec) for spec in switch.on]
        if len(new) + faults.count > MOST_FAULTS:
            raise EmulatorError(f"a robot has {MOST_FAULTS:,} faults at most")
        for kind in switch.off:
            faults.switch_off(kind)
        for fault in new:
            faults.switch_on(fault, self.now)
        self.uart.note_faults()
        if faults.befall_robots and self._ailments is None:
            # what it began to feel counts from the robot's time 0
            self._ailments = Ailments(faults, self.now - self._robot.time)
            self._robot.ailments = self._ailments
        return FaultsOn(kinds=faults.kinds)

    def put_anew(self, seed: int) -> None:
        """Be put at the start of a world that was made anew, all chance anew from a seed."""
        self._restart(self.start_pose, _streams(seed, self._number))

    def _restart(self, pose: Pose, streams: _Streams) -> None:
        self.uart.clear()
        self._build(pose, streams)

    def _reset_world(self, reset: Reset, seed: int) -> None:
        fleet, streams = self._fleet, _streams(seed, self._number)
        pose = self._choose(reset, fleet.gap_at_start(self), streams)
        fleet.renew()
        for member in fleet.members:
            if member is self:
                self._restart(pose, streams)
            else:
                member.put_anew(seed)
        fleet.assemble()

    def _choose(self, reset: Reset, gap: Gap, streams: _Streams) -> Pose:
        inside = self._fleet.enclosure.holds
        if reset.random:
            return random_pose(self.setup.arena.free, gap, streams.places, inside)
        pose = reset.pose or self.start_pose
        check_room(pose, gap, inside)
        return pose

    def _gap(self, own: Footprint | None = None) -> Gap:
        return self._fleet.gap(self.radius, own)

    def _find_start(self, rng: np.random.Generator) -> Pose:
        arena, gap = self.setup.arena, self._gap()
        starts = [arena.start, *arena.starts]
        if self._number >= len(starts):
            return random_pose(arena.free, gap, rng, self._fleet.enclosure.holds)
        pose = pose_of(starts[self._number])
        # the first start says what the inside is
        check_room(pose, gap, self._fleet.enclosure.holds if self._number else anywhere)
        return pose

    def _build(self, pose: Pose, streams: _Streams) -> None:
        setup, world = self.setup, self._fleet.world
        self._streams = streams
        self.uart.faults.begin(int(streams.line.integers(2**63)), self.now)
        ails = self.uart.faults.befall_robots
        self._ailments = Ailments(self.uart.faults, self.now) if ails else None
        berth = Berth(
            world,
            setup.model,
            pose,
            self._drift,
            streams.driving,
            setup.choices,
            setup.turrets,
            setup.dead_man,
            self._ailments,
            self._fleet.radio,
            self._number + 1,
        )
        self._robot: Rolling = self._kind.robot(berth)
        console = Console(self._change_rate, self._log_refusal, self._say_later)
        self._firmware = self._kind.firmware(self._robot, console)
        self._camera: OmniCamera | None = None

    def _view(self) -> Pose:
        """Return the camera's place, and where it looks ahead."""
        pose = self._robot.chassis.pose
        if self._ailments is None:
            return pose
        turned = self._ailments.heading(self._robot.time)
        return pose.model_copy(update={"heading": pose.heading + turned})

    def _seen(self, image: Image) -> Image:
        return image if self._ailments is None else self._ailments.picture(self._robot.time, image)

    def _eye(self) -> OmniCamera:
        # made when first asked for: many programs use the serial line alone
        if self._camera is None:
            self._camera = OmniCamera(
                self._fleet.world,
                self._streams.camera,
                self.setup.mirror,
                carrier=self._robot.chassis,
            )
        return self._camera


def make_fleet(setup: Setup, size: int) -> list[Emulator]:
    """Make robots of one model that share one world; see `make_robots`."""
    return make_robots([setup] * size)


def make_robots(setups: Sequence[Setup]) -> list[Emulator]:
    """Make robots that share one world; the first is as one alone with the same seed would be.

    Args:
        setups: what each is made from; each has a drift and chance of its own. Their world is that
            of the first one.

    Raises:
        EmulatorError: there is no room for so many.
    """
    radius = max(setup.model.radius for setup in setups)
    fleet = Fleet(setups[0].arena, radius, len(setups), rigid=setups[0].rigid)
    return [Emulator(setup, fleet) for setup in setups]
