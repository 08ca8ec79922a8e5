"""All planners, by their names on the command line."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from macor_hil.planners.anticipative import Anticipative
from macor_hil.planners.expected import Expected
from macor_hil.planners.graded import Graded
from macor_hil.planners.planner import Planner
from macor_hil.planners.reactive import Reactive

PLANNERS: Final[Mapping[str, Callable[[], Planner]]] = MappingProxyType(
    {"anticipative": Anticipative, "reactive": Reactive, "expected": Expected, "graded": Graded}
)
"""Planners by their names on the command line."""
