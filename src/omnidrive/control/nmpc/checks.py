"""What is checked of a predictive controller before it drives."""

from __future__ import annotations

from math import isfinite

from omnidrive.errors import InvalidInput
from omnidrive.parameter import bounds_of


def check_settings(dt: float, horizon: int, parameters: tuple[float, ...]) -> None:
    """Refuse a sample time (s), a number of stages or a parameter outside its domain.

    ``parameters`` is a named tuple whose fields carry :class:`~omnidrive.parameter.Bounds`.
    """
    if not (isfinite(dt) and dt > 0.0):
        raise InvalidInput(f"the sample time must be positive, got {dt:g} s")
    if horizon < 1:
        raise InvalidInput(f"the horizon must be at least 1 stage, got {horizon}")
    for name, bounds in bounds_of(type(parameters)).items():
        try:
            bounds.check(getattr(parameters, name))
        except ValueError as error:
            raise InvalidInput(f"{name} {error}") from error
