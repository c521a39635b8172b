"""Checks and preparation of a predictive controller before its first step."""

from __future__ import annotations

from typing import TypeVar

from omnidrive.compiled import announce_compiling
from omnidrive.control.controller import Controller
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.parameter import bounds_of, check_sample_time
from omnidrive.reference import Hold

C = TypeVar("C", bound=Controller)

_START, _FAR_TARGET = Pose(0.0, 0.0, 0.0), Pose(1e3, 0.0, 0.0)


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
    for name, bounds in bounds_of(type(parameters)).items():
        try:
            bounds.check(getattr(parameters, name))
        except ValueError as error:
            raise InvalidInput(f"{name} {error}") from error


def precompile(controller: C, kernel: str) -> C:
    """Run one step of the controller, so that no later step waits for the compiler; return it.

    The step's target is so far away that limits are active.

    Args:
        controller: Any predictive controller; it is reset afterwards.
        kernel: Name of a kernel that the step calls; a warning is logged if it is not compiled.
    """
    announce_compiling(kernel)
    start = State(0.0, _START)
    controller.reset(start)
    controller.step(0.0, start, Hold(_FAR_TARGET, 1.0))
    controller.reset(start)
    return controller
