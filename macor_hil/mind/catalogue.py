"""Planners, memories, clusterers and eyes by name, and brains built from them."""

from collections.abc import Collection
from typing import Any, Final

from macor_hil.commands import COMMANDS
from macor_hil.errors import MacorError
from macor_hil.mind.brain import Brain
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.settings import MindSettings, Part, make_part
from protocol.registry import Registry, RegistryError
from protocol.text import printable

_HERE: Final = "macor_hil.mind"

PLANNERS: Final = Registry(
    "planner",
    "khepera_macor.planners",
    {
        "anticipative": f"{_HERE}.planners.anticipative:Anticipative",
        "reactive": f"{_HERE}.planners.reactive:Reactive",
        "q-learning": f"{_HERE}.planners.q_learning:QLearning",
        "weak-q-learning": f"{_HERE}.planners.q_learning:WeakQLearning",
        "expected": f"{_HERE}.planners.expected:Expected",
        "graded": f"{_HERE}.planners.graded:Graded",
    },
)
MEMORIES: Final = Registry(
    "memory",
    "khepera_macor.memories",
    {
        "transitions": f"{_HERE}.memories.transitions:SensorimotorMap",
        "q-learning": f"{_HERE}.memories.q_map:QMap",
        "graded": f"{_HERE}.memories.graded:GradedMemory",
    },
)
CLUSTERERS: Final = Registry(
    "clusterer",
    "khepera_macor.clusterers",
    {
        "fuzzy-art": f"{_HERE}.clusterers.fuzzy_art:FuzzyArt",
        "neural-gas": f"{_HERE}.clusterers.neural_gas:NeuralGas",
    },
)
EYES: Final = Registry(
    "kind of eyes",
    "khepera_macor.eyes",
    {"receptive-fields": f"{_HERE}.eyes.panorama:PanoramaEyes"},
)


def build_brain(
    settings: MindSettings | None = None, allowed: Collection[str] | None = None
) -> Brain:
    """Build a new brain, which knows nothing.

    Args:
        settings: which parts it has, each with its own settings; None: the defaults.
        allowed: parts named by a file or module that may be used, where settings come from
            elsewhere; None: all.

    Raises:
        MacorError: a part is not there, or one of its settings is wrong.
    """
    settings = settings or MindSettings()
    given: dict[str, Any] = {
        "mirror": settings.mirror,
        "nodes": settings.nodes,
        "commands": len(COMMANDS),
    }
    for part in (settings.eyes, settings.clusterer, *settings.memories.values()):
        if allowed is not None and ":" in part.use and part.use not in allowed:
            raise MacorError(
                f"it uses code of its own, {printable(part.use, 200)}, which runs when it is read;"
                " allow that with --allow and just this name"
            )
    eyes = _made(EYES, settings.eyes, given)
    given |= {"features": eyes.size, "mirrored": eyes.mirrored}
    return Brain(
        eyes,
        _made(CLUSTERERS, settings.clusterer, given),
        {name: _made(MEMORIES, part, given) for name, part in settings.memories.items()},
        settings.reinforcement,
        settings,
    )


def make_planner(name: str, **settings: Any) -> Planner:
    """Make a planner by its name.

    Raises:
        MacorError: there is none of this name, or a setting is wrong.
    """
    planner: Planner = _made(PLANNERS, Part(name, settings), {})
    return planner


def memory_for(brain: Brain, planner: Planner) -> Memory:
    """Return the memory that a planner reads.

    Raises:
        MacorError: the brain has none of that name.
    """
    try:
        return brain.memories[planner.memory]
    except KeyError:
        raise MacorError(
            f"this planner reads the memory {planner.memory!r}, which the map does not hold (it"
            f" holds {', '.join(brain.memories)}); train a map with it"
        ) from None


def _made(registry: Registry, part: Part, given: dict[str, Any]) -> Any:
    try:
        found = registry.find(part.use)
    except RegistryError as error:
        raise MacorError(str(error)) from error
    return make_part(found, part.settings, given)
