"""Layout of a robot, its model and its arena as records of numbers, for compiled functions.

Names and units are those of the classes that hold the same numbers: `body.motors.Wheel`,
`body.chassis.Chassis`, `body.contact.Contact`, `robot.robot.Robot` and `line.uart.Uart`.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from khepera_emulator.world.rays import Array

Records = NDArray[np.void]
"""Rows of a layout below."""

_REAL, _WHOLE = np.float64, np.int64

LEFT: Any = np.int64(0)
"""A wheel; a function that is given a plain number is compiled for that number alone."""

RIGHT: Any = np.int64(1)
"""The other one."""

SPEED, POSITION, DUTY = 0, 1, 2
"""Controllers that drive a wheel, as `body.motors.Mode`."""

MORE, SEEN, TOLD = 0, 1, 2
"""Ends of a watch: more numbers must be drawn; after a reply of the sensors, of the controllers."""

ROBOT: Final = np.dtype(
    [
        # both wheels, the left one first
        ("mode", _WHOLE, (2,)),
        ("set_speed", _WHOLE, (2,)),
        ("target", _WHOLE, (2,)),
        ("set_duty", _WHOLE, (2,)),
        ("travel", _REAL, (2,)),
        ("speed", _REAL, (2,)),
        ("measured", _WHOLE, (2,)),
        ("offset", _WHOLE, (2,)),
        ("reached", _WHOLE, (2,)),
        ("reference", _REAL, (2,)),
        ("reference_speed", _REAL, (2,)),
        ("integral", _REAL, (2,)),
        ("last_error", _REAL, (2,)),
        ("speed_gains", _WHOLE, (2, 3)),
        ("position_gains", _WHOLE, (2, 3)),
        ("profile", _WHOLE, (2, 2)),
        ("reached_within", _WHOLE),
        # the body
        ("x", _REAL),
        ("y", _REAL),
        ("heading", _REAL),
        ("ground_speed", _REAL, (2,)),
        ("contact", _WHOLE),
        ("touched", _WHOLE),
        ("free_way", _REAL),
        ("scale", _REAL, (2,)),
        ("wheel_base", _REAL),
        ("slip", _REAL),
        # what it pushes
        ("sliding", _WHOLE),
        ("motion", _REAL, (3,)),
        ("tyres", _REAL, (4,)),
        ("walls", _WHOLE),
        ("pressing", _WHOLE),
        ("slipping", _WHOLE),
        # constants of the pushing body, which depend on its wheel base
        ("arm", _REAL),
        ("turns_arm", _REAL),
        ("turns_radius", _REAL),
        ("stiff", _REAL),
        ("rub", _REAL),
        ("lean", _REAL),
        # time, and the latest scan of the sensors
        ("ticks", _WHOLE),
        ("heard", _WHOLE),
        ("scan", _REAL, (3,)),
        ("scanned", _WHOLE),
        ("counts", _WHOLE, (8,)),
        # what the motion controllers have last told
        ("told_reached", _WHOLE, (2,)),
        ("told_error", _WHOLE, (2,)),
        # how much of what was drawn has been used
        ("slips", _WHOLE),
        ("noises", _WHOLE),
        # the line
        ("now", _REAL),
        ("power_time", _REAL),
        ("receiver_free", _REAL),
        ("interpreter_free", _REAL),
        ("sender_free", _REAL),
    ]
)

MODEL: Final = np.dtype(
    [
        ("radius", _REAL),
        ("mass", _REAL),
        ("light", _REAL),
        ("hold", _REAL),
        ("tolerance", _REAL),
        ("friction", _REAL),
        ("top_speed", _REAL),
        ("gain_scale", _REAL),
        ("response", _REAL),
        ("reach", _REAL),
        ("sight", _REAL),
        ("top", _WHOLE),
        ("step", _WHOLE),
        ("fixed", _REAL),
        ("relative", _REAL),
        ("silent", _WHOLE),
        ("residual", _REAL, (8,)),
        ("foot", _REAL, (8, 2)),
        ("rays", _REAL, (8, 5, 3)),
    ]
)

SOLID: Final = np.dtype(
    [
        ("round", _WHOLE),
        ("x", _REAL),
        ("y", _REAL),
        ("ux", _REAL),
        ("uy", _REAL),
        ("half_length", _REAL),
        ("half_thickness", _REAL),
        ("radius", _REAL),
        ("grey", _REAL),
    ]
)

LINE: Final = np.dtype([("each", _REAL), ("busy", _REAL), ("writing", _REAL)])
"""Seconds of a byte on the wire, of the interpreter, and of a client's write."""


class Stage(NamedTuple):
    """Everything about a robot's world that stays the same.

    Attributes:
        model: one `MODEL`.
        curves: counts of each sensor at multiples of a millimetre, shape (8, M).
        solids: of the arena, `SOLID`, in the order of its floor plan.
    """

    model: Records
    curves: Array
    solids: Records


class Tally(NamedTuple):
    """Record of N robots that are driven step by step.

    Attributes:
        active: which of them take part, shape (N,).
        collided: whether the last step ended in a collision, shape (N,).
        counters: encoder counters of both wheels after it, shape (N, 2).
        targets: counters that the next step is reckoned from, shape (N, 2).
        began: times from which episodes count, shape (N,).
    """

    active: NDArray[np.bool_]
    collided: NDArray[np.bool_]
    counters: NDArray[np.int64]
    targets: NDArray[np.int64]
    began: Array


class Arcs(NamedTuple):
    """Arcs that can be driven.

    Attributes:
        ways: counts of both wheels, shape (m, 2).
        profiles: top speed and acceleration of each wheel, shape (m, 2, 2).
        durations: seconds that each takes, shape (m,).
    """

    ways: NDArray[np.int64]
    profiles: NDArray[np.int64]
    durations: Array
