"""Preparation of a controller before its first sample."""

from __future__ import annotations

from omnidrive.compiled import announce_compiling
from omnidrive.control.controller import Controller
from omnidrive.estimation import State
from omnidrive.geometry import Pose
from omnidrive.reference import Hold

_FAR_TARGET = Pose(1e3, 0.0, 0.0)


def run_once(controller: Controller) -> None:
    """Run one step of a controller and reset it, so that no later step waits for the compiler.

    The step's target is so far away that limits are active. A warning is logged if a kernel has to
    be compiled.
    """
    start = State(0.0, Pose(0.0, 0.0, 0.0))
    with announce_compiling():
        controller.reset(start)
        controller.step(0.0, start, Hold(_FAR_TARGET, 1.0))
        controller.reset(start)
