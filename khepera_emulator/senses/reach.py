"""The reach of a robot's sensors towards what it is about to touch."""

from typing import NamedTuple

from khepera_emulator.world.rays import Array


class Reach(NamedTuple):
    """Rays of the front and side sensors, as long as a reading holds that counts as a collision.

    Attributes:
        feet: where R rays begin, in metres ahead and to the left of the robot's middle; (R, 2).
        rays: ahead and left parts of their directions; (R, 2).
        lengths: metres to a solid of each of S shades, less than 0 where none is felt; (S, R).
    """

    feet: Array
    rays: Array
    lengths: Array
