"""Many Kheperas at once as a Gymnasium vector environment: worlds of their own, stepped together.

Robot by robot they do what `environment.single` does over a `khepera://` port, seed by seed and to
the last bit, but without a line's bytes, and on all cores. Gymnasium makes them by

    gymnasium.make_vec("macor_hil.environment:khepera/Commands-v0", num_envs=1024)

A robot whose episode has ended begins the next one in the next step, whose action it ignores.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.commands import COMMANDS
from macor_hil.environment.terms import (
    Observation,
    Start,
    Views,
    WheelSpeeds,
    graded,
    one_of,
    pose_of,
    shown,
)
from macor_hil.errors import MacorError
from macor_hil.hardware.driver import DriveSettings, duration_of, profiles_of
from macor_hil.mind.eyes.receptive_fields import ReceptiveFields
from macor_hil.mind.reinforcement import Reinforcement
from macor_hil.runs.trials import MAX_COMMANDS, Spread

Seen = NDArray[Any]
_Infos = dict[str, Any]
_Step = tuple[Seen, Array, Mask, Mask, _Infos]


class KheperaVectorEnv(VectorEnv[Seen, Seen, Seen]):
    """Robots with a camera, driven step by step; the base of the registered environments.

    Infos hold, for every robot, what those of `KheperaEnv` do.

    Args:
        num_envs: how many.
        port: `khepera://` URL of each robot.
        observation: see `KheperaEnv`.
        start: likewise.
        fields: likewise.
        reinforcement: likewise.
        drive: likewise.
        max_episode_steps: steps after which an episode is cut.
        workers: threads; None: as many as there are processors.
        render_mode: None; look at one robot alone to see something.

    Raises:
        MacorError: an argument is wrong, or Numba is not installed.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(
        self,
        num_envs: int = 1,
        port: str = "khepera://corridor?seed=1",
        observation: str = Observation.FIELDS,
        start: str = Start.RANDOM,
        fields: ReceptiveFields | None = None,
        reinforcement: Reinforcement | None = None,
        drive: DriveSettings | None = None,
        max_episode_steps: int = MAX_COMMANDS,
        workers: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None:
            raise MacorError("many robots at once are not drawn; make one alone to see it")
        self.num_envs = num_envs
        self.render_mode = None
        self._views = Views(observation, fields)
        self._start = one_of(Start, start)
        self._reinforcement = reinforcement or Reinforcement()
        self._drive = drive or DriveSettings()
        self._longest = max_episode_steps
        self.single_observation_space = self._views.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._robots = _robots(port, num_envs, workers)
        self._chances: list[np.random.Generator] = [
            seeding.np_random(None)[0] for _ in range(num_envs)
        ]
        self._over = np.zeros(num_envs, np.bool_)
        self._steps = np.zeros(num_envs, np.int64)
        space = self.observation_space
        self._pictures: Seen = np.zeros(space.shape or (), space.dtype)

    def reset(
        self,
        *,
        seed: int | list[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, _Infos]:
        """Begin an episode with every robot.

        Args:
            seed: of the first robot, one more for each that follows; or one for each.
            options: `pose` (x, y, heading; metres and radians) puts all robots there;
                `reset_mask`: those that begin anew, shape (N,).

        Raises:
            MacorError: there is no such option, or the pose is not free.
        """
        options = dict(options or {})
        mask = np.array(options.pop("reset_mask", np.ones(self.num_envs, np.bool_)), np.bool_)
        pose = pose_of(options)
        seeds = _seeds(seed, self.num_envs)
        for number in np.flatnonzero(mask).tolist():
            if seeds[number] is not None:
                self._chances[number] = seeding.np_random(seeds[number])[0]
            self._put(number, pose)
        self._begin(mask)
        return self._seen(mask), self._infos()

    def step(self, actions: Any) -> _Step:
        """Drive one action of every robot; begin anew where the step before ended an episode.

        Raises:
            InvalidAction: an action is not in the action space; no robot moves.
        """
        going = ~self._over
        rewards = self._act(actions, going)
        for number in np.flatnonzero(self._over).tolist():
            self._put(number, None)
        self._begin(self._over)
        self._steps[going] += 1
        terminated: Mask = self._robots.tally.collided & going
        truncated: Mask = (self._steps >= self._longest) & going
        self._over = terminated | truncated
        seen = self._seen(np.ones(self.num_envs, np.bool_))
        return seen, rewards, terminated, truncated, self._infos()

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        self._robots.close()

    def _act(self, actions: Any, going: Mask) -> Array:
        """Drive the actions of some robots; return what each earns, 0 for the others."""
        raise NotImplementedError

    def _put(self, number: int, pose: Any) -> None:
        """Put a robot down as a reset of `KheperaEnv` does."""
        rng = self._chances[number]
        chance = int(rng.integers(2**31))
        anywhere = self._start is Start.RANDOM
        start = self._robots.put(number, chance, pose, anywhere=anywhere)
        if pose is None and not anywhere:
            self._robots.move(number, Spread().draw(start, rng))

    def _begin(self, mask: Mask) -> None:
        if mask.any():
            self._robots.begin(mask)
            self._steps[mask] = 0
            self._robots.tally.collided[mask] = False
            self._over = self._over & ~mask

    def _seen(self, of: Mask) -> Seen:
        """Return what all see, after a look of some of them."""
        if not self._views.pictures:
            near: Seen = self._robots.proximity.astype(np.float32)
            return near
        seen = self._pictures

        def see(number: int, image: NDArray[np.uint8]) -> None:
            seen[number] = self._views.of(image)

        self._robots.look(of, see)
        return seen.copy()

    def _infos(self) -> _Infos:
        robots, everyone = self._robots, np.ones(self.num_envs, np.bool_)
        infos = {
            "proximity": robots.proximity,
            "counters": robots.tally.counters.copy(),
            "time": robots.times,
            "pose": robots.poses,
        }
        return infos | {f"_{name}": everyone for name in infos}


class CommandsVectorEnv(KheperaVectorEnv):
    """Actions are the paper's commands: 0 left, 1 right, 2 straight on; 21 mm each."""

    def __init__(self, num_envs: int = 1, **settings: Any) -> None:
        super().__init__(num_envs, **settings)
        self.single_action_space = spaces.Discrete(len(COMMANDS))
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._arcs = _arcs(self._drive)
        self._worth = np.array(
            [[graded(self._reinforcement, c, hit) for hit in (False, True)] for c in COMMANDS]
        )

    def _act(self, actions: Any, going: Mask) -> Array:
        which: Indices = np.asarray(actions)
        if not self.action_space.contains(which):
            raise InvalidAction(
                f"the actions {shown(actions)} are not {self.num_envs} of 0 (left), 1 (right) and"
                " 2 (straight on)"
            )
        drive = self._drive
        self._robots.drive_arcs(going, self._arcs, which, drive.collision, drive.patience)
        hit = self._robots.tally.collided.astype(np.int64)
        return np.where(going, self._worth[which, hit], 0.0)


class WheelsVectorEnv(KheperaVectorEnv):
    """Actions are wheel speeds, left and right, in m/s; see `WheelsEnv`."""

    def __init__(self, num_envs: int = 1, **settings: Any) -> None:
        super().__init__(num_envs, **settings)
        self._wheels = WheelSpeeds(self._drive)
        self.single_action_space = self._wheels.space
        self.action_space = batch_space(self.single_action_space, num_envs)

    def _act(self, actions: Any, going: Mask) -> Array:
        speeds: Indices = self._wheels.all_counts(actions, self.num_envs)
        self._robots.hold_speeds(going, speeds, self._drive.collision, self._wheels.period)
        worth = self._wheels.worth(speeds, self._reinforcement)
        worth[self._robots.tally.collided] = self._reinforcement.collision
        return np.where(going, worth, 0.0)


def _seeds(seed: int | list[int | None] | None, count: int) -> list[int | None]:
    if seed is None:
        return [None] * count
    if isinstance(seed, int):
        return [seed + number for number in range(count)]
    if len(seed) != count:
        raise MacorError(f"there are {len(seed)} seeds for {count} robots")
    return seed


def _robots(port: str, count: int, workers: int | None) -> Any:
    """Make the robots of a port's URL."""
    from khepera_protocol.options import OptionError

    from khepera_emulator.errors import EmulatorError
    from khepera_emulator.robot.many import Many
    from khepera_emulator.robot.options import UrlOptions

    try:
        options = UrlOptions.from_url(port)
        if options.robots > 1:
            raise EmulatorError("many robots at once are each alone; leave out 'robots'")
        return Many(options.setup(()), count, workers)
    except (EmulatorError, OptionError) as error:
        raise MacorError(f"{port}: {error}") from None


def _arcs(drive: DriveSettings) -> Any:
    from khepera_emulator.robot.compiled.layout import Arcs

    ways = [drive.wheels.counts(command.way, command.turn) for command in COMMANDS]
    return Arcs(
        np.array([[round(left), round(right)] for left, right in ways], np.int64),
        np.array([profiles_of(drive, way) for way in ways], np.int64),
        np.array([duration_of(drive, max(*map(abs, way), 1.0)) for way in ways]),
    )
