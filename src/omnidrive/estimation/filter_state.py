"""What is believed at one instant: a Gaussian over the pose and what disturbs its sensors."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array

POSE, GYRO, BIAS, RATE = slice(0, 3), 3, slice(4, 7), slice(7, 10)
"""Where in the vectors: the pose (m, m, rad), the gyro's bias (rad/s), the fixes' bias (m, m, rad
in W) and its rate of change (per second)."""
SIZE = 10


class FilterState(NamedTuple):
    """Mean and covariance, and what is remembered of how the robot moved.

    Errors of the pose are motions in the frame of the robot, ``true = mean o Exp(error)``: left
    invariant (Barrau & Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE
    TAC 62, 2017). They propagate by the measured motion alone, however wrong the mean is, and
    fixes of the pose measure them directly. All other errors are differences.
    """

    mean: Float[Array, " 10"]
    covariance: Float[Array, "10 10"]
    velocity: Float[Array, " 3"]
    """Twist of B at this instant, in B: m/s, m/s, rad/s."""
    slip: float
    """Speed by which rims slip otherwise than expected, in m/s."""
    blind: float
    """For how long wheels and gyro have not told the whole motion, in s."""
