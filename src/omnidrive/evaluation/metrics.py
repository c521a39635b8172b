"""Error, effort and timing metrics of one run."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control import Status
from omnidrive.evaluation.path_error import arrival, path_errors
from omnidrive.geometry import wrap
from omnidrive.robot import Chassis
from omnidrive.simulation import Run


class Metrics(NamedTuple):
    """Tracking errors, control effort and computing time of one run."""

    me: float
    """Mean distance between true and reference position over all samples (the paper's ME), m."""
    mae: float
    """Mean absolute heading error, wrapped, over all samples (the paper's MAE), rad."""
    max_error: float
    """Maximum distance between true and reference position, m."""
    me_measured: float
    """As ``me``, but with the measured (noisy) position, as the paper's author computed it, m."""
    mae_measured: float
    """As ``mae``, but with the measured (noisy) heading, rad."""
    me_after_start: float
    """As ``me``, without the first 2 s, in which the robot accelerates from rest, m."""
    mae_after_start: float
    """As ``mae``, without the first 2 s, rad."""
    work: float
    """Mechanical work of the motors, J; NaN if the plant does not simulate forces."""
    wheel_acceleration: float
    """Control effort: mean absolute rate of change of the commanded wheel speeds, rad/s^2; NaN for
    commands of wheel torques."""
    step_time_median: float
    """Median computing time of a controller step, us."""
    step_time_p99: float
    """99th percentile of the computing time of a controller step, us."""
    path_me: float
    """Mean distance between the true position and the nearest point of the reference's path, m."""
    path_mae: float
    """Mean absolute difference of the headings there, wrapped, rad."""
    arrival: float
    """Time from which the robot stays within 0.05 m of the end of the reference, s; NaN: never."""
    fallbacks: int
    """Number of steps without a converged solution of the controller."""


START_PHASE = 2.0
"""Duration of the initial phase that the ``*_after_start`` metrics exclude, s."""


def heading_error(pose: Float[Array, "rows 3"], target: Float[Array, "rows 3"]) -> Array:
    """Return the heading of ``pose`` minus that of ``target``, wrapped to [-pi, pi), rad."""
    return wrap(pose[:, 2] - target[:, 2])


def position_error(pose: Float[Array, "rows 3"], target: Float[Array, "rows 3"]) -> Array:
    """Return the distance between the positions of ``pose`` and ``target``, m."""
    error: Float[Array, " rows"] = np.hypot(pose[:, 0] - target[:, 0], pose[:, 1] - target[:, 1])
    return error


def commanded_wheel_speeds(run: Run, chassis: Chassis) -> Float[Array, "rows wheels"]:
    """Return the commanded wheel speeds before saturation, rad/s.

    Those of a commanded twist follow from the wheel matrix. NaN for commanded torques, and usually
    in the last row, which has no command.
    """
    speeds: Float[Array, "rows wheels"] = run.command @ chassis.jacobian.T
    if run.wheel_speed_command.shape[1]:
        return np.where(np.isnan(speeds), run.wheel_speed_command, speeds)
    return speeds


def measure(run: Run, chassis: Chassis) -> Metrics:
    """Compute the metrics of a run; ``chassis`` converts body twists to wheel speeds."""
    distance = position_error(run.pose, run.target)
    turn = np.abs(heading_error(run.pose, run.target))
    on_path = path_errors(run)
    late = run.t >= START_PHASE
    if not late.any():
        late[-1] = True
    wheels = commanded_wheel_speeds(run, chassis)[:-1]
    change = np.abs(np.diff(wheels, axis=0, prepend=np.zeros((1, wheels.shape[1]))))
    step_time = run.step_time[np.isfinite(run.step_time)]
    median, p99 = np.percentile(step_time, [50, 99]) if len(step_time) else (nan, nan)
    mean_change = float(change.mean()) if len(change) else nan
    return Metrics(
        me=float(distance.mean()),
        mae=float(turn.mean()),
        max_error=float(distance.max()),
        me_measured=float(position_error(run.measured, run.target).mean()),
        mae_measured=float(np.abs(heading_error(run.measured, run.target)).mean()),
        me_after_start=float(distance[late].mean()),
        mae_after_start=float(turn[late].mean()),
        work=float(run.work[-1]),
        wheel_acceleration=mean_change * (len(run.t) - 1) / max(float(run.t[-1]), 1e-9),
        step_time_median=float(median),
        step_time_p99=float(p99),
        path_me=float(on_path.position.mean()),
        path_mae=float(on_path.heading.mean()),
        arrival=arrival(run),
        fallbacks=int((run.status == Status.FALLBACK).sum()),
    )
