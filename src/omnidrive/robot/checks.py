"""Range checks of physical parameters."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from omnidrive.errors import InvalidInput


def not_positive(name: str, value: float, unit: str) -> list[str]:
    """Return the fault of ``value`` in a list, empty if it is finite and positive."""
    if isfinite(value) and value > 0.0:
        return []
    return [f"{name} must be positive, got {value:g} {unit}".rstrip()]


def negative(name: str, value: float, unit: str) -> list[str]:
    """Return the fault of ``value`` in a list, empty if it is finite and at least 0."""
    if isfinite(value) and value >= 0.0:
        return []
    return [f"{name} must not be negative, got {value:g} {unit}".rstrip()]


def check_no_faults(faults: Sequence[str]) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` with all faults, if there are any."""
    if faults:
        raise InvalidInput("; ".join(faults))
