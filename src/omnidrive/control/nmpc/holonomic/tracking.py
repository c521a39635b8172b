"""Tracking problem of a holonomic robot at one time of a reference."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnidrive.control.nmpc.common.unwrap import unwrap_near
from omnidrive.control.nmpc.holonomic.keep_out_zone import KeepOutZone, stack_keep_outs
from omnidrive.control.nmpc.holonomic.parameters import HolonomicParameters
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem, Limits
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Reference


def tracking_problem(
    parameters: HolonomicParameters,
    t: float,
    pose: Pose,
    reference: Reference,
    *,
    horizon: int,
    dt: float,
    previous: BodyTwist,
    limits: Limits,
    keep_outs: Sequence[KeepOutZone] = (),
) -> HolonomicProblem:
    """Return the problem of tracking ``reference`` from ``pose`` at the time ``t``.

    Args:
        parameters: Weights.
        t: Time of the first state, in s.
        pose: The first state, in W.
        reference: The trajectory to track.
        horizon: N, number of stages.
        dt: Length of a stage, in s.
        previous: Body twist before the first stage.
        limits: Limits of the body twists.
        keep_outs: Keep-out zones at the times of the states.
    """
    points = horizon + 1
    targets = reference.window(t, points, dt)[:, :3].copy()
    with np.errstate(invalid="ignore"):  # the controller checks for values that are not finite
        targets[:, 2] = unwrap_near(targets[:, 2], pose.yaw)
        feedforward = np.diff(targets, axis=0) / dt
    return HolonomicProblem(
        dt=float(dt),
        start=np.array(pose, dtype=float),
        previous=np.array(previous),
        targets=targets,
        feedforward=feedforward,
        state_weights=parameters.state_weights(points, dt),
        control_weights=parameters.control_weights(),
        limits=limits,
        keep_outs=stack_keep_outs(keep_outs, points),
    )
