"""The state estimate that controllers and supervisors receive."""

from __future__ import annotations

from math import hypot, isfinite, nan, sqrt
from numbers import Real
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import kind_of
from omnidrive.geometry import BodyTwist, Pose

LARGEST = 1e10
"""Greatest magnitude of a usable time (s), coordinate (m) or angle (rad).

At 1e10, neighbouring floats differ by 2e-6."""


def are_usable(t: float, pose: Pose) -> bool:
    """Return whether a time (s) and a pose are numbers up to :data:`LARGEST`: not NaN, not huge."""
    x, y, yaw = pose
    return bool(  # comparisons of numbers of NumPy give its own type
        -LARGEST <= t <= LARGEST
        and -LARGEST <= x <= LARGEST
        and -LARGEST <= y <= LARGEST
        and -LARGEST <= yaw <= LARGEST
    )


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
    notice: str = ""
    """What happened to the estimate at this sample, in one line, such as a lost pose; mostly
    empty."""

    @property
    def is_usable(self) -> bool:
        """Whether stamp, pose and age are usable (:func:`are_usable`) and the covariance is finite.

        A state that is not usable is no estimate. Its twist is not checked.
        """
        return (
            are_usable(self.stamp, self.pose)
            and -LARGEST <= self.fix_age <= LARGEST
            and (self.covariance is None or isfinite(sum(self.covariance.ravel().tolist())))
        )

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
    """Return what is wrong with the result of an estimator, in one line; None: nothing.

    Numbers that are not usable are no fault, see :attr:`State.is_usable`.
    """
    if not isinstance(state, State):
        return f"it returned {kind_of(state)}, not a State"
    if not isinstance(state.notice, str):
        return f"the notice of its state is {kind_of(state.notice)}, not text"
    pose, twist, covariance = state.pose, state.twist, state.covariance
    if not isinstance(pose, Pose):
        return f"its state holds {kind_of(pose)}, not a Pose"
    if not (twist is None or isinstance(twist, BodyTwist)):
        return f"the twist of its state is {kind_of(twist)}, not a BodyTwist or None"
    for value in (state.stamp, *pose, *(twist or ()), state.fix_age):
        if type(value) is not float and not isinstance(value, Real):
            return f"its state holds {kind_of(value)} where a number is expected"
    return _covariance_fault(covariance)


def _covariance_fault(covariance: object) -> str | None:
    """Return what is wrong with a covariance, in one line; None: nothing."""
    given = kind_of(covariance)
    if isinstance(covariance, np.ndarray):
        given += f" of shape {covariance.shape}"
        if covariance.shape == (3, 3) and covariance.dtype.kind in "fiu":
            return None
    elif covariance is None:
        return None
    return f"the covariance of its state is {given}, not a 3 x 3 array of numbers or None"
