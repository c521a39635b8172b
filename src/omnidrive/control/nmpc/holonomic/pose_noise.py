"""Noise of the measured poses, estimated from the innovations of the motion observer."""

from __future__ import annotations

from math import sqrt

from omnidrive.compiled import compiled
from omnidrive.control.nmpc.holonomic.motion_memory import MotionMemory
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
_NOISE_MEMORY = 30.0
"""Number of samples over which the variance of the noise is averaged."""


@compiled
def estimate_noise(model: DriveModel, memory: MotionMemory, innovation: Vector) -> None:
    """Update the variance of the noise by the covariance of consecutive differences.

    White noise n of the poses adds n_k - n_{k-1} to a measured displacement, so that consecutive
    differences from the predicted displacement have the covariance -E[n^2]; errors of the model,
    which last for many samples, give a positive one (Mehra, "On the identification of variances and
    adaptive Kalman filtering", IEEE Trans. Autom. Control 15, 1970). A difference counts up to four
    standard deviations of the noise known so far, so that single outliers are no noise (Huber,
    "Robust estimation of a location parameter", Ann. Math. Statist. 35, 1964).
    """
    noise = memory.noise
    most = _largest_difference(model, noise[0], 0)
    max_yaw = _largest_difference(model, noise[1], 2)
    x = min(max(innovation[0] - noise[5], -most), most)
    y = min(max(innovation[1] - noise[6], -most), most)
    yaw = min(max(innovation[2] - noise[7], -max_yaw), max_yaw)
    noise[8] += 1.0
    share = 1.0 / min(noise[8], _NOISE_MEMORY)
    noise[0] += share * (-0.5 * (x * noise[2] + y * noise[3]) - noise[0])
    noise[1] += share * (-yaw * noise[4] - noise[1])
    noise[2], noise[3], noise[4] = x, y, yaw


@compiled
def _largest_difference(model: DriveModel, variance: float, axis: int) -> float:
    """Return the difference of two poses, m or rad, up to which it counts as noise."""
    little = _EXPECTED * axis_unit(model, axis)
    return _LARGEST * sqrt(max(variance, 0.0) + little * little)


@compiled
def noisy_share(model: DriveModel, memory: MotionMemory, axis: int) -> float:
    """Return 0 for exact poses to 1 for noise well above :data:`NOISY`, by the estimated noise."""
    variance = max(memory.noise[1] if axis == 2 else memory.noise[0], 0.0)
    ratio = variance / (NOISY * axis_unit(model, axis)) ** 2
    return float(1.0 - 1.0 / (1.0 + ratio * ratio))


@compiled
def pose_variance(model: DriveModel, memory: MotionMemory, variances: Vector, axis: int) -> float:
    """Return the variance of a measured displacement, which is estimated if it is not known."""
    variance = variances[axis]
    if variance < 0.0:
        variance = max(memory.noise[1] if axis == 2 else memory.noise[0], 0.0)
    return variance + _MIN_VARIANCE * axis_unit(model, axis) ** 2
