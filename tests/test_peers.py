"""Fuzzy ART against another implementation, where the paper's cap does not act."""

import numpy as np
import pytest

from macor_hil.experiments.drives.training_drive import Drive, record
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.settings import MindSettings

artlib = pytest.importorskip("artlib", reason="the extra 'peers' is not installed")


@pytest.fixture(scope="module")
def inputs() -> np.ndarray:
    """Return what the robot saw in 150 random commands."""
    return record(Drive(tuning=20, random=150, reactive=0, brain=MindSettings(nodes=8)), 1).inputs


@pytest.mark.parametrize("vigilance", [0.7, 0.8, 0.9])
def test_the_same_winners_and_the_same_weights(inputs: np.ndarray, vigilance: float) -> None:
    mine = FuzzyArt(inputs.shape[1], len(inputs), vigilance, alpha=0.001)
    nodes = [mine.present(x).node for x in inputs]
    peer = artlib.FuzzyART(rho=vigilance, alpha=0.001, beta=1.0)
    peer.set_data_bounds(np.zeros(inputs.shape[1]), np.ones(inputs.shape[1]))
    peer.partial_fit(peer.prepare_data(inputs))
    assert nodes == peer.labels_.tolist()
    assert mine.size == len(peer.W)
    np.testing.assert_allclose(mine.weights, np.array(peer.W), atol=1e-12)
