"""Fuzzy ART with 36 features and 50 nodes: the processor time of a presentation.

Against the one NumPy pass over all nodes that it cannot avoid, and against artlib, which is
optional (the extra `peers`); without it there is no such row.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from importlib.util import find_spec
from time import process_time
from typing import Any

import numpy as np
from figures import Figure
from numpy.typing import NDArray

from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt

_FEATURES, _NODES, _VIGILANCE, _ALPHA = 36, 50, 0.9, 0.001
_PRESENTATIONS = 2000
_PEER_PRESENTATIONS = 200


class Presentations:
    """Inputs around fifty places, one at a time."""

    def __init__(self, _: ExitStack) -> None:
        rng = np.random.default_rng(0)
        self._art = FuzzyArt(_FEATURES, _NODES, _VIGILANCE, _ALPHA)
        self._peer = _peer() if find_spec("artlib") else None
        seeds = rng.uniform(size=(_NODES, _FEATURES))
        for seed in seeds:
            self._art.present(seed)
            self._show_peer(seed)
        near = seeds[rng.integers(_NODES, size=_PRESENTATIONS)]
        self._inputs = np.clip(near + rng.normal(0.0, 0.02, near.shape), 0.0, 1.0)

    def round(self) -> dict[str, float]:
        """Present all inputs, with and without learning; then the bare pass, then to the peer."""
        coded = np.concatenate([self._inputs, 1.0 - self._inputs], axis=1)
        found = {
            "learning": _each(self._inputs, self._art.present),
            "looking": _each(self._inputs, partial(self._art.present, learn=False)),
            "pass": _each(coded, lambda row: np.minimum(row, self._art.weights).sum(axis=1)),
        }
        if self._peer is not None:
            found["peer"] = _each(self._inputs[:_PEER_PRESENTATIONS], self._show_peer)
        return found

    def figures(self, medians: Mapping[str, float]) -> list[Figure]:
        """Time of a presentation."""
        rows = [
            _row(name, medians[name], "bare NumPy pass over all nodes", medians["pass"])
            for name in ("learning", "looking")
        ]
        if "peer" in medians:
            rows.append(_row("learning", medians["learning"], "artlib", medians["peer"]))
        return rows

    def _show_peer(self, x: NDArray[np.float64]) -> None:
        if self._peer is not None:
            # complement coding is part of a presentation on both sides
            self._peer.partial_fit(self._peer.prepare_data(x[None]))


def _peer() -> Any:
    import artlib

    peer = artlib.FuzzyART(rho=_VIGILANCE, alpha=_ALPHA, beta=1.0)
    peer.set_data_bounds(np.zeros(_FEATURES), np.ones(_FEATURES))
    return peer


def _row(name: str, own: float, against: str, other: float) -> Figure:
    return Figure(
        f"Fuzzy ART, a presentation, {name}",
        f"{1e6 * own:.1f} us",
        f"{against} {1e6 * other:.1f} us",
        f"{own / other:.2f}",
    )


def _each(rows: NDArray[np.float64], do: Callable[[NDArray[np.float64]], object]) -> float:
    """Seconds that a function takes for each row."""
    start = process_time()
    for row in rows:
        do(row)
    return (process_time() - start) / len(rows)
