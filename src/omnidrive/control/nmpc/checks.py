"""What is done for a predictive controller before it drives."""

from __future__ import annotations

from typing import TypeVar

from omnidrive.compiled import announce_compiling
from omnidrive.control.controller import Controller
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose
from omnidrive.parameter import bounds_of, check_sample_time
from omnidrive.reference import Hold

C = TypeVar("C", bound=Controller)

_START, _FAR = Pose(0.0, 0.0, 0.0), Pose(1e3, 0.0, 0.0)


def check_settings(dt: float, horizon: int, parameters: tuple[float, ...]) -> None:
    """Refuse a sample time (s), a number of stages or a parameter outside its domain.

    ``parameters`` is a named tuple whose fields carry :class:`~omnidrive.parameter.Bounds`.
    """
    check_sample_time(dt)
    if horizon < 1:
        raise InvalidInput(f"the horizon must be at least 1 stage, got {horizon}")
    for name, bounds in bounds_of(type(parameters)).items():
        try:
            bounds.check(getattr(parameters, name))
        except ValueError as error:
            raise InvalidInput(f"{name} {error}") from error


def compiled_first(controller: C, kernel: str) -> C:
    """The controller, after a step that does not matter: no other has to wait for a compiler.

    It is towards a place far away, where limits bind. ``kernel`` is one that it needs.
    """
    announce_compiling(kernel)
    controller.reset(_START)
    controller.step(0.0, _START, Hold(_FAR, 1.0))
    controller.reset(_START)
    return controller
