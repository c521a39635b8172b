"""Weights and limits of the unicycle's NMPC, and the two published sets of them."""

from __future__ import annotations

from math import inf, pi
from typing import Annotated, Literal, NamedTuple

from omnidrive.parameter import Bounds
from omnidrive.robot import Robot

Preset = Literal["paper", "published-code"]


class UnicycleParameters(NamedTuple):
    """Weights and limits of the optimal control problem, and the lateral gain of the law."""

    position_weight: Annotated[float, Bounds(0.0, 1e4, "1/m^2")] = 15.0
    """First two diagonal entries of Q."""
    heading_weight: Annotated[float, Bounds(0.0, 1e4, "1/rad^2")] = 15.0
    """Third diagonal entry of Q."""
    speed_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/m^2")] = 1.0
    """First diagonal entry of R."""
    yaw_rate_weight: Annotated[float, Bounds(1e-3, 1e4, "s^2/rad^2")] = 1.0
    """Second diagonal entry of R."""
    terminal_factor: Annotated[float, Bounds(0.0, 1e3, "1")] = 1.0
    """Terminal weight, as a multiple of Q."""
    max_speed: Annotated[float, Bounds(1e-3, 1e3, "m/s")] = 1.5
    """Largest |speed| for any reference."""
    max_travel: Annotated[float, Bounds(0.1, 1e4, "m")] = 1e4
    """Largest product of |speed| and the duration of the reference."""
    max_yaw_rate: Annotated[float, Bounds(1e-3, 1e3, "rad/s")] = 3.14
    """Largest |yaw rate|."""
    free_speed: Annotated[float, Bounds(1e-3, inf, "m/s")] = inf
    """Largest |speed| where the reference is slower than this within the horizon; where it is
    faster, its speed is the limit."""
    free_yaw_rate: Annotated[float, Bounds(1e-3, inf, "rad/s")] = inf
    """Likewise of |yaw rate|."""
    lateral_gain: Annotated[float, Bounds(0.0, 5.0, "1/s")] = 1.0
    """Gain on the predicted lateral error in :func:`~.controller.unicycle_law`; 0: as published."""


PRESETS: dict[Preset, UnicycleParameters] = {
    # Sections "Non-linear MPC" (the sum over the states runs to k = N_p) and "Simulation setup".
    # The lateral gain is an addition: see ``unicycle_law``.
    "paper": UnicycleParameters(),
    # The code has no terminal cost and limits v to 15 m / T. No lateral gain.
    "published-code": UnicycleParameters(
        heading_weight=5.0,
        terminal_factor=0.0,
        max_speed=10.0,
        max_travel=15.0,
        max_yaw_rate=0.5 * pi,
        lateral_gain=0.0,
    ),
}
"""Parameters by name. The limits hold in both directions: |v| and |yaw rate|."""


def robot_limits(robot: Robot) -> UnicycleParameters:
    """Return the weights of the paper's text with limits for a robot.

    The limits are the speeds that the robot's wheels reach in every direction
    (:attr:`~omnidrive.robot.Robot.top_speeds`). They are used where the reference needs
    them; elsewhere the limits of the paper hold: the model has no limits of acceleration, and a
    step at the top speed of the wheels would make them slip and turn the robot aside.
    """
    text, (speed, yaw_rate) = PRESETS["paper"], robot.top_speeds
    return text._replace(
        max_speed=min(max(speed, 1e-3), 1e3),
        max_yaw_rate=min(max(yaw_rate, 1e-3), 1e3),
        free_speed=text.max_speed,
        free_yaw_rate=text.max_yaw_rate,
    )
