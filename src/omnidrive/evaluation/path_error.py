"""Distance of a robot to the path of its reference, and how late it is there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from omnidrive.arrays import Array
from omnidrive.geometry import wrap
from omnidrive.simulation import Run

_POINTS = 10
"""Points on the path per sample of the log."""
_AHEAD, _BEHIND = 1.0, 0.5
"""Time, s, along the reference in which the nearest point is searched, from the one before."""
_SAME = 1e-9
"""Difference of distances, m, that counts as none."""
ARRIVED = 0.05
"""Distance from the end of the reference, m, within which a robot has arrived."""


class PathErrors(NamedTuple):
    """Errors of each sample of a run with respect to the nearest point of the path."""

    position: Float[Array, " rows"]
    """Distance, m."""
    heading: Float[Array, " rows"]
    """Absolute difference of the headings there, wrapped, rad."""
    delay: Float[Array, " rows"]
    """Time since the reference was there, s; negative: the robot is ahead of it."""


def path_errors(run: Run) -> PathErrors:
    """Return the errors of a run with respect to the path of its reference, not to its timing.

    The path is the cubic spline through the logged targets. The nearest point is searched
    near that of the sample before, so that the branch of a path that crosses itself is the one that
    the robot follows. Of equal points, where the reference stands, it is the latest one that the
    reference has reached.
    """
    t = run.t
    target = np.column_stack([run.target[:, :2], np.unwrap(run.target[:, 2])])
    if len(t) < 2 or not np.isfinite(target).all():
        distance = np.hypot(*(run.pose - run.target)[:, :2].T)
        return PathErrors(distance, np.abs(wrap(run.pose[:, 2] - run.target[:, 2])), 0.0 * t)
    curve = CubicSpline(t, target)
    times = np.linspace(t[0], t[-1], _POINTS * (len(t) - 1) + 1)
    path = curve(times)
    step = float(times[1] - times[0])
    behind, ahead = round(_BEHIND / step), round(_AHEAD / step)
    nearest, at = np.zeros(len(t), dtype=int), 0
    for k, (x, y) in enumerate(run.pose[:, :2].tolist()):
        start = max(at - behind, 0)
        near = path[start : at + ahead + 1]
        distance = np.hypot(near[:, 0] - x, near[:, 1] - y)
        equal = start + np.flatnonzero(distance <= distance.min() + _SAME)
        past = int(np.searchsorted(times[equal], t[k] + 1e-9))
        at = int(equal[max(past - 1, 0)])
        nearest[k] = at
    velocity = curve(times[nearest], 1)[:, :2]
    along = ((run.pose - path[nearest])[:, :2] * velocity).sum(axis=1)
    square = np.maximum((velocity**2).sum(axis=1), _SAME)
    reached = np.clip(times[nearest] + np.clip(along / square, -step, step), t[0], t[-1])
    points = curve(reached)
    return PathErrors(
        np.hypot(*(run.pose - points)[:, :2].T),
        np.abs(wrap(run.pose[:, 2] - points[:, 2])),
        t - reached,
    )


def arrival(run: Run) -> float:
    """Return the time, s, from which the robot stays within 0.05 m of the end; NaN: never."""
    away = ~(np.hypot(*(run.pose - run.target[-1])[:, :2].T) <= ARRIVED)
    if away[-1]:
        return float("nan")
    after = np.flatnonzero(away)
    return float(run.t[after[-1] + 1]) if len(after) else 0.0
