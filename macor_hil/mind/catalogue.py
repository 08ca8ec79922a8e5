"""Planners, memories, clusterers and eyes by name, and brains built from them."""

from collections.abc import Collection, Iterable
from typing import Any, Final

from khepera_protocol.registry import Registry, RegistryError, is_own_code
from khepera_protocol.text import printable

from macor_hil.commands import COMMANDS
from macor_hil.errors import MacorError
from macor_hil.mind.brain import Brain
from macor_hil.mind.eyes.eyes import FloorSeeing
from macor_hil.mind.memories.memory import Memory
from macor_hil.mind.planners.planner import Planner
from macor_hil.mind.settings import MindSettings, Part, make_part

PLANNERS: Final = Registry(
    "planner",
    "khepera_macor.planners",
    {
        "anticipative": "macor_hil.mind.planners.anticipative:Anticipative",
        "reactive": "macor_hil.mind.planners.reactive:Reactive",
        "q-learning": "macor_hil.mind.planners.q_learning:QLearning",
        "weak-q-learning": "macor_hil.mind.planners.q_learning:WeakQLearning",
        "expected": "macor_hil.mind.planners.expected:Expected",
        "graded": "macor_hil.mind.planners.graded:Graded",
        "fitted-q": "macor_hil.mind.planners.fitted_q:FittedQ",
        "successor": "macor_hil.mind.planners.successor:Successor",
        "foresight": "macor_hil.mind.planners.foresight:Foresight",
        "goal": "macor_hil.mind.planners.goal:Goal",
    },
)
MEMORIES: Final = Registry(
    "memory",
    "khepera_macor.memories",
    {
        "transitions": "macor_hil.mind.memories.transitions:SensorimotorMap",
        "q-learning": "macor_hil.mind.memories.q_map:QMap",
        "graded": "macor_hil.mind.memories.graded:GradedMemory",
        "fitted-q": "macor_hil.mind.memories.fitted_q:FittedQMemory",
        "successor": "macor_hil.mind.memories.successor:SuccessorMap",
        "foresight": "macor_hil.mind.memories.foresight:ForesightMemory",
        "places": "macor_hil.mind.memories.places:PlacesMemory",
    },
)
CLUSTERERS: Final = Registry(
    "clusterer",
    "khepera_macor.clusterers",
    {
        "fuzzy-art": "macor_hil.mind.clusterers.fuzzy_art:FuzzyArt",
        "neural-gas": "macor_hil.mind.clusterers.neural_gas:NeuralGas",
    },
)
EYES: Final = Registry(
    "kind of eyes",
    "khepera_macor.eyes",
    {
        "receptive-fields": "macor_hil.mind.eyes.panorama:PanoramaEyes",
        "fields-and-floor": "macor_hil.mind.eyes.floor:FloorEyes",
        "front": "macor_hil.mind.eyes.front:FrontEyes",
    },
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
    for use in own_code(settings):
        if allowed is not None and use not in allowed:
            raise MacorError(
                f"it uses code of its own, {printable(use, 200)}, which runs when it is read;"
                " allow that with --allow and just this name"
            )
    eyes = _made(EYES, settings.eyes, given)
    directions = eyes.directions if isinstance(eyes, FloorSeeing) else 0
    given |= {"features": eyes.size, "mirrored": eyes.mirrored, "directions": directions}
    return Brain(
        eyes,
        _made(CLUSTERERS, settings.clusterer, given),
        {name: _made(MEMORIES, part, given) for name, part in settings.memories.items()},
        settings.reinforcement,
        settings,
    )


def own_code(settings: MindSettings) -> list[str]:
    """List the parts that settings name as `module:Class` or `file.py:Class`."""
    parts = (settings.eyes, settings.clusterer, *settings.memories.values())
    return [part.use for part in parts if is_own_code(part.use)]


def whereabouts(settings: MindSettings, planners: Iterable[str] = ()) -> list[str]:
    """Return where the code of a brain's parts and of planners is, as `Registry.where` does.

    Raises:
        MacorError: there is no such part.
    """
    parts = [(EYES, settings.eyes.use), (CLUSTERERS, settings.clusterer.use)]
    parts += [(MEMORIES, part.use) for part in settings.memories.values()]
    parts += [(PLANNERS, name) for name in planners]
    try:
        return sorted({registry.where(name) for registry, name in parts})
    except RegistryError as error:
        raise MacorError(str(error)) from error


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
