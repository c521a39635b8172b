"""Body motion in one interval: prediction, and correction with wheels and gyro."""

from __future__ import annotations

from math import isfinite

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.estimation.pose_filter.contact_offsets import COMPONENTS
from omnidrive.estimation.pose_filter.filter_state import GYRO_BIAS, POSE, SIZE, FilterState
from omnidrive.estimation.pose_filter.matrices import correct_covariance, inverse
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry
from omnidrive.estimation.pose_filter.se2 import compose, exponential

MIN_VARIANCE = 1e-12
"""Variance added to every measured displacement (m^2) or rotation (rad^2)."""


@compiled
def predict_motion(
    joint: Float[Array, "size_and_3 size_and_3"], state: FilterState, model: MotionModel, dt: float
) -> Float[Array, " 3"]:
    """Return the body motion at the last velocity; set its variances in ``joint`` in place.

    Its deviation is due to the largest expected acceleration.
    """
    motion, first = np.zeros(3), len(joint) - 3
    for a in range(3):
        # deviations of successive unobserved intervals are correlated: they add up, not their
        # squares
        before = 0.5 * model.max_acceleration[a] * state.unobserved_time**2
        now = model.max_acceleration[a] * dt * (state.unobserved_time + dt)
        joint[first + a, first + a] = now * now + 2.0 * before * now
        motion[a] = state.velocity[a] * dt
    return motion


@compiled
def _correct_once(  # noqa: PLR0917
    mean: Float[Array, " size"],
    joint: Float[Array, "size_and_3 size_and_3"],
    motion: Float[Array, " 3"],
    observation: Float[Array, " size_and_3"],
    innovation: float,
    variance: float,
    by_rounding: Float[Array, "size_and_3 wheels"],
) -> Float[Array, " size_and_3"]:
    """Correct ``mean``, ``motion`` and their joint covariance in place; return the gain.

    The derivatives ``by_rounding`` of their errors are changed likewise.
    """
    size, total = len(mean), variance
    gain = np.zeros(size + 3)
    for j in range(size + 3):
        if observation[j] != 0.0:
            for i in range(size + 3):
                gain[i] += observation[j] * joint[j, i]
    for i in range(size + 3):
        total += observation[i] * gain[i]
    for i in range(size + 3):
        gain[i] /= total
    correct_covariance(joint, observation, gain, variance)
    for k in range(by_rounding.shape[1]):
        error = 0.0
        for j in range(size + 3):
            if observation[j] != 0.0:
                error += observation[j] * by_rounding[j, k]
        for i in range(size + 3):
            by_rounding[i, k] -= gain[i] * error
    mean[POSE] = compose(mean[POSE], exponential(gain[POSE] * innovation))
    for i in range(POSE.stop, size):
        mean[i] += gain[i] * innovation
    for a in range(3):
        motion[a] += gain[size + a] * innovation
    return gain


@compiled
def correct_with_wheels(  # noqa: PLR0917
    mean: Float[Array, " size"],
    joint: Float[Array, "size_and_3 size_and_3"],
    motion: Float[Array, " 3"],
    odometry: Odometry,
    jacobian: Float[Array, "wheels 3"],
    slip: Float[Array, " wheels"],
    variances: Float[Array, " wheels"],
    by_offset: Float[Array, "wheels components"],
    rounding: float,
    by_rounding: Float[Array, "size_and_3 wheels"],
) -> bool:
    """Correct with all wheel displacements in place; return whether the motion is fully observed.

    A contact that is displaced along its axle by an offset o changes the rim's displacement by o
    times the rotation: its lever arm is longer by o. It is fully observed if wheels and gyro
    together determine all three components.

    Args:
        mean: State vector, with the offsets at the start of the interval.
        joint: Covariance of state vector and body motion.
        motion: Body motion.
        odometry: Wheel displacements.
        jacobian: Rim speeds per unit of body twist at the offsets in ``mean``.
        slip: Predicted slip of each rim, m.
        variances: Variance of each displacement, m^2.
        by_offset: Derivatives of each displacement by the wheel's components of the offset: the
            rotation in the interval (rad) times their weights in the mean offset.
        rounding: Variance of the roundings of a displacement to whole counts, m^2.
        by_rounding: Derivatives of the errors of state vector and motion by these roundings; zero
            before the correction.
    """
    size, information = len(mean), np.zeros((3, 3))
    expected = mean.copy()
    if isfinite(odometry.yaw_rate):
        information[2, 2] = 1.0
    for i in range(len(odometry.displacements)):
        if isfinite(odometry.displacements[i]):
            observation = np.zeros(size + 3)
            innovation = odometry.displacements[i] - slip[i]
            for a in range(3):
                innovation -= jacobian[i, a] * motion[a]
                observation[size + a] = jacobian[i, a]
                for b in range(3):
                    information[a, b] += jacobian[i, a] * jacobian[i, b]
            if size > SIZE:
                for a in range(COMPONENTS):
                    k = SIZE + COMPONENTS * i + a
                    innovation -= by_offset[i, a] * (mean[k] - expected[k])
                    observation[k] = by_offset[i, a]
            variance = variances[i] + rounding
            gain = _correct_once(
                mean, joint, motion, observation, innovation, variance, by_rounding
            )
            by_rounding[:, i] -= gain
    _, determinant = inverse(information)
    return determinant > 1e-6


@inlined
def remove_roundings(
    joint: Float[Array, "size_and_3 size_and_3"],
    by_rounding: Float[Array, "size_and_3 wheels"],
    rounding: float,
) -> None:
    """Remove the covariance by roundings in place, except that of the contacts' offsets.

    The next interval cancels them, so that they do not accumulate in the pose nor in the gyro's
    bias, which follow from sums of displacements. On the offsets, which oscillate, they act as
    white noise.
    """
    size = len(joint) - 3
    for i in range(len(joint)):
        for j in range(i + 1):
            if not (j >= SIZE and i < size):
                for k in range(by_rounding.shape[1]):
                    joint[i, j] -= rounding * by_rounding[i, k] * by_rounding[j, k]
                joint[j, i] = joint[i, j]


@compiled
def correct_with_gyro(  # noqa: PLR0917
    mean: Float[Array, " size"],
    joint: Float[Array, "size_and_3 size_and_3"],
    motion: Float[Array, " 3"],
    odometry: Odometry,
    model: MotionModel,
    by_rounding: Float[Array, "size_and_3 wheels"],
) -> None:
    """Correct in place with the gyro, which measures the motion's rotation plus its own bias."""
    dt = odometry.duration
    observation = np.zeros(len(joint))
    observation[len(mean) + 2], observation[GYRO_BIAS] = 1.0, dt
    innovation = odometry.yaw_rate * dt - motion[2] - mean[GYRO_BIAS] * dt
    variance = model.gyro_noise**2 * dt + MIN_VARIANCE
    _correct_once(mean, joint, motion, observation, innovation, variance, by_rounding)
