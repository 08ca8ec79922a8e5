"""Figure 4: as figure 3, but with 1,000 steps of sensory training for both (section 3.1).

"For these investigations, both systems were allowed 1000 steps for sensory pretraining. For the
NG, the parameters learning radius and learning rate were again determined using a breadth search.
All other experimental configuration is the same as before."
"""

from dataclasses import replace
from typing import Final

from macor_hil.experiments.paper.avoidance import figure4_claim
from macor_hil.experiments.paper.figure3 import (
    QUICK,
    Settings,
    both_behaviours,
    differences,
    first_sentence,
    make,
    side_by_side,
)
from macor_hil.experiments.report.elements import Element, Text
from macor_hil.experiments.results.store import Results

_CLAIM: Final = (
    "The paper: after 1,000 steps only Fuzzy ART realizes a collision avoidance; the Neural Gas"
    " cannot generate an appropriate representation."
)


def tell(settings: Settings, results: Results) -> list[Element]:
    """Report steps and behaviour side by side, with the paper's claim."""
    claim = figure4_claim(*both_behaviours(settings, results))
    return [
        Text(first_sentence("figure 4", claim, settings, results)),
        *side_by_side(settings, results, {}),
        Text(_CLAIM),
        Text(differences(settings)),
    ]


FIGURE4 = make(
    "figure4",
    "Figure 4: reactive navigation after 1,000 steps of sensory training",
    Settings(art_inputs=1_000, gas_inputs=1_000, gas_presentations=1, searched=1),
    tell,
    replace(QUICK, art_inputs=200, gas_inputs=200, gas_presentations=1, searched=1),
)
