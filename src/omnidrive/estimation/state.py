"""The state estimate that controllers and supervisors receive."""

from __future__ import annotations

from math import hypot, nan, sqrt
from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import kind_of
from omnidrive.geometry import BodyTwist, Pose


class State(NamedTuple):
    """Estimate of the robot's motion at one instant; unknown parts are None."""

    stamp: float
    """Time at which the estimate holds, s."""
    pose: Pose
    """Pose of B in W; m, m, rad. The yaw is continuous, not wrapped."""
    twist: BodyTwist | None = None
    """Velocity of B in B; m/s, m/s, rad/s. None if it is not estimated."""
    covariance: Float[Array, "3 3"] | None = None
    """Covariance of the pose error (x, y, yaw) in B; m^2, m rad, rad^2. None if it is unknown."""
    fix_age: float = 0.0
    """Time since the stamp of the last accepted pose fix, s."""

    @property
    def position_sigma(self) -> float:
        """Standard deviation of the position along its least certain direction, m; NaN if unknown.

        The square root of the larger eigenvalue of the position's covariance.
        """
        if self.covariance is None:
            return nan
        (xx, xy, _), (_, yy, _), _ = self.covariance.tolist()
        return sqrt(max(0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy), 0.0))

    @property
    def yaw_sigma(self) -> float:
        """Standard deviation of the yaw, rad; NaN if unknown."""
        return nan if self.covariance is None else sqrt(max(float(self.covariance[2, 2]), 0.0))


def state_fault(state: object) -> str | None:
    """Return what is wrong with the result of an estimator, in one line; None: nothing."""
    if not isinstance(state, State):
        return f"it returned {kind_of(state)}, not a State"
    if not isinstance(state.pose, Pose):
        return f"its state holds {kind_of(state.pose)}, not a Pose"
    return None
