"""Checks of the settings of a predictive controller."""

from __future__ import annotations

from omnidrive.errors import InvalidInput
from omnidrive.parameter import check_bounds, check_sample_time


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
    if horizon < 1:
        raise InvalidInput(f"the horizon must be at least 1 stage, got {horizon}")
    check_bounds(parameters)
