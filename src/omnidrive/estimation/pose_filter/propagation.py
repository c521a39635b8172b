"""Propagation of the filter state by odometry and gyro."""

from __future__ import annotations

from math import exp, isfinite, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.gauss_markov import gauss_markov
from omnidrive.estimation.pose_filter.filter_state import (
    FIX_BIAS,
    FIX_BIAS_RATE,
    GYRO_BIAS,
    POSE,
    SIZE,
    FilterState,
)
from omnidrive.estimation.pose_filter.matrices import congruence, inverse
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry
from omnidrive.estimation.pose_filter.se2 import (
    compose,
    exponential,
    inverse_adjoint,
    right_jacobian,
)
from omnidrive.estimation.pose_filter.slip_prediction import predict_slip

_MOTION = slice(SIZE, SIZE + 3)
"""Indices of the body motion (m, m, rad) in a vector of the filter state and the motion."""
_ROTATION = SIZE + 2
"""Index of its rotation."""
_JOINT_SIZE = SIZE + 3
"""Length of that vector."""
_MAX_SLIP = 50.0
"""Largest excess slip speed, m/s."""
_MAX_UNOBSERVED_TIME = 10.0
"""Largest time without odometry that counts, s: the uncertainty grows linearly from then on."""
_MAX_VARIANCES = (1e6, 1e6, 100.0, 1.0)
"""Largest variances of the pose and of the gyro's bias; m^2, m^2, rad^2, rad^2/s^2. Numbers of very
different sizes would make the covariance indefinite by rounding."""
_SMALL_SHARE = 1e-3
"""Duration over the time constant of the bias below which its process noise is the first term of
its series: the difference of stationary variances would consist of rounding errors."""
_MIN_VARIANCE = 1e-12
"""Variance added to every measured displacement (m^2) or rotation (rad^2)."""


@compiled
def propagate(state: FilterState, odometry: Odometry, model: MotionModel) -> FilterState:
    """Return the filter state at the end of an interval.

    The body motion is estimated by least squares from the wheel displacements without the predicted
    slip. The gyro then corrects the motion's rotation and the gyro's own bias jointly. Finally the
    pose, its covariance and the bias of the pose fixes are propagated along the motion.
    """
    dt = odometry.duration
    if dt <= 0.0:
        return state
    rate = odometry.yaw_rate - state.mean[GYRO_BIAS]
    slip, mean_twist, velocity = predict_slip(state.velocity, odometry, model)
    residual_slip = _excess_slip(odometry, model, rate, slip)
    excess_slip = max(state.excess_slip * exp(-dt / model.slip_memory), residual_slip)
    motion, motion_covariance, observed = _wheel_motion(state, odometry, model, slip, excess_slip)
    mean, joint = state.mean.copy(), np.zeros((_JOINT_SIZE, _JOINT_SIZE))
    joint[:SIZE, :SIZE] = state.covariance
    joint[_MOTION, _MOTION] = motion_covariance
    if isfinite(rate):
        joint = _correct_with_gyro(mean, joint, motion, odometry, model)
    if isfinite(model.friction_limits[0]):
        velocity += motion / dt - mean_twist
    else:
        velocity = motion / dt
    for a in range(3):
        velocity[a] = min(max(velocity[a], -model.max_twist[a]), model.max_twist[a])
    unobserved_time = 0.0 if observed else min(state.unobserved_time + dt, _MAX_UNOBSERVED_TIME)
    propagated = mean.copy()
    covariance = _propagate_covariance(propagated, joint, motion, model, dt)
    propagated[POSE] = compose(mean[POSE], exponential(motion))
    return FilterState(propagated, covariance, velocity, excess_slip, unobserved_time)


@compiled
def _excess_slip(
    odometry: Odometry, model: MotionModel, rate: float, slip: Float[Array, " wheels"]
) -> float:
    """Return the slip speed (m/s) beyond the prediction by which wheels and gyro disagree.

    The body motion is fitted to the displacements by least squares, with the rotation of the gyro
    if it reports one. The result is ``slip_doubt / dt`` times the square root of the mean squared
    residual in excess of four times its nominal variance; zero if the displacements are not
    redundant.
    """
    dt, displacements = odometry.duration, odometry.displacements
    has_gyro = isfinite(rate)
    unknowns = 2 if has_gyro else 3
    normal, right = np.zeros((3, 3)), np.zeros(3)
    known, nominal = 0, 0.0
    for i in range(len(displacements)):
        if isfinite(displacements[i]):
            displacement = (
                displacements[i]
                - slip[i]
                - (model.rim_jacobian[i, 2] * rate * dt if has_gyro else 0.0)
            )
            for a in range(unknowns):
                right[a] += model.rim_jacobian[i, a] * displacement
                for b in range(unknowns):
                    normal[a, b] += model.rim_jacobian[i, a] * model.rim_jacobian[i, b]
            known += 1
            nominal += _displacement_variance(odometry, model, i, slip)
    if known <= unknowns:
        return 0.0
    if has_gyro:
        normal[2, 2] = 1.0
    solver, determinant = inverse(normal)
    if abs(determinant) < 1e-9:
        return 0.0
    motion = np.zeros(3)
    for a in range(3):
        for b in range(3):
            motion[a] += solver[a, b] * right[b]
    if has_gyro:
        motion[2] = rate * dt
    squares = _residual_sum(odometry, model, slip, motion)
    excess = squares / (known - unknowns) - 4.0 * nominal / known
    return min(model.slip_doubt * sqrt(max(excess, 0.0)) / dt, _MAX_SLIP)


@compiled
def _residual_sum(
    odometry: Odometry,
    model: MotionModel,
    slip: Float[Array, " wheels"],
    motion: Float[Array, " 3"],
) -> float:
    """Return the sum of squared residuals (m^2) of the displacements for a body motion."""
    squares = 0.0
    for i in range(len(odometry.displacements)):
        if isfinite(odometry.displacements[i]):
            residual = odometry.displacements[i] - slip[i]
            for a in range(3):
                residual -= model.rim_jacobian[i, a] * motion[a]
            squares += residual * residual
    return squares


@compiled
def _displacement_variance(
    odometry: Odometry, model: MotionModel, i: int, slip: Float[Array, " wheels"]
) -> float:
    """Return the variance (m^2) of a rim's displacement from rounding, creep and predicted slip.

    An interval has two roundings to whole counts. The error of the predicted slip is a share of the
    mean square of all rims, because an error of the predicted body motion changes the slip of every
    rim, also of those that hold.
    """
    rounding: float = model.encoder_resolution**2 / 6.0 * odometry.fraction
    creep = model.creep**2 * abs(odometry.displacements[i])
    slip_variance: float = model.slip_error**2 * (slip**2).mean()
    return float(rounding + creep + slip_variance + _MIN_VARIANCE)


@compiled
def _wheel_motion(
    state: FilterState,
    odometry: Odometry,
    model: MotionModel,
    slip: Float[Array, " wheels"],
    excess_slip: float,
) -> tuple[Float[Array, " 3"], Float[Array, "3 3"], bool]:
    """Return the body motion by the wheels, its covariance, and whether it is fully observed.

    The prior is motion at the last velocity, with a deviation due to the largest expected
    acceleration. It is fully observed if wheels and gyro together determine all three components.
    """
    dt = odometry.duration
    covariance, information, motion = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    for a in range(3):
        # deviations of successive unobserved intervals are correlated: they add up, not their
        # squares
        before = 0.5 * model.max_acceleration[a] * state.unobserved_time**2
        now = model.max_acceleration[a] * dt * (state.unobserved_time + dt)
        covariance[a, a] = now * now + 2.0 * before * now
        motion[a] = state.velocity[a] * dt
    if isfinite(odometry.yaw_rate):
        information[2, 2] = 1.0
    for i in range(len(odometry.displacements)):
        if isfinite(odometry.displacements[i]):  # sequential corrections in Joseph's form
            variance = _displacement_variance(odometry, model, i, slip) + (excess_slip * dt) ** 2
            innovation, total, gain = odometry.displacements[i] - slip[i], variance, np.zeros(3)
            for a in range(3):
                innovation -= model.rim_jacobian[i, a] * motion[a]
                for b in range(3):
                    gain[a] += covariance[a, b] * model.rim_jacobian[i, b]
                    information[a, b] += model.rim_jacobian[i, a] * model.rim_jacobian[i, b]
                total += model.rim_jacobian[i, a] * gain[a]
            factor = np.eye(3)
            for a in range(3):
                gain[a] /= total
                motion[a] += gain[a] * innovation
                for b in range(3):
                    factor[a, b] -= gain[a] * model.rim_jacobian[i, b]
            covariance = congruence(factor, covariance)
            for a in range(3):
                for b in range(3):
                    covariance[a, b] += variance * gain[a] * gain[b]
    _, determinant = inverse(information)
    return motion, covariance, determinant > 1e-6


@compiled
def _correct_with_gyro(
    mean: Float[Array, " 10"],
    joint: Float[Array, "13 13"],
    motion: Float[Array, " 3"],
    odometry: Odometry,
    model: MotionModel,
) -> Float[Array, "13 13"]:
    """Correct ``mean`` and ``motion`` in place with the gyro; return their joint covariance.

    The gyro measures the motion's rotation plus its own bias. Joseph's form keeps the covariance
    positive semidefinite (Bar-Shalom, Li & Kirubarajan, 2001, eq. 5.2.3-18).
    """
    dt = odometry.duration
    variance = model.gyro_noise**2 * dt + _MIN_VARIANCE
    cross = joint[:, _ROTATION] + dt * joint[:, GYRO_BIAS]
    gain = cross / (cross[_ROTATION] + dt * cross[GYRO_BIAS] + variance)
    innovation = odometry.yaw_rate * dt - motion[2] - mean[GYRO_BIAS] * dt
    mean[POSE] = compose(mean[POSE], exponential(gain[POSE] * innovation))
    for i in range(POSE.stop, SIZE):
        mean[i] += gain[i] * innovation
    for a in range(3):
        motion[a] += gain[_MOTION.start + a] * innovation
    factor = np.eye(_JOINT_SIZE)
    for i in range(_JOINT_SIZE):
        factor[i, GYRO_BIAS] -= gain[i] * dt
        factor[i, _ROTATION] -= gain[i]
    corrected = congruence(factor, joint)
    for i in range(_JOINT_SIZE):
        for j in range(_JOINT_SIZE):
            corrected[i, j] += variance * gain[i] * gain[j]
    return corrected


@compiled
def _propagate_covariance(
    mean: Float[Array, " 10"],
    joint: Float[Array, "13 13"],
    motion: Float[Array, " 3"],
    model: MotionModel,
    dt: float,
) -> Float[Array, "10 10"]:
    """Return the covariance after ``motion``; propagate the fixes' bias in ``mean`` in place."""
    transition = np.zeros((SIZE, _JOINT_SIZE))
    transition[POSE, POSE] = inverse_adjoint(motion)
    transition[POSE, _MOTION] = right_jacobian(motion)
    transition[GYRO_BIAS, GYRO_BIAS] = 1.0
    a, b, c, d = gauss_markov(dt, model.bias_time, model.bias_damping)
    for i in range(3):
        k, r = FIX_BIAS.start + i, FIX_BIAS_RATE.start + i
        transition[k, k], transition[k, r] = a, b
        transition[r, k], transition[r, r] = c, d
        mean[k], mean[r] = a * mean[k] + b * mean[r], c * mean[k] + d * mean[r]
    covariance = congruence(transition, joint)
    covariance[GYRO_BIAS, GYRO_BIAS] += model.gyro_walk**2 * dt
    share, damping = dt / model.bias_time, model.bias_damping
    for i in range(3):  # process noise that preserves the stationary variances of bias and rate
        variance = model.bias_sigma[i] ** 2
        rate_variance = variance / model.bias_time**2
        if share < _SMALL_SHARE:  # integrated noise of density 4 damping variance / bias_time^3
            noise = 4.0 / 3.0 * damping * share**3 * variance
            rate_noise = 4.0 * damping * share * rate_variance
            cross = 2.0 * damping * share**2 * variance / model.bias_time
        else:
            noise = variance - a * a * variance - b * b * rate_variance
            rate_noise = rate_variance - c * c * variance - d * d * rate_variance
            cross = -(a * c * variance + b * d * rate_variance)
        k, r = FIX_BIAS.start + i, FIX_BIAS_RATE.start + i
        covariance[k, k] += noise
        covariance[r, r] += rate_noise
        covariance[k, r] += cross
        covariance[r, k] += cross
    for i in range(len(_MAX_VARIANCES)):
        if covariance[i, i] > _MAX_VARIANCES[i]:
            scale = sqrt(_MAX_VARIANCES[i] / covariance[i, i])
            covariance[i, :] *= scale
            covariance[:, i] *= scale
    return covariance
