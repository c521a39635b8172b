"""Error, effort and timing metrics of one run."""

from __future__ import annotations

from math import isfinite, nan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.control import Status
from omnidrive.evaluation.measures.path_error import (
    PathErrors,
    arrivals,
    path_errors,
    path_errors_of,
)
from omnidrive.evaluation.measures.quantities import QUANTITIES
from omnidrive.evaluation.tables.table import cell_text
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

    def __str__(self) -> str:
        """Return one line per metric: its name, three significant digits, and its unit.

        A metric without a value is a dash.
        """
        shown = [(QUANTITIES[name], value) for name, value in self._asdict().items()]
        width = max(len(each.label) for each, _ in shown)
        lines = []
        for each, value in shown:
            unit = each.shown_unit if isfinite(value) else ""
            number = str(value) if isinstance(value, int) else cell_text(each.factor * value)
            lines.append(f"{each.label:<{width}}  {number} {unit}".rstrip())
        return "\n".join(lines)


START_PHASE = 2.0
"""Duration of the initial phase that the ``*_after_start`` metrics exclude, s."""


def heading_error(pose: Float[Array, "... rows 3"], target: Float[Array, "... rows 3"]) -> Array:
    """Return the heading of ``pose`` minus that of ``target``, wrapped to [-pi, pi), rad."""
    return wrap(pose[..., 2] - target[..., 2])


def position_error(pose: Float[Array, "... rows 3"], target: Float[Array, "... rows 3"]) -> Array:
    """Return the distance between the positions of ``pose`` and ``target``, m."""
    error: Array = np.hypot(pose[..., 0] - target[..., 0], pose[..., 1] - target[..., 1])
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


class LoggedRuns(NamedTuple):
    """Logs of runs with the same samples on one reference; fields as of :class:`Run`."""

    t: Float[Array, " rows"]
    """Times, s."""
    target: Float[Array, "rows 3"]
    """Poses of the reference; m, m, rad."""
    pose: Float[Array, "runs rows 3"]
    """True poses; m, m, rad."""
    measured: Float[Array, "runs rows 3"]
    """Measured poses; m, m, rad."""
    wheel_speeds: Float[Array, "runs rows wheels"]
    """Commanded wheel speeds before saturation, rad/s; the last row is not used."""
    work: Float[Array, " runs"]
    """Work of the motors at the end, J."""
    fallbacks: Int[Array, " runs"]
    """Number of steps without a converged solution of the controller."""


def measure(run: Run, chassis: Chassis) -> Metrics:
    """Compute the metrics of a run; ``chassis`` converts body twists to wheel speeds."""
    logged = LoggedRuns(
        run.t, run.target, run.pose[None], run.measured[None],
        commanded_wheel_speeds(run, chassis)[None], run.work[-1:],
        np.array([(run.status == Status.FALLBACK).sum()]),
    )  # fmt: skip
    on_path = PathErrors(*(each[None] for each in path_errors(run)))
    (metrics,) = _metrics_of(logged, on_path)
    median, p99 = step_time_percentiles(run)
    return metrics._replace(step_time_median=median, step_time_p99=p99)


def step_time_percentiles(run: Run) -> tuple[float, float]:
    """Return median and 99th percentile of the computing times of steps, us; NaN: unknown."""
    times = run.step_time[np.isfinite(run.step_time)]
    median, p99 = np.percentile(times, [50, 99]) if len(times) else (nan, nan)
    return float(median), float(p99)


def measure_many(runs: LoggedRuns) -> list[Metrics]:
    """Compute the metrics of each run, as :func:`measure`; computing times are not known: NaN."""
    return _metrics_of(runs, path_errors_of(runs.t, runs.pose, runs.target))


def _metrics_of(runs: LoggedRuns, on_path: PathErrors) -> list[Metrics]:
    """Return the metrics of each run without computing times."""
    t, target, pose, measured = runs[:4]
    distance = position_error(pose, target)
    turn = np.abs(heading_error(pose, target))
    late = min(int(np.searchsorted(t, START_PHASE)), len(t) - 1)  # the first sample after the start
    wheels = np.ascontiguousarray(runs.wheel_speeds[:, :-1])
    change = np.abs(np.diff(wheels, axis=1, prepend=np.zeros((len(wheels), 1, wheels.shape[2]))))
    change = change.reshape(len(wheels), -1)
    mean_change = change.mean(axis=1) if change.size else np.full(len(wheels), nan)
    columns = {
        "me": distance.mean(axis=1),
        "mae": turn.mean(axis=1),
        "max_error": distance.max(axis=1),
        "me_measured": position_error(measured, target).mean(axis=1),
        "mae_measured": np.abs(heading_error(measured, target)).mean(axis=1),
        "me_after_start": distance[:, late:].mean(axis=1),
        "mae_after_start": turn[:, late:].mean(axis=1),
        "work": runs.work,
        "wheel_acceleration": mean_change * (len(t) - 1) / max(float(t[-1]), 1e-9),
        "step_time_median": np.full(len(pose), nan),
        "step_time_p99": np.full(len(pose), nan),
        "path_me": on_path.position.mean(axis=1),
        "path_mae": on_path.heading.mean(axis=1),
        "arrival": np.array(arrivals(t, pose, target)),
        "fallbacks": runs.fallbacks,
    }
    rows = zip(*(columns[name].tolist() for name in Metrics._fields), strict=True)
    return [Metrics(*row) for row in rows]
