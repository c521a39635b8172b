"""Tracking problem of the unicycle at one time of a reference."""

from __future__ import annotations

from math import copysign, cos, hypot, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.control.controller import CommandLimits
from omnidrive.control.nmpc.common.unwrap import unwrap_near
from omnidrive.control.nmpc.unicycle.parameters import UnicycleParameters
from omnidrive.control.nmpc.unicycle.problem import Control, UnicycleProblem
from omnidrive.geometry import Pose
from omnidrive.reference import Reference


def tracking_problem(
    parameters: UnicycleParameters,
    t: float,
    pose: Pose,
    reference: Reference,
    *,
    horizon: int,
    dt: float,
) -> UnicycleProblem:
    """Return the problem of tracking ``reference`` from ``pose`` at the time ``t``.

    Args:
        parameters: Weights and limits.
        t: Time of the first state, in s.
        pose: The first state, in W.
        reference: The trajectory to track.
        horizon: N, number of stages.
        dt: Length of a stage, in s.
    """
    targets = reference.window(t, horizon + 1, dt)[:, :3].copy()  # contiguous, for the kernels
    targets[:, 2] = unwrap_near(targets[:, 2], pose.yaw)
    p = parameters
    weights = np.empty((horizon + 1, 3))
    weights[:] = p.position_weight, p.position_weight, p.heading_weight
    weights[-1] *= p.terminal_factor
    feedforward = finite_differences(targets, dt)
    speed, yaw_rate = np.abs(feedforward).max(axis=0).tolist()
    largest = largest_motion(p, reference.duration, dt)
    limits = Control(
        float(min(largest.speed, max(p.free_speed, speed))),
        float(min(largest.yaw_rate, max(p.free_yaw_rate, yaw_rate))),
    )
    return UnicycleProblem(
        dt=float(dt),
        start=np.array(pose, dtype=float),
        targets=targets,
        feedforward=feedforward,
        state_weights=weights,
        control_weights=Control(float(p.speed_weight), float(p.yaw_rate_weight)),
        limits=limits,
    )


def largest_motion(parameters: UnicycleParameters, duration: float, dt: float) -> CommandLimits:
    """Return the largest motion of a plan on a reference.

    Args:
        parameters: Limits.
        duration: Duration of the reference, in s.
        dt: Length of a stage, in s.
    """
    speed = min(parameters.max_speed, parameters.max_travel / max(duration, dt))
    return CommandLimits(speed, parameters.max_yaw_rate)


@compiled
def finite_differences(targets: Float[Array, "points 3"], dt: float) -> Float[Array, "stages 2"]:
    """Return the speed (m/s) and the yaw rate (rad/s) between consecutive targets.

    The paper's "corresponding velocity" of each waypoint; the speed is negative where the
    reference moves against its heading.

    Args:
        targets: Poses ``dt`` apart; m, m, rad, the yaw unwrapped.
        dt: In s.
    """
    controls = np.empty((len(targets) - 1, 2))
    for k in range(len(controls)):
        dx, dy = targets[k + 1, 0] - targets[k, 0], targets[k + 1, 1] - targets[k, 1]
        along = cos(targets[k, 2]) * dx + sin(targets[k, 2]) * dy
        controls[k, 0] = copysign(hypot(dx, dy), along) / dt
        controls[k, 1] = (targets[k + 1, 2] - targets[k, 2]) / dt
    return controls
