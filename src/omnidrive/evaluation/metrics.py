"""Numbers about one run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Status
from omnidrive.geometry import wrap
from omnidrive.robot import Chassis
from omnidrive.simulation import Run


class Metrics(NamedTuple):
    """How well one run tracked its reference, and at what price."""

    me: float
    """Mean distance between true and reference position over all samples, in m (the paper's ME)."""
    mae: float
    """Mean |heading error| over all samples, wrapped, in rad (the paper's MAE)."""
    max_error: float
    """Largest distance between true and reference position, in m."""
    me_measured: float
    """As ``me``, of the measured (noisy) position, as the paper's author computed it; in m."""
    mae_measured: float
    """As ``mae``, of the measured (noisy) heading; in rad."""
    me_after_start: float
    """As ``me``, without the first 2 s, in which the robot leaves rest; in m."""
    mae_after_start: float
    """As ``mae``, without the first 2 s; in rad."""
    work: float
    """Mechanical work of the motors, in J; NaN for a plant without forces."""
    wheel_acceleration: float
    """Control effort: mean |change of commanded wheel speed| per second and wheel, in rad/s^2."""
    step_time_median: float
    """Median computing time of one controller step, in us."""
    step_time_p99: float
    """99th percentile of the computing time of one controller step, in us."""
    fallbacks: int
    """Steps at which the controller had no converged solution."""


START_PHASE = 2.0
"""Length of the start that ``*_after_start`` leaves out, in s."""


def heading_error(pose: Float[Array, "rows 3"], target: Float[Array, "rows 3"]) -> Array:
    """Heading of ``pose`` minus that of ``target``, wrapped to [-pi, pi), in rad."""
    return wrap(pose[:, 2] - target[:, 2])


def position_error(pose: Float[Array, "rows 3"], target: Float[Array, "rows 3"]) -> Array:
    """Distance between ``pose`` and ``target``, in m."""
    error: Float[Array, " rows"] = np.hypot(pose[:, 0] - target[:, 0], pose[:, 1] - target[:, 1])
    return error


def measure(run: Run, chassis: Chassis) -> Metrics:
    """Reduce a log to its metrics; ``chassis`` turns commands into wheel speeds."""
    distance = position_error(run.pose, run.target)
    turn = np.abs(heading_error(run.pose, run.target))
    late = run.t >= START_PHASE
    if not late.any():
        late[-1] = True
    wheels = run.command[:-1] @ chassis.jacobian.T
    change = np.abs(np.diff(wheels, axis=0, prepend=np.zeros((1, wheels.shape[1]))))
    step_time = run.step_time[np.isfinite(run.step_time)]
    return Metrics(
        me=float(distance.mean()),
        mae=float(turn.mean()),
        max_error=float(distance.max()),
        me_measured=float(position_error(run.measured, run.target).mean()),
        mae_measured=float(np.abs(heading_error(run.measured, run.target)).mean()),
        me_after_start=float(distance[late].mean()),
        mae_after_start=float(turn[late].mean()),
        work=float(run.work[-1]),
        wheel_acceleration=float(change.mean() * (len(run.t) - 1) / max(run.t[-1], 1e-9)),
        step_time_median=float(np.median(step_time)),
        step_time_p99=float(np.percentile(step_time, 99)),
        fallbacks=int((run.status == Status.FALLBACK).sum()),
    )
