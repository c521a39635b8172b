"""The poses measured in a log, which may be rarer than its samples."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.simulation.identification.regression import segments_of, without_means
from omnidrive.simulation.identification.robot_log import RobotLog

_SEGMENT = 1.0  # s
_MIN_FIXES = 5  # in a segment, in the median


class Fixes:
    """Measured poses of a log, and its segments.

    Attributes:
        at: Samples with a pose.
        length: Least length of a segment, s: one second, or five times that between poses.
        segments: Segment of each sample.
        counts: Number of poses in each segment.
        positions: Measured positions without the mean of each segment, m.
        yaws: Measured yaw without the mean of each segment, rad.
    """

    def __init__(self, log: RobotLog) -> None:
        self.at: Int[Array, " fixes"] = np.flatnonzero(log.measured)
        self.length = max(_SEGMENT, _MIN_FIXES * float(np.median(np.diff(log.t[self.at]))))
        self.segments = segments_of(log.t, self.length)
        self.counts = np.bincount(self.segments[self.at], minlength=int(self.segments[-1]) + 1)
        turns = np.diff(log.t) * np.nan_to_num(log.commands[:-1, 2])
        commanded = np.concatenate([[0.0], np.cumsum(turns)])[self.at]
        self._t = log.t
        self._yaw = commanded + np.unwrap(log.poses[self.at, 2] - commanded)
        self.positions = without_means(log.poses[self.at, :2], self.segments[self.at])
        self.yaws = without_means(self._yaw[:, None], self.segments[self.at])

    def yaw(self, turned: Float[Array, " rows"]) -> Float[Array, " rows"]:
        """Return the yaw at each sample, rad: the measured one where there is one.

        Between measurements it is the predicted yaw plus its errors at the measurements before and
        after, linearly interpolated.

        Args:
            turned: Predicted yaw, up to a constant, rad.
        """
        errors = self._yaw - turned[self.at]
        yaw: Float[Array, " rows"] = turned + np.interp(self._t, self._t[self.at], errors)
        return yaw

    def centred(self, path: Float[Array, "rows columns"]) -> Float[Array, "fixes columns"]:
        """Return a path at the samples with a pose, without the mean of each segment."""
        return without_means(path[self.at], self.segments[self.at])
