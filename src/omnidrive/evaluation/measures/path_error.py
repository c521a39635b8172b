"""Distance of a robot to the path of its reference, and how late it is there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline

from omnidrive.arrays import Array
from omnidrive.evaluation.measures.nearest_point import EARLY, SAME, find_nearest
from omnidrive.geometry import wrap
from omnidrive.simulation import Run

_POINTS = 10
"""Points on the path per sample of the log."""
_AHEAD, _BEHIND = 1.0, 0.5
"""Time, s, along the reference in which the nearest point is searched, from the one before."""
_LARGEST = 1e9
"""Largest time, s, and coordinate, m or rad, of targets, so that their spline is finite."""
ARRIVED = 0.05
"""Distance from the end of the reference, m, within which a robot has arrived."""


class PathErrors(NamedTuple):
    """Errors of each sample of a run, or of each of several runs, at the nearest point of the path.

    The last dimension is that of the samples.
    """

    position: Float[Array, "*runs rows"]
    """Distance, m."""
    heading: Float[Array, "*runs rows"]
    """Absolute difference of the headings there, wrapped, rad."""
    delay: Float[Array, "*runs rows"]
    """Time since the reference was there, s; negative: the robot is ahead of it."""


def path_errors(run: Run) -> PathErrors:
    """Return the errors of a run with respect to the path of its reference, not to its timing.

    The path is the cubic spline through the logged targets. The nearest point is searched
    near that of the sample before, so that the branch of a path that crosses itself is the one that
    the robot follows. Of equal points, where the reference stands, it is the latest one that the
    reference has reached.
    """
    path = _Path.of(run.t, run.target)
    if path is None:
        return _errors_without_path(run.t, run.pose, run.target)
    return path.errors(run.pose, path.nearest(run.pose))


def path_errors_of(
    t: Float[Array, " rows"], poses: Float[Array, "runs rows 3"], target: Float[Array, "rows 3"]
) -> PathErrors:
    """Return the errors of many runs on one reference, as :func:`path_errors` of each.

    Args:
        t: Times of the samples, s.
        poses: True poses; m, m, rad.
        target: Poses of the reference.
    """
    path = _Path.of(t, target)
    if path is None:
        return _errors_without_path(t, poses, target)
    nearest = np.zeros(poses.shape[:2], np.int64)
    xs, ys, _ = np.ascontiguousarray(path.points.T)
    poses = np.ascontiguousarray(poses)
    find_nearest(path.times, xs, ys, t, poses, path.behind, path.ahead, nearest)
    return path.errors(poses, nearest)


class _Path(NamedTuple):
    """The path through the targets of a run."""

    t: Float[Array, " rows"]
    """Times of the targets, s."""
    curve: CubicSpline
    times: Float[Array, " points"]
    """Times of the points, s."""
    points: Float[Array, "points 3"]
    """Points of the curve; m, m, rad, unwrapped."""

    @classmethod
    def of(cls, t: Float[Array, " rows"], target: Float[Array, "rows 3"]) -> _Path | None:
        """Return the path; None if there is only one target, or a value beyond :data:`_LARGEST`."""
        unwrapped = np.column_stack([target[:, :2], np.unwrap(target[:, 2])])
        largest = max(np.abs(unwrapped).max(), np.abs(t).max())
        if len(t) < 2 or not largest <= _LARGEST:  # nor if one is NaN
            return None
        curve = CubicSpline(t, unwrapped)
        times = np.linspace(t[0], t[-1], _POINTS * (len(t) - 1) + 1)
        return cls(t, curve, times, curve(times))

    @property
    def step(self) -> float:
        """Time between two points, s."""
        return float(self.times[1] - self.times[0])

    @property
    def behind(self) -> int:
        """Number of points that are searched behind the last one."""
        return round(_BEHIND / self.step)

    @property
    def ahead(self) -> int:
        """Number of points that are searched ahead of the last one."""
        return round(_AHEAD / self.step)

    def nearest(self, pose: Float[Array, "rows 3"]) -> Int[Array, " rows"]:
        """Return the index of the nearest point for each sample of a run.

        As :func:`~omnidrive.evaluation.measures.nearest_point.find_nearest`, without
        its compilation.
        """
        behind, ahead = self.behind, self.ahead
        nearest, at = np.zeros(len(pose), dtype=np.int64), 0
        for k, (x, y) in enumerate(pose[:, :2].tolist()):
            start = max(at - behind, 0)
            near = self.points[start : at + ahead + 1]
            distance = np.hypot(near[:, 0] - x, near[:, 1] - y)
            equal = start + np.flatnonzero(distance <= distance.min() + SAME)
            past = int(np.searchsorted(self.times[equal], self.t[k] + EARLY))
            at = int(equal[max(past - 1, 0)])
            nearest[k] = at
        return nearest

    def errors(
        self, pose: Float[Array, "*runs rows 3"], nearest: Int[Array, "*runs rows"]
    ) -> PathErrors:
        """Return the errors at the points of the curve that are nearest to ``nearest``."""
        t, step = self.t, self.step
        velocity = self.curve(self.times[nearest], 1)[..., :2]
        along = ((pose - self.points[nearest])[..., :2] * velocity).sum(axis=-1)
        square = np.maximum((velocity**2).sum(axis=-1), SAME)
        reached = np.clip(self.times[nearest] + np.clip(along / square, -step, step), t[0], t[-1])
        away = pose - self.curve(reached)
        return PathErrors(
            np.hypot(away[..., 0], away[..., 1]), np.abs(wrap(away[..., 2])), t - reached
        )


def _errors_without_path(t: Array, pose: Array, target: Array) -> PathErrors:
    """Return the errors with respect to the targets."""
    away = pose - target
    distance = np.hypot(away[..., 0], away[..., 1])
    return PathErrors(distance, np.abs(wrap(away[..., 2])), 0.0 * t + 0.0 * distance)


def arrival(run: Run) -> float:
    """Return the time, s, from which the robot stays within 0.05 m of the end; NaN: never."""
    return arrivals(run.t, run.pose[None], run.target)[0]


def arrivals(
    t: Float[Array, " rows"], poses: Float[Array, "runs rows 3"], target: Float[Array, "rows 3"]
) -> list[float]:
    """Return the time of :func:`arrival` of each run; arguments as of :func:`path_errors_of`."""
    away = poses - target[-1]
    is_away = ~(np.hypot(away[..., 0], away[..., 1]) <= ARRIVED)
    return [_arrival(t, each) for each in is_away]


def _arrival(t: Float[Array, " rows"], is_away: Bool[Array, " rows"]) -> float:
    if is_away[-1]:
        return float("nan")
    after = np.flatnonzero(is_away)
    return float(t[after[-1] + 1]) if len(after) else 0.0
