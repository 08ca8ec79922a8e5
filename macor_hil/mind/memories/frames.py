"""The last frames of drives, in few bytes: where the floor ends, and the command that led there."""

from collections import deque
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from macor_hil.arrays import Array, Indices, Mask, State
from macor_hil.commands import COMMANDS
from macor_hil.mind.experience import Experience
from macor_hil.mind.stored import MOST_EARNED, numbers, whole

_PUT_DOWN: Final = -1
"""Stands for the command of a frame that a drive begins with."""

_NEAREST: Final = 8.0


class _Frame(NamedTuple):
    """A profile, in half precision, and what led to it."""

    profile: NDArray[np.float16]
    command: int = _PUT_DOWN
    collided: bool = False
    earned: float = 0.0


class Frames:
    """Frames of drives that eyes saw which tell where the floor ends.

    Args:
        directions: of profiles; 0: the eyes do not tell, and nothing is kept.
        most: how many of the last ones are kept.
    """

    def __init__(self, directions: int, most: int) -> None:
        self._directions = directions
        self._frames: deque[_Frame] = deque(maxlen=most)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._frames)

    def copy(self) -> "Frames":
        """Return the frames that there are now; only those are copied that are no longer kept."""
        now = Frames(self._directions, self._frames.maxlen or 0)
        now._frames.extend(self._frames)
        return now

    def add(self, experience: Experience) -> int:
        """Keep an experience; its beginning, too, unless it is the end of the one before.

        Returns:
            How many frames it was: 0 where the eyes do not tell.
        """
        before, after = experience.before.floor, experience.after.floor
        if not self._directions or before is None or after is None:
            return 0
        start = _Frame(before.astype(np.float16))
        begins = not self._frames or bool((self._frames[-1].profile != start.profile).any())
        if begins:
            self._frames.append(start)
        earned = experience.reinforcement
        led = experience.command, experience.collided, earned
        self._frames.append(_Frame(after.astype(np.float16), *led))
        return 2 if begins else 1

    @property
    def profiles(self) -> Array:
        """Inverse distances of the floor's end, shape (T, directions)."""
        profiles = np.array([f.profile for f in self._frames], np.float64)
        return profiles.reshape(len(profiles), self._directions)

    @property
    def commands(self) -> Indices:
        """Index of the command that led to each frame, negative where none did, shape (T,)."""
        return np.array([f.command for f in self._frames], np.int64)

    @property
    def collided(self) -> Mask:
        """True where it ended in a collision, shape (T,)."""
        return np.array([f.collided for f in self._frames], np.bool_)

    @property
    def earned(self) -> Array:
        """Reinforcement of it, shape (T,)."""
        return np.array([f.earned for f in self._frames], np.float64)

    def state(self) -> State:
        """Return them as arrays."""
        return {
            "profiles": self.profiles.astype(np.float16),
            "commands": self.commands.astype(np.int8),
            "collided": self.collided.astype(np.int8),
            "earned": self.earned,
        }

    def load(self, state: State) -> None:
        """Take over stored ones.

        Raises:
            ValueError, KeyError: something is missing, does not fit, or cannot have been seen.
        """
        profiles = numbers(state, "profiles", (None, self._directions), 0.0, _NEAREST)
        commands = whole(state, "commands", _PUT_DOWN, len(COMMANDS) - 1)
        collided = whole(state, "collided", 0, 1)
        earned = numbers(state, "earned", (None,), -MOST_EARNED, MOST_EARNED)
        if not len(profiles) == len(commands) == len(collided) == len(earned):
            raise ValueError("it has not as many profiles as commands")
        if len(profiles) and profiles.min() <= 0.0:
            raise ValueError("a profile ends nowhere")
        rows = zip(profiles, commands.tolist(), collided.tolist(), earned.tolist(), strict=True)
        self._frames.clear()
        self._frames.extend(_Frame(p.astype(np.float16), c, bool(h), r) for p, c, h, r in rows)
