"""The chance of a collision by clearance, learned from foreseen clearances of driven commands."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from macor_hil.arrays import Array, Indices, Mask
from macor_hil.mind.foresight.floor import clearance, solids
from macor_hil.mind.foresight.motions import moved

LEAST: Final = 10
"""Collisions that are needed, and commands without one."""

_AHEAD: Final = 8
"""Commands ahead for which clearances are foreseen."""

_ROUNDS: Final = 50
_PRIOR: Final = 1e-4
"""Of the curve's steepness, so that it stays finite where clearances tell collisions perfectly."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Chance to get through by clearance, a logistic curve that grows vague with foresight.

    Attributes:
        reach: clearance at which every second command ends in a collision.
        vague: spread of that for the next command.
        grows: and its growth with every command in between.
    """

    reach: float
    vague: float
    grows: float

    def survival(self, clearances: Array, ahead: float) -> Array:
        """Return the chance to get through at clearances, so many commands ahead (0: the next)."""
        z = (clearances - self.reach) / (self.vague + self.grows * ahead)
        chance: Array = 1.0 / (1.0 + np.exp(-np.clip(z, -30.0, 30.0)))
        return chance


def learned_curve(
    profiles: Array, commands: Indices, collided: Mask, motions: Array
) -> Curve | None:
    """Return the curve that explains the collisions of a drive; None: there are too few.

    Args:
        profiles: of every frame, shape (T, directions).
        commands: index of the command that led to each frame, negative where none did, shape (T,).
        collided: whether it ended in a collision, shape (T,).
        motions: of the commands, shape (m, 3).
    """
    ahead, foreseen, hit = _foreseen(profiles, commands, collided, motions)
    fits: list[tuple[int, float, float, int]] = []
    for k in range(_AHEAD):
        here = ahead == k
        fit = _logistic(foreseen[here], hit[here])
        if fit is not None:
            fits.append((k, *fit, int(hit[here].sum())))
    if not fits or fits[0][0] != 0:
        return None
    _, reach, vague, _ = fits[0]
    between, _, spread, hits = np.array(fits).T
    weight = hits * between
    grows = float((weight * (spread - vague)).sum() / max((weight * between).sum(), 1.0))
    return Curve(reach, vague, max(0.0, grows))


def _foreseen(
    profiles: Array, commands: Indices, collided: Mask, motions: Array
) -> tuple[Indices, Array, Mask]:
    """Foresee the clearances of driven commands, from up to eight commands before.

    Returns:
        How many commands were in between, the clearance, and whether the command collided.
    """
    frames = len(commands)
    pose, driven = np.zeros((frames, 3)), np.ones(frames, dtype=np.bool_)
    poses, possible = [], []
    for k in range(1, _AHEAD + 1):
        later = np.minimum(np.arange(frames) + k, frames - 1)
        driven = driven & (np.arange(frames) + k < frames) & (commands[later] >= 0)
        pose = moved(pose, motions[np.maximum(commands[later], 0)])
        poses.append(pose)
        possible.append(driven)
    places, known = np.stack(poses, axis=1)[..., :2], np.stack(possible, axis=1)
    foreseen = np.full(known.shape, np.nan)
    for frame in np.flatnonzero(known[:, 0]).tolist():
        here = known[frame]
        foreseen[frame, here] = clearance(solids(profiles[frame]), places[frame, here])
    known &= np.isfinite(foreseen)
    frame_of, between = np.nonzero(known)
    return between, foreseen[known], collided[frame_of + 1 + between]


def _logistic(clearances: Array, hit: Mask) -> tuple[float, float] | None:
    """Return clearance of even chances and spread of a logistic curve, by Newton's method."""
    if min(hit.sum(), (~hit).sum()) < LEAST:
        return None
    x = np.stack([clearances, np.ones_like(clearances)], axis=1)
    sign, prior = np.where(hit, -1.0, 1.0), np.array([_PRIOR, 0.0])
    w = np.array([10.0, -10.0 * np.median(clearances[hit])])

    def likelihood(w: Array) -> float:
        return float(-np.logaddexp(0.0, -sign * (x @ w)).sum() - 0.5 * (prior * w * w).sum())

    now = likelihood(w)
    for _ in range(_ROUNDS):
        p = 1.0 / (1.0 + np.exp(-np.clip(x @ w, -30.0, 30.0)))
        slope = x.T @ (~hit - p) - prior * w
        bend = (x * (p * (1 - p))[:, None]).T @ x + np.diag(prior) + 1e-6 * np.eye(2)
        step = np.linalg.solve(bend, slope)
        while likelihood(w + step) < now and np.abs(step).max() > 1e-6:
            step = step / 2
        w, before, now = w + step, now, likelihood(w + step)
        if now - before < 1e-6:
            break
    return (float(-w[1] / w[0]), float(1 / w[0])) if w[0] > 0.0 else None
