"""State of the Kalman filter: mean, covariance and what propagation needs besides them."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array

POSE, GYRO_BIAS, FIX_BIAS, FIX_BIAS_RATE = slice(0, 3), 3, slice(4, 7), slice(7, 10)
"""Indices into the state vector: pose of B in W (m, m, rad), bias of the gyro (rad/s), bias of the
pose fixes (m, m, rad in W) and its rate of change (per second)."""
CORNERING = 10
"""Index of the slip speed of the robot per centripetal acceleration, s."""
SIZE = 11
"""Number of these components. If the wheels' contacts move, four more follow for each wheel, m: the
fundamental of the offset of the contact along the axle, outwards, its derivative by its phase, and
the same of the strongest harmonic."""


class FilterState(NamedTuple):
    """Gaussian of the state vector at one instant, with velocity and slip.

    The error of the pose is a motion in B, ``true = mean o Exp(error)``: left-invariant (Barrau &
    Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE TAC 62, 2017). Its
    propagation depends on the measured motion only, not on the mean, and pose fixes measure it
    directly. All other errors are differences, true minus mean.
    """

    mean: Float[Array, " size"]
    """State vector; see :data:`POSE`, :data:`GYRO_BIAS`, :data:`FIX_BIAS`,
    :data:`FIX_BIAS_RATE`, :data:`CORNERING`, :data:`SIZE`."""
    covariance: Float[Array, "size size"]
    """Covariance of its error, in the same units."""
    velocity: Float[Array, " 3"]
    """Twist of B in B; m/s, m/s, rad/s."""
    excess_slip: float
    """Slip speed of the wheel rims beyond the predicted slip, m/s; not negative."""
    unobserved_time: float
    """Time for which wheels and gyro together have not measured the whole twist, s."""
    fix_scale: float
    """Estimated ratio of the fixes' covariance to the stated one."""
    fix_count: float
    """Number of fixes with the information of this estimate."""
