"""The problem to solve at one instant of a reference."""

from __future__ import annotations

from math import copysign, cos, hypot, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.control.nmpc.presets import NmpcParameters
from omnidrive.control.nmpc.problem import Problem
from omnidrive.geometry import Pose, wrap
from omnidrive.reference import Reference

_wrap = inlined(wrap)


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


@compiled
def nearest_branch(headings: Float[Array, " n"], yaw: float) -> Float[Array, " n"]:
    """``headings`` without jumps, moved as a whole by the turns that bring the first near ``yaw``.

    All in rad. The steps between headings are taken the short way round.
    """
    branch = np.empty(len(headings))
    branch[0] = yaw + _wrap(headings[0] - yaw)
    for k in range(1, len(headings)):
        branch[k] = branch[k - 1] + _wrap(headings[k] - headings[k - 1])
    return branch


@compiled
def finite_differences(targets: Float[Array, "points 3"], dt: float) -> Float[Array, "stages 2"]:
    """Speed (m/s) and yaw rate (rad/s) that lead from each waypoint to the next.

    The paper's "corresponding velocity" of each waypoint; negative where the reference moves
    against its heading.

    Args:
        targets: Waypoints ``dt`` apart; m, m, rad, the yaw without jumps.
        dt: In s.
    """
    controls = np.empty((len(targets) - 1, 2))
    for k in range(len(controls)):
        dx, dy = targets[k + 1, 0] - targets[k, 0], targets[k + 1, 1] - targets[k, 1]
        along = cos(targets[k, 2]) * dx + sin(targets[k, 2]) * dy
        controls[k, 0] = copysign(hypot(dx, dy), along) / dt
        controls[k, 1] = (targets[k + 1, 2] - targets[k, 2]) / dt
    return controls
