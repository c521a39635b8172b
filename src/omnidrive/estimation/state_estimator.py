"""The interface of state estimators, and an estimator without a filter."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite, pi
from typing import Protocol, runtime_checkable

import numpy as np

from omnidrive.estimation.readings import PoseFix, SensorReadings
from omnidrive.estimation.state import State
from omnidrive.geometry import Pose


@runtime_checkable
class StateEstimator(Protocol):
    """A state estimator, updated with the sensor readings of every sample.

    ``reset`` and then any number of ``update`` calls is one run.
    """

    def reset(self, pose: Pose) -> None:
        """Discard all readings; at time 0 the robot is at rest at ``pose``, known exactly."""
        ...

    def update(self, readings: SensorReadings) -> State:
        """Return the estimated state at ``readings.stamp``; stamps must not decrease."""
        ...


@dataclass(slots=True)
class LatestFix:
    """An estimator that returns the pose fix with the latest stamp; it has no filter."""

    _latest: PoseFix = field(default=PoseFix(0.0, Pose(0.0, 0.0, 0.0), 0.0, 0.0), init=False)

    def reset(self, pose: Pose) -> None:
        """Take ``pose`` as an exact fix at time 0, returned until a fix arrives."""
        self._latest = PoseFix(0.0, pose, 0.0, 0.0)

    def update(self, readings: SensorReadings) -> State:
        """Return the fix with the latest stamp; whole turns are added to its yaw for continuity.

        The covariance is None unless the fix states finite standard deviations of both position
        and yaw. The twist is None.
        """
        for fix in readings.fixes:
            if fix.stamp >= self._latest.stamp:
                before, yaw = self._latest.pose.yaw, fix.pose.yaw
                if isfinite(yaw) and isfinite(before):
                    yaw += 2.0 * pi * round((before - yaw) / (2.0 * pi))
                self._latest = fix._replace(pose=fix.pose._replace(yaw=yaw))
        stamp, pose, position_sigma, yaw_sigma = self._latest
        covariance = None
        if isfinite(position_sigma) and isfinite(yaw_sigma):
            covariance = np.diag([position_sigma**2, position_sigma**2, yaw_sigma**2])
        return State(readings.stamp, pose, None, covariance, readings.stamp - stamp)
