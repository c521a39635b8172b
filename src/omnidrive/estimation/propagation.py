"""From one sample to the next: odometry and gyro."""

from __future__ import annotations

from math import exp, isfinite, sqrt

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.filter_state import FilterState
from omnidrive.estimation.gauss_markov import gauss_markov
from omnidrive.estimation.matrices import inverse, sandwich
from omnidrive.estimation.motion_model import MotionModel, Odometry
from omnidrive.estimation.se2 import after, exponential, right_jacobian, transport
from omnidrive.estimation.slipping import slipped

_MOST_SLIP = 50.0
"""In m/s: more is no more uncertain."""
_ROUNDING = 1e-12
"""Variance of a way in m^2 that is always there."""


@compiled
def propagate(belief: FilterState, odometry: Odometry, model: MotionModel) -> FilterState:
    """What is believed after the interval.

    Wheels first: their ways, less the slip that dragging the robot takes, by least squares for its
    motion. Then the gyro, as a measurement of the motion's turn and of the gyro's own bias at once.
    Then along the motion.
    """
    dt = odometry.duration
    if dt <= 0.0:
        return belief
    rate = odometry.yaw_rate - belief.mean[3]
    lost, mean_twist, velocity = slipped(belief.velocity, odometry, model)
    found = _unexpected(odometry, model, rate, lost)
    slip = max(belief.slip * exp(-dt / model.slip_memory), found)
    motion, spread, whole = _motion(belief, odometry, model, lost, slip)
    mean, joint = belief.mean.copy(), np.zeros((13, 13))
    joint[:10, :10] = belief.covariance
    joint[10:, 10:] = spread
    if isfinite(rate):
        joint = _with_gyro(mean, joint, motion, odometry, model)
    if isfinite(model.friction_limits[0]):
        velocity += motion / dt - mean_twist
    else:
        velocity = motion / dt
    blind = 0.0 if whole else belief.blind + dt
    moved = mean.copy()
    covariance = _carried(moved, joint, motion, model, dt)
    moved[:3] = after(mean[:3], exponential(motion))
    return FilterState(moved, covariance, velocity, slip, blind)


@compiled
def _unexpected(
    odometry: Odometry, model: MotionModel, rate: float, lost: Float[Array, " wheels"]
) -> float:
    """Speed in m/s by which rims slip otherwise than expected, if wheels and gyro disagree.

    A multiple of the root mean square of what remains of the ways after least squares for the
    motion, whose turn is the gyro's where there is one; 0 where noise explains it.
    """
    dt, ways = odometry.duration, odometry.ways
    turning = isfinite(rate)
    unknown = 2 if turning else 3
    normal, right = np.zeros((3, 3)), np.zeros(3)
    known, nominal = 0, 0.0
    for i in range(len(ways)):
        if isfinite(ways[i]):
            way = ways[i] - lost[i] - (model.rim_jacobian[i, 2] * rate * dt if turning else 0.0)
            for a in range(unknown):
                right[a] += model.rim_jacobian[i, a] * way
                for b in range(unknown):
                    normal[a, b] += model.rim_jacobian[i, a] * model.rim_jacobian[i, b]
            known += 1
            nominal += _variance(odometry, model, i, lost)
    if known <= unknown:
        return 0.0
    if turning:
        normal[2, 2] = 1.0
    solver, determinant = inverse(normal)
    if abs(determinant) < 1e-9:
        return 0.0
    motion = np.zeros(3)
    for a in range(3):
        for b in range(3):
            motion[a] += solver[a, b] * right[b]
    if turning:
        motion[2] = rate * dt
    squares = _squares(odometry, model, lost, motion)
    excess = squares / (known - unknown) - 4.0 * nominal / known
    return min(model.slip_doubt * sqrt(max(excess, 0.0)) / dt, _MOST_SLIP)


@compiled
def _squares(
    odometry: Odometry,
    model: MotionModel,
    lost: Float[Array, " wheels"],
    motion: Float[Array, " 3"],
) -> float:
    """Sum of the squares, in m^2, of what a motion leaves of the rims' ways."""
    squares = 0.0
    for i in range(len(odometry.ways)):
        if isfinite(odometry.ways[i]):
            left = odometry.ways[i] - lost[i]
            for a in range(3):
                left -= model.rim_jacobian[i, a] * motion[a]
            squares += left * left
    return squares


@compiled
def _variance(
    odometry: Odometry, model: MotionModel, i: int, lost: Float[Array, " wheels"]
) -> float:
    """Of a rim's way, in m^2: two roundings to whole counts, creep, and the slip expected.

    That of all rims: what is wrong about it is how the robot is dragged along, and this shows
    also at wheels that hold.
    """
    rounding: float = model.quantum**2 / 6.0 * odometry.share
    creep = model.creep**2 * abs(odometry.ways[i])
    slip: float = model.slip_error**2 * (lost**2).mean()
    return float(rounding + creep + slip + _ROUNDING)


@compiled
def _motion(
    belief: FilterState,
    odometry: Odometry,
    model: MotionModel,
    lost: Float[Array, " wheels"],
    slip: float,
) -> tuple[Float[Array, " 3"], Float[Array, "3 3"], bool]:
    """Motion by the wheels with its covariance, and whether wheels and gyro tell all of it.

    Before anything is measured the robot goes on as it did, give or take what it can accelerate.
    """
    dt = odometry.duration
    spread, told, motion = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    for a in range(3):
        # what an unknown velocity adds is added to, not its square to the square
        before = 0.5 * model.agility[a] * belief.blind**2
        now = model.agility[a] * dt * (belief.blind + dt)
        spread[a, a] = now * now + 2.0 * before * now
        motion[a] = belief.velocity[a] * dt
    if isfinite(odometry.yaw_rate):
        told[2, 2] = 1.0
    for i in range(len(odometry.ways)):
        if isfinite(odometry.ways[i]):  # one wheel after the other, by Joseph's form
            variance = _variance(odometry, model, i, lost) + (slip * dt) ** 2
            surprise, total, gain = odometry.ways[i] - lost[i], variance, np.zeros(3)
            for a in range(3):
                surprise -= model.rim_jacobian[i, a] * motion[a]
                for b in range(3):
                    gain[a] += spread[a, b] * model.rim_jacobian[i, b]
                    told[a, b] += model.rim_jacobian[i, a] * model.rim_jacobian[i, b]
                total += model.rim_jacobian[i, a] * gain[a]
            left = np.eye(3)
            for a in range(3):
                gain[a] /= total
                motion[a] += gain[a] * surprise
                for b in range(3):
                    left[a, b] -= gain[a] * model.rim_jacobian[i, b]
            spread = sandwich(left, spread)
            for a in range(3):
                for b in range(3):
                    spread[a, b] += variance * gain[a] * gain[b]
    _, determinant = inverse(told)
    return motion, spread, determinant > 1e-6


@compiled
def _with_gyro(
    mean: Float[Array, " 10"],
    joint: Float[Array, "13 13"],
    motion: Float[Array, " 3"],
    odometry: Odometry,
    model: MotionModel,
) -> Float[Array, "13 13"]:
    """Let the gyro correct mean and motion; return their covariance thereafter.

    It measures the motion's turn plus its own bias; by Joseph's form, which keeps the covariance
    positive (Bar-Shalom, Li & Kirubarajan, 2001, eq. 5.2.3-18).
    """
    dt = odometry.duration
    variance = model.gyro_noise**2 * dt + _ROUNDING
    cross = joint[:, 12] + dt * joint[:, 3]
    gain = cross / (cross[12] + dt * cross[3] + variance)
    surprise = odometry.yaw_rate * dt - motion[2] - mean[3] * dt
    mean[:3] = after(mean[:3], exponential(gain[:3] * surprise))
    for i in range(3, 10):
        mean[i] += gain[i] * surprise
    for a in range(3):
        motion[a] += gain[10 + a] * surprise
    left = np.eye(13)
    for i in range(13):
        left[i, 3] -= gain[i] * dt
        left[i, 12] -= gain[i]
    after_it = sandwich(left, joint)
    for i in range(13):
        for j in range(13):
            after_it[i, j] += variance * gain[i] * gain[j]
    return after_it


@compiled
def _carried(
    mean: Float[Array, " 10"],
    joint: Float[Array, "13 13"],
    motion: Float[Array, " 3"],
    model: MotionModel,
    dt: float,
) -> Float[Array, "10 10"]:
    """Covariance carried along ``motion``; lets the fixes' bias in ``mean`` go on as well."""
    carry = np.zeros((10, 13))
    carry[:3, :3] = transport(motion)
    carry[:3, 10:] = right_jacobian(motion)
    carry[3, 3] = 1.0
    a, b, c, d = gauss_markov(dt, model.bias_time, model.bias_damping)
    for i in range(4, 7):
        carry[i, i], carry[i, i + 3] = a, b
        carry[i + 3, i], carry[i + 3, i + 3] = c, d
        mean[i], mean[i + 3] = a * mean[i] + b * mean[i + 3], c * mean[i] + d * mean[i + 3]
    covariance = sandwich(carry, joint)
    covariance[3, 3] += model.gyro_walk**2 * dt
    for i in range(3):  # so that size and rate of a bias that settled stay as they are
        level = model.bias_sigma[i] ** 2
        steep = level / model.bias_time**2
        covariance[4 + i, 4 + i] += level - a * a * level - b * b * steep
        covariance[7 + i, 7 + i] += steep - c * c * level - d * d * steep
        covariance[4 + i, 7 + i] -= a * c * level + b * d * steep
        covariance[7 + i, 4 + i] -= a * c * level + b * d * steep
    return covariance
