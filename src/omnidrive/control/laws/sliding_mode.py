"""Sliding-mode control of position and heading with a boundary layer."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.compiled_law import CompiledLaw, SampleState, SetpointWindow
from omnidrive.control.components import ControllerContext
from omnidrive.control.law_controller import LawController
from omnidrive.geometry import Pose
from omnidrive.geometry.kernels import twist_between, wrap
from omnidrive.parameter import Bounds, check_bounds, check_sample_time

_MIN_STEPS = 2.0  # a delay of one sample then leaves errors in the layer damped


class SlidingModeParameters(NamedTuple):
    """Reaching rates and boundary layers; the rate over the layer is the gain inside, in 1/s."""

    speed: Annotated[float, Bounds(0.0, 10.0, "m/s")] = 0.82
    """Rate at which a position error outside its layer decreases, m/s."""
    layer: Annotated[float, Bounds(1e-4, 10.0, "m")] = 0.22
    """Half-width of the boundary layer of the position error, m."""
    yaw_rate: Annotated[float, Bounds(0.0, 50.0, "rad/s")] = 1.9
    """Rate at which a heading error outside its layer decreases, rad/s."""
    heading_layer: Annotated[float, Bounds(1e-4, 3.0, "rad")] = 0.38
    """Half-width of the boundary layer of the heading error, rad."""


class SlidingModeData(NamedTuple):
    """Parameters of the law; the fields are those of :class:`SlidingModeController`."""

    parameters: SlidingModeParameters
    dt: float


@compiled
def remaining_share(error: float, rate: float, layer: float, dt: float) -> float:
    """Return the share of an error that the reaching law leaves after ``dt`` seconds, 0 to 1.

    The reaching law is ``error' = -rate sat(error / layer)``. A layer that the error crosses in few
    samples would chatter: it has at least the width of two steps of ``rate dt``.
    """
    return 1.0 - rate * dt / max(abs(error), layer, _MIN_STEPS * rate * dt)


@compiled
def sliding_mode_law(  # noqa: PLR0917
    data: SlidingModeData,
    memory: Float[Array, " 0"],
    now: SampleState,
    setpoints: Float[Array, "2 6"],
    command: Float[Array, " 3"],
    details: Float[Array, " 0"],
) -> int:
    """Fill in the body twist that moves the errors towards the sliding surface ``error = 0``.

    The pose of a robot that executes twists is of first order, so that the surface is the error
    itself and the equivalent control is the motion of the reference. The switching term
    ``-rate sign(error)`` is continuous within a boundary layer (Slotine & Li, "Applied Nonlinear
    Control", 1991, sections 7.1 and 7.2): ``-rate sat(error / layer)``. The position error is
    treated as a vector (unit-vector control), which makes the law independent of the frame. A
    disturbance of the velocity below ``rate`` leaves an error of ``layer disturbance / rate``.

    The command leads, along the arc of a constant body twist, to where this law moves the pose in
    one sample; see :func:`~omnidrive.control.feedforward.feedforward_law`.
    """
    p, dt, (x, y, yaw) = data.parameters, data.dt, now.pose
    current, following = setpoints[0], setpoints[1]
    error_x, error_y, turn = x - current[0], y - current[1], wrap(yaw - current[2])
    share = remaining_share(hypot(error_x, error_y), p.speed, p.layer, dt)
    goal = Pose(
        following[0] + share * error_x,
        following[1] + share * error_y,
        following[2] + remaining_share(turn, p.yaw_rate, p.heading_layer, dt) * turn,
    )
    command[0], command[1], command[2] = twist_between(Pose(x, y, yaw), goal, dt)
    return 0


_DEFAULTS = SlidingModeParameters()


@dataclass(frozen=True)
class SlidingModeController(LawController):
    """A :class:`~omnidrive.control.Controller` with :func:`sliding_mode_law`; it has no memory.

    Attributes:
        dt: Sample time in s.
        parameters: Reaching rates and boundary layers.

    Raises:
        InvalidInput: ``dt`` is not positive, or a parameter is out of its range.
    """

    dt: float
    parameters: SlidingModeParameters = _DEFAULTS

    def __post_init__(self) -> None:
        check_sample_time(self.dt)
        check_bounds(self.parameters)

    def compiled_law(self) -> CompiledLaw:
        """Return the law with the controller's parameters."""
        data = SlidingModeData(self.parameters, self.dt)
        return CompiledLaw(sliding_mode_law, data, np.zeros(0), SetpointWindow(0.0, 2, self.dt))


def controller(
    context: ControllerContext, parameters: SlidingModeParameters
) -> SlidingModeController:
    """Sliding-mode control with a boundary layer, and feedforward of the reference's motion."""
    return SlidingModeController(context.dt, parameters)
