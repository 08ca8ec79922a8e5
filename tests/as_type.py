"""Values of a type that a test is sure of."""

from typing import TypeVar

T = TypeVar("T")


def as_type(kind: type[T], value: object) -> T:
    """Return a value, which must be of the type."""
    assert isinstance(value, kind), value
    return value
