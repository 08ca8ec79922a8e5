"""Parts of others: turrets, robot models, ports and kinds of faults, found by name."""

from typing import Any

from khepera_protocol.registry import Registry, RegistryError

from khepera_emulator.errors import EmulatorError


def find_part(registry: Registry, name: str) -> Any:
    """Load a part of a kind.

    Raises:
        EmulatorError: there is none of that name, or it cannot be imported.
    """
    try:
        return registry.find(name)
    except RegistryError as error:
        raise EmulatorError(str(error)) from None
