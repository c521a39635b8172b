"""Noise of the measured poses, estimated from the innovations of the motion observer."""

from __future__ import annotations

from math import sqrt
from typing import Any

from omnidrive.compiled import compiled
from omnidrive.robot.drive_model import DriveModel, axis_unit
from omnidrive.robot.slip import Vector

NOISY = 2e-3
"""Standard deviation of a measured position from which on poses are noisy, m."""
_MIN_VARIANCE = 1e-12
"""Least variance of a measured position, m^2."""
_EXPECTED = 0.01
"""Standard deviation of a measured position that is not surprising without evidence, m."""
_LARGEST = 4.0
"""Largest difference of two poses that counts as noise, in standard deviations."""
_NOISE_MEMORY = 30
"""Number of samples over which the variance of the noise is averaged."""


@compiled
def estimate_noise(model: DriveModel, state: Any, innovation: Vector) -> None:
    """Update the variance of the noise by the covariance of consecutive differences.

    White noise n of the poses adds n_k - n_{k-1} to a measured displacement, so that consecutive
    differences from the predicted displacement have the covariance -E[n^2]; errors of the model,
    which last for many samples, give a positive one (Mehra, "On the identification of variances and
    adaptive Kalman filtering", IEEE Trans. Autom. Control 15, 1970). A difference counts up to four
    standard deviations of the noise known so far, so that single outliers are no noise (Huber,
    "Robust estimation of a location parameter", Ann. Math. Statist. 35, 1964).
    """
    noise = state.noise
    difference, residual = noise.difference, noise.residual
    limit = _largest_difference(model, noise.position_variance, 0)
    yaw_limit = _largest_difference(model, noise.yaw_variance, 2)
    x = min(max(innovation[0] - residual[0], -limit), limit)
    y = min(max(innovation[1] - residual[1], -limit), limit)
    yaw = min(max(innovation[2] - residual[2], -yaw_limit), yaw_limit)
    noise.measurements += 1
    share = 1.0 / min(noise.measurements, _NOISE_MEMORY)
    by_position = -0.5 * (x * difference[0] + y * difference[1])
    noise.position_variance += share * (by_position - noise.position_variance)
    noise.yaw_variance += share * (-yaw * difference[2] - noise.yaw_variance)
    difference[0], difference[1], difference[2] = x, y, yaw


@compiled
def position_variance(state: Any) -> float:
    """Return the estimated variance of a measured position, m^2; not negative."""
    return max(float(state.noise.position_variance), 0.0)


@compiled
def axis_variance(state: Any, axis: int) -> float:
    """Return the estimated variance of a measured x, y (m^2) or yaw (rad^2); not negative."""
    return max(float(state.noise.yaw_variance), 0.0) if axis == 2 else position_variance(state)


@compiled
def _largest_difference(model: DriveModel, variance: float, axis: int) -> float:
    """Return the difference of two poses, m or rad, up to which it counts as noise."""
    little = _EXPECTED * axis_unit(model, axis)
    return _LARGEST * sqrt(max(variance, 0.0) + little * little)


@compiled
def noisy_share(model: DriveModel, state: Any, axis: int) -> float:
    """Return 0 for exact poses to 1 for noise well above :data:`NOISY`, by the estimated noise."""
    variance = axis_variance(state, axis)
    ratio = variance / (NOISY * axis_unit(model, axis)) ** 2
    return float(1.0 - 1.0 / (1.0 + ratio * ratio))


@compiled
def pose_variance(model: DriveModel, state: Any, variances: Vector, axis: int) -> float:
    """Return the variance of a measured displacement, which is estimated if it is not known."""
    variance = variances[axis]
    if variance < 0.0:
        variance = axis_variance(state, axis)
    return variance + _MIN_VARIANCE * axis_unit(model, axis) ** 2
