"""Range checks of physical parameters."""

from __future__ import annotations

from math import isfinite

from omnidrive.errors import InvalidInput


def check_positive(name: str, value: float, unit: str) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless ``value`` is finite and positive."""
    if not (isfinite(value) and value > 0.0):
        raise InvalidInput(f"{name} must be positive, got {value:g} {unit}".rstrip())


def check_not_negative(name: str, value: float, unit: str) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless ``value`` is finite and at least 0."""
    if not (isfinite(value) and value >= 0.0):
        raise InvalidInput(f"{name} must not be negative, got {value:g} {unit}".rstrip())
