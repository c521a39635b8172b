"""Checks of the settings of a predictive controller."""

from __future__ import annotations

from numbers import Integral

from omnidrive.errors import InvalidInput
from omnidrive.parameter import check_bounds, check_sample_time

_MAX_STAGES = 1000  # more take seconds per step


def check_settings(dt: float, horizon: int, parameters: tuple[float, ...]) -> None:
    """Check a sample time (s), a number of stages and the controller's parameters.

    Args:
        dt: Sample time in s.
        horizon: Number of stages.
        parameters: Named tuple whose fields carry :class:`~omnidrive.parameter.Bounds`.

    Raises:
        InvalidInput: A value is outside its domain.
    """
    check_sample_time(dt)
    if not isinstance(horizon, Integral) or not 1 <= horizon <= _MAX_STAGES:
        raise InvalidInput(f"the horizon must be 1 to {_MAX_STAGES} stages, got {horizon!r:.60}")
    check_bounds(parameters)
