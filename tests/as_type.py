"""Values that a test is sure of: of a type, or there at all."""

from typing import TypeVar

T = TypeVar("T")


def as_type(kind: type[T], value: object) -> T:
    """Return a value, which must be of the type."""
    assert isinstance(value, kind), value
    return value


def not_none(value: T | None) -> T:
    """Return a value, which must not be None."""
    assert value is not None
    return value
