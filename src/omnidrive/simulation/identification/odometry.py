"""The motion of the wheels in a log."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.simulation.identification.robot_log import RobotLog

_MAX_GAP = 0.1  # s, between wheel speeds: the motion between them is interpolated
_MAX_ROWS_GAP = 2.5  # of the median time between wheel speeds, if that is longer


class Odometry:
    """Measured wheel speeds of a log, at instants or as means between samples.

    Attributes:
        at: Samples with a wheel speed; of means those over at most :attr:`longest`.
        longest: Longest time between wheel speeds over which the motion is interpolated, s.
        speeds: Their wheel speeds, rad/s.
        turned: Angle by which each wheel turned from each sample to the next, rad.
    """

    def __init__(self, log: RobotLog, speeds: Float[Array, "rows wheels"]) -> None:
        rows: Int[Array, " rows"] = np.flatnonzero(~np.isnan(speeds).any(axis=1))
        self._t, self._rows, self._means = log.t, rows, log.mean_wheel_speeds
        t, measured = log.t[rows], speeds[rows]
        self.longest = max(_MAX_GAP, _MAX_ROWS_GAP * float(np.median(np.diff(t))))
        self._close: Bool[Array, " gaps"] = np.diff(t) <= self.longest
        self.at = rows[1:][self._close] if log.mean_wheel_speeds else rows
        self.speeds = speeds[self.at]
        gap = np.searchsorted(rows, np.arange(len(log.t) - 1), side="right")
        self._known: Bool[Array, " intervals"] = np.r_[False, self._close, False][gap]
        means = measured[1:] if log.mean_wheel_speeds else 0.5 * (measured[1:] + measured[:-1])
        angles = np.vstack([np.zeros(speeds.shape[1]), np.cumsum(np.diff(t)[:, None] * means, 0)])
        sampled = [np.interp(log.t, t, column) for column in angles.T]
        self.turned: Float[Array, "intervals wheels"] = np.diff(np.column_stack(sampled), axis=0)

    def complete(self, segments: Int[Array, " rows"]) -> Bool[Array, " segments"]:
        """Return in which segments, of each sample, the motion of the wheels is known throughout.

        It is not in a longer time between wheel speeds than :attr:`longest`, nor before the first
        and after the last ones.
        """
        found: Bool[Array, " segments"] = np.ones(int(segments[-1]) + 1, dtype=bool)
        inside = segments[1:] == segments[:-1]
        found[segments[:-1][inside & ~self._known]] = False
        return found

    def predicted(
        self,
        twists: Float[Array, "rows 3"],
        moves: Float[Array, "rows 3"],
        jacobian: Float[Array, "wheels 3"],
    ) -> Float[Array, "measured wheels"]:
        """Return the wheel speeds of a response where they are measured, rad/s.

        Args:
            twists: Twist at each sample.
            moves: Displacement from each sample to the next, in B at its start; m, m, rad.
            jacobian: From body twist to wheel speeds.
        """
        if not self._means:
            instants: Float[Array, "measured wheels"] = twists[self.at] @ jacobian.T
            return instants
        half = 0.5 * moves[:-1, 2]  # a constant twist moves B along the bearing at half the turn
        c, s = np.cos(half), np.sin(half)
        x, y = moves[:-1, 0], moves[:-1, 1]
        parts = np.column_stack([c * x + s * y, c * y - s * x, 2.0 * half])
        parts[:, :2] /= np.sinc(half / np.pi)[:, None]
        path = np.vstack([np.zeros(3), np.cumsum(parts, axis=0)])[self._rows]
        moved, dt = np.diff(path, axis=0)[self._close], np.diff(self._t[self._rows])[self._close]
        means: Float[Array, "measured wheels"] = (moved / dt[:, None]) @ jacobian.T
        return means
