"""The motion of the wheels in a log."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.simulation.identification.robot_log import RobotLog


class Odometry:
    """Measured wheel speeds of a log, at instants or as means between samples.

    Attributes:
        at: Samples with a wheel speed; of means without the first one, which begins them.
        speeds: Their wheel speeds, rad/s.
        turned: Angle by which each wheel turned from each sample to the next, rad.
    """

    def __init__(self, log: RobotLog, speeds: Float[Array, "rows wheels"]) -> None:
        rows: Int[Array, " rows"] = np.flatnonzero(~np.isnan(speeds).any(axis=1))
        self._t, self._rows, self._means = log.t, rows, log.mean_wheel_speeds
        self.at = rows[1:] if log.mean_wheel_speeds else rows
        self.speeds = speeds[self.at]
        t, known = log.t[rows], speeds[rows]
        means = known[1:] if log.mean_wheel_speeds else 0.5 * (known[1:] + known[:-1])
        angles = np.vstack([np.zeros(speeds.shape[1]), np.cumsum(np.diff(t)[:, None] * means, 0)])
        sampled = [np.interp(log.t, t, column) for column in angles.T]
        self.turned: Float[Array, "intervals wheels"] = np.diff(np.column_stack(sampled), axis=0)

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
        means: Float[Array, "measured wheels"] = (
            np.diff(path, axis=0) / np.diff(self._t[self._rows])[:, None]
        ) @ jacobian.T
        return means
