"""Propagation of the filter state by odometry and gyro."""

from __future__ import annotations

from math import exp, isfinite, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.estimation.gauss_markov import gauss_markov
from omnidrive.estimation.pose_filter.body_motion import (
    MIN_VARIANCE,
    correct_with_gyro,
    correct_with_wheels,
    predict_motion,
    remove_roundings,
)
from omnidrive.estimation.pose_filter.contact_offsets import (
    COMPONENTS,
    contact_means,
    propagate_contacts,
)
from omnidrive.estimation.pose_filter.filter_state import (
    CORNERING,
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

_MAX_SLIP = 50.0
"""Largest excess slip speed, m/s."""
_MAX_UNOBSERVED_TIME = 10.0
"""Largest time without odometry that counts, s: the uncertainty grows linearly from then on."""
_MAX_VARIANCES = (1e6, 1e6, 100.0, 1.0)
"""Largest variances of the pose and of the gyro's bias; m^2, m^2, rad^2, rad^2/s^2. Numbers of very
different sizes would make the covariance indefinite by rounding."""
_RIDGE = 1e-9
"""Added to the normal matrix of a fit, which makes it one of least norm."""
_SMALL_SHARE = 1e-3
"""Duration over the time constant of the bias below which its process noise is the first term of
its series: the difference of stationary variances would consist of rounding errors."""


@compiled
def propagate(state: FilterState, odometry: Odometry, model: MotionModel) -> FilterState:
    """Return the filter state at the end of an interval.

    The body motion is predicted from the last velocity and corrected with the wheel displacements
    without the predicted slip, and with the gyro; these corrections also act on the offsets of the
    wheels' contacts and on the gyro's bias. Finally the slip in curves is removed, and the pose,
    its covariance and the bias of the pose fixes are propagated along the motion.
    """
    dt = odometry.duration
    if dt <= 0.0:
        return state
    size = len(state.mean)
    mean, joint = state.mean.copy(), np.zeros((size + 3, size + 3))
    joint[:size, :size] = state.covariance
    jacobian, weights = model.rim_jacobian.copy(), contact_means(odometry, model)
    for j in range(size - SIZE):
        i, a = j // COMPONENTS, j % COMPONENTS
        jacobian[i, 2] += weights[i, a] * mean[SIZE + j]
    rate = odometry.yaw_rate - mean[GYRO_BIAS]
    slip, mean_twist, velocity = predict_slip(state.velocity, odometry, jacobian, model)
    turn = rate * dt if isfinite(rate) else state.velocity[2] * dt
    variances = _displacement_variances(odometry.displacements, slip, model.creep, model.slip_error)
    _add_harmonics(variances, odometry, model, turn)
    _add_contact_shift(slip, model, turn, weights)
    by_offset = turn * weights
    residual_slip = _excess_slip(odometry, model, jacobian, rate, slip, variances, by_offset, joint)
    excess_slip = max(state.excess_slip * exp(-dt / model.slip_memory), residual_slip)
    for i in range(len(slip)):
        variances[i] += (excess_slip * dt) ** 2
    rounding = model.encoder_resolution**2 / 6.0 * odometry.fraction
    by_rounding = np.zeros((size + 3, len(slip)))
    motion = predict_motion(joint, state, model, dt)
    observed = correct_with_wheels(
        mean, joint, motion, odometry, jacobian, slip, variances, by_offset, rounding, by_rounding
    )
    if isfinite(rate):
        correct_with_gyro(mean, joint, motion, odometry, model, by_rounding)
    remove_roundings(joint, by_rounding, rounding)
    if isfinite(model.friction_limits[0]):
        velocity += motion / dt - mean_twist
    else:
        velocity = motion / dt
    for a in range(3):
        velocity[a] = min(max(velocity[a], -model.max_twist[a]), model.max_twist[a])
    unobserved_time = 0.0 if observed else min(state.unobserved_time + dt, _MAX_UNOBSERVED_TIME)
    cornering = np.array([-motion[1], motion[0], 0.0]) * (motion[2] / dt)
    motion -= mean[CORNERING] * cornering
    pose = compose(mean[POSE], exponential(motion))
    covariance = _propagate_covariance(mean, joint, motion, cornering, odometry, model)
    mean[POSE] = pose
    return FilterState(
        mean, covariance, velocity, excess_slip, unobserved_time, state.fix_scale, state.fix_count
    )


@inlined
def _add_harmonics(
    variances: Float[Array, " wheels"], odometry: Odometry, model: MotionModel, turn: float
) -> None:
    """Add, in place, the variances (m^2) of the displacements by the offsets' higher harmonics.

    Their means over an interval decrease with the phase that it contains.
    """
    for i in range(len(variances)):
        half = 0.5 * odometry.displacements[i] / model.contact_lengths[i, 1]
        variances[i] += (turn * model.contact_rest[i]) ** 2 / (1.0 + half * half)


@inlined
def _add_contact_shift(
    slip: Float[Array, " wheels"],
    model: MotionModel,
    turn: float,
    weights: Float[Array, "wheels components"],
) -> None:
    """Add, in place, the displacements by contacts and rotation that vary together in an interval.

    Servos keep the rims' speeds, so that the robot turns more slowly while a contact is further
    outwards: with the variance v of the offset within the interval, and the levers l of the wheels,
    the displacement is smaller by ``v turn l_i / sum l^2`` than by the means of both.
    """
    squares = MIN_VARIANCE
    for i in range(len(slip)):
        squares += model.rim_jacobian[i, 2] ** 2
    for i in range(len(slip)):
        variance = 0.0
        for h in range(2):
            mean_square = weights[i, 2 * h] ** 2 + weights[i, 2 * h + 1] ** 2
            variance += model.contact_sigmas[i, h] ** 2 * (1.0 - mean_square)
        slip[i] -= variance * turn * model.rim_jacobian[i, 2] / squares


@compiled
def _excess_slip(  # noqa: PLR0917
    odometry: Odometry,
    model: MotionModel,
    jacobian: Float[Array, "wheels 3"],
    rate: float,
    slip: Float[Array, " wheels"],
    variances: Float[Array, " wheels"],
    by_offset: Float[Array, "wheels components"],
    joint: Float[Array, "size_and_3 size_and_3"],
) -> float:
    """Return the slip speed (m/s) beyond the prediction by which wheels and gyro disagree.

    The body motion is fitted to the displacements by least squares, with the rotation of the gyro
    if it reports one. The result is ``slip_doubt / dt`` times the square root of the mean squared
    residual in excess of four times its nominal variance, which includes that of the gyro and of
    the contacts' offsets with the derivatives ``by_offset`` of the displacements; zero if the
    displacements are not redundant. Wheels that do not determine the motion can be redundant all
    the same: two opposite ones determine the rotation, as does the gyro. The fit is therefore that
    of least norm, and its rank is the trace of the projection.
    """
    dt, displacements = odometry.duration, odometry.displacements
    has_gyro = isfinite(rate)
    unknowns = 2 if has_gyro else 3
    normal, right = np.zeros((3, 3)), np.zeros(3)
    known, nominal = 0, 0.0
    for i in range(len(displacements)):
        if isfinite(displacements[i]):
            displacement = (
                displacements[i] - slip[i] - (jacobian[i, 2] * rate * dt if has_gyro else 0.0)
            )
            for a in range(unknowns):
                right[a] += jacobian[i, a] * displacement
                for b in range(unknowns):
                    normal[a, b] += jacobian[i, a] * jacobian[i, b]
            known += 1
            nominal += _residual_variance(odometry, model, i, variances[i], by_offset, joint)
            if has_gyro:
                nominal += jacobian[i, 2] ** 2 * model.gyro_noise**2 * dt
    if has_gyro:
        normal[2, 2] = 1.0
    for a in range(unknowns):
        normal[a, a] += _RIDGE
    solver, _ = inverse(normal)
    redundancy, motion = float(known - unknowns), np.zeros(3)
    for a in range(unknowns):
        redundancy += _RIDGE * solver[a, a]
    if redundancy < 0.5:
        return 0.0
    for a in range(3):
        for b in range(3):
            motion[a] += solver[a, b] * right[b]
    if has_gyro:
        motion[2] = rate * dt
    squares = _residual_sum(odometry, jacobian, slip, motion)
    excess = squares / redundancy - 4.0 * nominal / known
    return min(model.slip_doubt * sqrt(max(excess, 0.0)) / dt, _MAX_SLIP)


@inlined
def _residual_variance(  # noqa: PLR0917
    odometry: Odometry,
    model: MotionModel,
    i: int,
    variance: float,
    by_offset: Float[Array, "wheels components"],
    joint: Float[Array, "size_and_3 size_and_3"],
) -> float:
    """Return a displacement's ``variance`` (m^2) with that of two roundings and of the offset."""
    variance += model.encoder_resolution**2 / 6.0 * odometry.fraction
    if len(joint) - 3 > SIZE:
        k = SIZE + COMPONENTS * i
        for a in range(COMPONENTS):
            for b in range(COMPONENTS):
                variance += by_offset[i, a] * joint[k + a, k + b] * by_offset[i, b]
    return variance


@inlined
def _residual_sum(
    odometry: Odometry,
    jacobian: Float[Array, "wheels 3"],
    slip: Float[Array, " wheels"],
    motion: Float[Array, " 3"],
) -> float:
    """Return the sum of squared residuals (m^2) of the displacements for a body motion."""
    squares = 0.0
    for i in range(len(odometry.displacements)):
        if isfinite(odometry.displacements[i]):
            residual = odometry.displacements[i] - slip[i]
            for a in range(3):
                residual -= jacobian[i, a] * motion[a]
            squares += residual * residual
    return squares


@compiled
def _displacement_variances(
    displacements: Float[Array, " wheels"],
    slip: Float[Array, " wheels"],
    creep: float,
    slip_error: float,
) -> Float[Array, " wheels"]:
    """Return the variance (m^2) of every rim's displacement from creep and predicted slip.

    The error of the predicted slip is a share of the mean square of all rims, because an error of
    the predicted body motion changes the slip of every rim, also of those that hold. The rounding
    to whole counts is no part of it: the sum of the displacements has only the roundings of the
    first and last reading, whose variance the pose has from the start. NaN if the displacement is
    not known.
    """
    variances, slip_variance = np.empty(len(slip)), MIN_VARIANCE
    for i in range(len(slip)):
        slip_variance += slip_error**2 * slip[i] ** 2 / len(slip)
    for i in range(len(slip)):
        variances[i] = creep**2 * abs(displacements[i]) + slip_variance
    return variances


@compiled
def _propagate_covariance(  # noqa: PLR0917
    mean: Float[Array, " size"],
    joint: Float[Array, "size_and_3 size_and_3"],
    motion: Float[Array, " 3"],
    cornering: Float[Array, " 3"],
    odometry: Odometry,
    model: MotionModel,
) -> Float[Array, "size size"]:
    """Return the covariance after ``motion``; propagate biases and offsets in ``mean`` in place.

    The motion is that of the wheels without the cornering slip, whose derivative is ``cornering``.
    """
    size, dt = len(mean), odometry.duration
    transition = np.zeros((size, size + 3))
    transition[POSE, POSE] = inverse_adjoint(motion)
    by_motion = right_jacobian(motion)
    transition[POSE, size:] = by_motion
    for axis in range(3):
        for k in range(2):
            transition[axis, CORNERING] -= by_motion[axis, k] * cornering[k]
    transition[GYRO_BIAS, GYRO_BIAS] = transition[CORNERING, CORNERING] = 1.0
    a, b, c, d = gauss_markov(dt, model.bias_time, model.bias_damping)
    for i in range(3):
        k, r = FIX_BIAS.start + i, FIX_BIAS_RATE.start + i
        transition[k, k], transition[k, r] = a, b
        transition[r, k], transition[r, r] = c, d
        mean[k], mean[r] = a * mean[k] + b * mean[r], c * mean[k] + d * mean[r]
    contact_noise = propagate_contacts(mean, transition, odometry, model)
    covariance = congruence(transition, joint)
    for i in range(SIZE, size):
        covariance[i, i] += contact_noise[i]
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
