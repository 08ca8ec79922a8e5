"""Parts of this project pass the checks that authors run on theirs; broken ones do not."""

from typing import Any

import numpy as np
import pytest

from macor_hil.checks import CheckError, check_clusterer, check_eyes, check_memory, check_planner
from macor_hil.errors import MacorError
from macor_hil.mind.catalogue import CLUSTERERS, EYES, MEMORIES, PLANNERS
from macor_hil.mind.clusterers.fuzzy_art import FuzzyArt
from macor_hil.mind.eyes.panorama import PanoramaEyes
from macor_hil.mind.memories.transitions import SensorimotorMap
from macor_hil.mind.planners.planner import Plan
from macor_hil.mind.planners.reactive import Reactive


@pytest.mark.parametrize("name", PLANNERS.builtin)
def test_planners_pass(name: str) -> None:
    check_planner(PLANNERS.find(name))


@pytest.mark.parametrize("name", MEMORIES.builtin)
def test_memories_pass(name: str) -> None:
    check_memory(MEMORIES.find(name))


@pytest.mark.parametrize("name", CLUSTERERS.builtin)
def test_clusterers_pass(name: str) -> None:
    check_clusterer(CLUSTERERS.find(name))


@pytest.mark.parametrize("name", EYES.builtin)
def test_eyes_pass(name: str) -> None:
    check_eyes(EYES.find(name))


class NoMemory:
    def plan(self, _memory: Any, _now: Any) -> Plan:
        return Plan((None, None, None), None)


class Endless(Reactive):
    def plan(self, _memory: Any, _now: Any) -> Plan:
        return Plan((float("inf"), 0.0, 0.0), 0)


class Fickle(Reactive):
    turn = 0.0

    def plan(self, _memory: Any, _now: Any) -> Plan:
        self.turn += 1.0
        return Plan((self.turn, 0.0, 0.0), 0)


class Changing(Reactive):
    def plan(self, _memory: Any, _now: Any) -> Plan:
        _memory.adapt(0, 1, 0.5)
        return Plan((0.0, 0.0, 0.0), 0)


@pytest.mark.parametrize(
    ("planner", "says"),
    [
        (NoMemory, "no attribute `memory`"),
        (Endless, "not finite"),
        (Fickle, "two different plans"),
        (Changing, "planning changes the memory"),
    ],
)
def test_broken_planners_do_not_pass(planner: Any, says: str) -> None:
    with pytest.raises(CheckError, match=says):
        check_planner(planner)


class Forgetful(SensorimotorMap):
    def load(self, state: Any) -> None:
        super().load({**state, "w_r": np.zeros_like(state["w_r"])})


class Restless(FuzzyArt):
    def present(self, x: Any, learn: bool = True) -> Any:  # noqa: ARG002
        return super().present(x, learn=True)


class Staring(PanoramaEyes):
    def mirrored(self, x: Any) -> Any:
        return np.zeros_like(x)


def test_other_broken_parts_do_not_pass() -> None:
    with pytest.raises(CheckError, match="does not come back"):
        check_memory(Forgetful)
    with pytest.raises(CheckError, match="learns although it is told not to"):
        check_clusterer(Restless, vigilance=0.5)
    with pytest.raises(CheckError, match="mirror image"):
        check_eyes(Staring)


class Unexplained(Reactive):
    def __init__(self, haste) -> None:  # type: ignore[no-untyped-def]  # noqa: ARG002
        super().__init__()


def test_a_setting_needs_a_type_and_a_default() -> None:
    with pytest.raises(MacorError, match="haste of Unexplained needs an annotation"):
        check_planner(Unexplained)
