"""The problem to solve at one instant of a reference."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.control.nmpc.presets import NmpcParameters
from omnidrive.control.nmpc.problem import Problem
from omnidrive.geometry import Pose, wrap
from omnidrive.reference import Reference

Array = np.ndarray


def tracking_problem(
    parameters: NmpcParameters,
    t: float,
    pose: Pose,
    reference: Reference,
    *,
    horizon: int,
    dt: float,
) -> Problem:
    """Problem of following ``reference`` over ``horizon`` stages of ``dt`` (s) from ``t`` (s)."""
    targets = reference.window(t, horizon + 1, dt)[:, :3].copy()  # contiguous, for the kernels
    targets[:, 2] = nearest_branch(targets[:, 2], pose.yaw)
    p = parameters
    weights = np.empty((horizon + 1, 3))
    weights[:] = p.position_weight, p.position_weight, p.heading_weight
    weights[-1] *= p.terminal_factor
    max_speed = min(p.max_speed, p.max_travel / max(reference.duration, dt))
    return Problem(
        dt=float(dt),
        start=np.array(pose, dtype=float),
        targets=targets,
        feedforward=finite_differences(targets, dt),
        state_weights=weights,
        control_weights=np.array([p.speed_weight, p.yaw_rate_weight]),
        limits=np.array([max_speed, p.max_yaw_rate]),
    )


def nearest_branch(headings: Float[Array, " n"], yaw: float) -> Float[Array, " n"]:
    """``headings`` without jumps, moved as a whole by the turns that bring the first near ``yaw``.

    All in rad. The steps between headings are taken the short way round.
    """
    steps = wrap(np.diff(headings))
    first = yaw + wrap(float(headings[0]) - yaw)
    return np.cumsum(np.concatenate([[first], steps]))


def finite_differences(targets: Float[Array, "points 3"], dt: float) -> Float[Array, "stages 2"]:
    """Speed (m/s) and yaw rate (rad/s) that lead from each waypoint to the next.

    The paper's "corresponding velocity" of each waypoint; negative where the reference moves
    against its heading.

    Args:
        targets: Waypoints ``dt`` apart; m, m, rad, the yaw without jumps.
        dt: In s.
    """
    dx, dy, turn = np.diff(targets, axis=0).T
    yaw = targets[:-1, 2]
    speed = np.copysign(np.hypot(dx, dy), np.cos(yaw) * dx + np.sin(yaw) * dy)
    return np.column_stack([speed, turn]) / dt
