"""A training drive without being put down anywhere, as a physical robot drives it.

The recorded drives of other experiments are samples: the emulator puts the robot down at a random
place after every collision. Here the robot drives back after one, and its frames are a path.
"""

from dataclasses import dataclass, replace

from macor_hil.experiments.drives.training_drive import Drive
from macor_hil.runs.training import Recovery, Schedule


@dataclass(frozen=True)
class PathDrive(Drive):
    """A drive of random commands that is a single path."""

    recovery: Recovery = Recovery.BACK
    """Going on after a collision: by driving back."""

    def schedule(self, seed: int) -> Schedule:
        """Return the commands of a seed, in one session: each session puts the robot down."""
        plan = super().schedule(seed)
        return replace(plan, recovery=self.recovery, session=max(1, self.random))

    @property
    def beginning(self) -> None:
        """No other drive begins with this path."""
