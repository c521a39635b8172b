"""The interface of state estimators, and an estimator without a filter."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import Protocol, runtime_checkable

import numpy as np

from omnidrive.estimation.clock import ReadingClock, Stamp
from omnidrive.estimation.plausibility import usable_fixes
from omnidrive.estimation.readings import PoseFix, SensorReadings, unwrapped_pose
from omnidrive.estimation.state import State, check_start
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
        """Return the estimated state at ``readings.stamp``.

        Stamps increase unless the clock of the sensors is at fault.
        """
        ...


@dataclass(slots=True)
class LatestFix:
    """An estimator that returns the pose fix with the latest stamp; it has no filter.

    Fixes that are not usable or from the future are ignored, so that the estimate grows old.
    """

    _latest: PoseFix = field(default=PoseFix(0.0, Pose(0.0, 0.0, 0.0), 0.0, 0.0), init=False)
    _clock: ReadingClock = field(default_factory=ReadingClock, init=False)

    def reset(self, pose: Pose) -> None:
        """Take ``pose`` as an exact fix at time 0, returned until a fix arrives.

        Raises:
            InvalidInput: ``pose`` is not usable.
        """
        check_start(pose)
        self._latest = PoseFix(0.0, pose, 0.0, 0.0)
        self._clock.reset()

    def update(self, readings: SensorReadings) -> State:
        """Return the fix with the latest stamp; whole turns are added to its yaw for continuity.

        A yaw that a fix does not measure is that of the fix before. The covariance is None unless
        the fix states finite standard deviations of both position and yaw. The twist is None.

        Readings with a time that is not finite or earlier than the last one are ignored; a second
        such time in a row, in order with the first, is a jump of the clock.
        """
        before, t, notice = self._clock.time, readings.stamp, ""
        stamp = self._clock.advance(t)
        if stamp is Stamp.JUMPED and before is not None:
            notice = f"the clock jumped by {t - before:+g} s"
            age = before - self._latest.stamp
            self._latest = self._latest._replace(stamp=t - age)
        if stamp is not Stamp.DROPPED:
            for fix in usable_fixes(readings.fixes, t):
                if fix.stamp >= self._latest.stamp:
                    self._latest = fix._replace(pose=unwrapped_pose(fix, self._latest.pose.yaw))
        now = self._clock.time or 0.0
        _, pose, position_sigma, yaw_sigma = self._latest
        covariance = None
        if isfinite(position_sigma) and isfinite(yaw_sigma):
            covariance = np.diag([position_sigma**2, position_sigma**2, yaw_sigma**2])
        return State(now, pose, None, covariance, now - self._latest.stamp, notice)
