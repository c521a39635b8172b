"""The state estimate that controllers and supervisors receive."""

from __future__ import annotations

from math import hypot, isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput, short_repr
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import are_numbers, is_number, numbers_rule, or_none, record_fault

LARGEST = 1e10
"""Greatest magnitude of a usable time (s), coordinate (m) or angle (rad).

At 1e10, neighbouring floats differ by 2e-6."""


def is_usable_number(number: float) -> bool:
    """Return whether a number is at most :data:`LARGEST` in magnitude: not NaN, not huge."""
    return bool(-LARGEST <= number <= LARGEST)  # NumPy's numbers give a bool of its own


def are_usable(t: float, pose: Pose) -> bool:
    """Return whether a time (s) and all parts of a pose are usable numbers."""
    return all(map(is_usable_number, (t, *pose)))


def check_start(pose: Pose) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` unless the pose at a start is usable."""
    if not (are_numbers(pose) and are_usable(0.0, pose)):
        raise InvalidInput(
            f"the pose at the start must be finite and at most {LARGEST:g} in magnitude, "
            f"got {short_repr(tuple(pose), 100)}"
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
            and is_usable_number(self.fix_age)
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
    return record_fault(state, State, _STATE_RULES)


def _is_covariance(value: object) -> bool:
    return isinstance(value, np.ndarray) and value.shape == (3, 3) and value.dtype.kind in "fiu"


_STATE_RULES = {
    "stamp": (is_number, "a number"),
    "pose": numbers_rule(Pose),
    "twist": or_none(numbers_rule(BodyTwist)),
    "covariance": or_none((_is_covariance, "a 3 x 3 array of numbers")),
    "fix_age": (is_number, "a number"),
    "notice": (lambda notice: isinstance(notice, str), "text"),
}
