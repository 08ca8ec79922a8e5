"""A robot on two wheels in a world, and its time: what all kinds of robots have in common.

Time advances in control periods of 10 ms. A kind says what its motors want in a period, and takes
in what its wheels have really turned.
"""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from khepera_protocol.serial.units import CONTROL_PERIOD
from khepera_protocol.zenoh.payloads import Pose, Truth, WheelDrift

from khepera_emulator.body.chassis import Chassis
from khepera_emulator.body.drift import slip_sequence
from khepera_emulator.models import Model
from khepera_emulator.robot.ailments import Ailments
from khepera_emulator.world.world import World

Pair = tuple[float, float]
"""A value for the left and for the right wheel."""

_SPOT_SLIP = 2.0
"""Slip of a robot that turns on the spot, over that of one that drives (a choice)."""


class Rolling(ABC):
    """A robot of any kind.

    Args:
        world: where it is.
        model: which robot.
        pose: where it is put down.
        drift: what its counters do not see.
        slip: source of the wheels' slip.
        dead_man: seconds without a request after which it stops by itself; None: never.
        ailments: faults of its own; None: there are none.

    Attributes:
        chassis: its body.
        ailments: faults of its own; None: there are none.
        touched: whether it has touched anything since it was put down.
        ticks: control periods since it was made.
        dead_man: control periods without a request after which it stops by itself; None: never.
        heard_at: control period of the last request.
        slips: of both wheels in each period, before their spread.
        panel: state that a client can set beside the motors; made anew with every power-on.
    """

    panel: Any

    def __init__(
        self,
        world: World,
        model: Model,
        pose: Pose,
        drift: WheelDrift,
        slip: np.random.Generator,
        dead_man: float | None = None,
        ailments: Ailments | None = None,
    ) -> None:
        self.ailments = ailments
        self.dead_man = None if dead_man is None else round(dead_man / CONTROL_PERIOD)
        self.heard_at = 0
        self.drift = drift
        self.slips = slip_sequence(slip)
        self._slip_sd, self._spot_slip_sd = drift.slip, drift.slip * _SPOT_SLIP
        self.chassis = Chassis(world, model, drift, pose)
        self.touched = False
        self.ticks = 0

    @property
    @abstractmethod
    def moving(self) -> bool:
        """True if a wheel turns or is driven."""

    @abstractmethod
    def power_on(self) -> None:
        """Set everything that power-on or a reset sets; the body stays put."""

    @abstractmethod
    def rest(self, ticks: int) -> None:
        """Let control periods pass in which nothing moves; see `run`."""

    @abstractmethod
    def arrive(self, ways: Pair) -> None:
        """End a control period in which the wheels have turned so many metres."""

    @abstractmethod
    def _intend(self) -> tuple[Pair, Pair]:
        """Return ways in metres that the motors give the wheels in this period, and their slips."""

    @property
    def time(self) -> float:
        """Seconds of simulated time since the robot was made."""
        return self.ticks * CONTROL_PERIOD

    def heard(self) -> None:
        """Notice a request: whoever sends them is alive."""
        self.heard_at = self.ticks

    def put_down(self, pose: Pose) -> None:
        """Move the robot somewhere else and power it on afresh."""
        self.chassis.place(pose)
        self.touched = False
        self.heard_at = self.ticks
        self.power_on()

    def run(self, ticks: int) -> None:
        """Let control periods pass up to the given number since the robot was made.

        For a robot in a world where nothing else moves; see `periods` for others.
        """
        roll = self.chassis.roll
        while self.ticks < ticks:
            if not self.moving:
                self.rest(ticks)
                return
            self.arrive(roll(*self._intend()))

    def aim(self) -> None:
        """Begin a control period with what the motors want."""
        self.chassis.aim(*self._intend())

    def tick(self) -> None:
        """Let one control period pass."""
        self.run(self.ticks + 1)

    def truth(self) -> Truth:
        """Return ground truth, for scoring."""
        return Truth(
            time=self.time,
            pose=self.chassis.pose,
            speed=self.chassis.ground_speed,
            contact=self.chassis.contact,
            touched=self.touched,
            drift=self.drift,
            faults=() if self.ailments is None else self.ailments.names(self.time),
        )

    def _is_forgotten(self) -> bool:
        """Tell whether nobody has sent a request for so long that the robot stops by itself."""
        return self.dead_man is not None and self.ticks - self.heard_at >= self.dead_man

    def _draw_slip(self, on_the_spot: bool) -> Pair:
        """Draw the relative errors of the wheels' ways over ground in a period."""
        sd = self._spot_slip_sd if on_the_spot else self._slip_sd
        left, right = next(self.slips)
        slip = sd * left, sd * right
        return slip if self.ailments is None else self.ailments.slip(self.time, slip)
