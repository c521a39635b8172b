"""From one sample to the next: odometry and gyro."""

from __future__ import annotations

from math import exp, isfinite, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.compiled import compiled, inlined
from omnidrive.simulation.estimation.belief import Belief
from omnidrive.simulation.estimation.se2 import after, exponential, right_jacobian, transport
from omnidrive.simulation.sensing.wander import wander

Array = np.ndarray

_MOST_SLIP = 50.0
"""In m/s: more is no more uncertain."""


class MotionModel(NamedTuple):
    """The robot's wheels and gyro, and how far they are to be trusted."""

    rims: Float[Array, "wheels 3"]
    """Speed of every rim per unit of body twist, in 1, 1 and m/rad."""
    traction: Float[Array, "faces 3"]
    """``|traction @ acceleration| <= 1`` is what the wheels can push, in s^2/m, s^2/m, s^2/rad."""
    agility: Float[Array, " 3"]
    """Acceleration along each axis of B that is not expected to be exceeded, in m/s^2, rad/s^2."""
    quantum: float
    """Way of a rim from count to count, in m."""
    creep: float
    """Standard deviation of a rim's way after 1 m, in m / sqrt(m)."""
    slip_doubt: float
    """Slip that is suspected, as a multiple of what the residuals show of it."""
    slip_at_grip: float
    """Usual slip of a rim that needs all its grip, in m/s; less goes with the square of the part."""
    slip_memory: float
    """Time constant with which a suspicion of slip fades, in s."""
    gyro_noise: float
    """Noise density in rad/s / sqrt(Hz)."""
    gyro_walk: float
    """Random walk of its bias, in rad/s / sqrt(s)."""
    bias_sigma: Float[Array, " 3"]
    """Standard deviations of the fixes' wandering bias, in m, m, rad."""
    bias_time: float
    """Its size over its rate of change, in s."""
    bias_damping: float
    """See :func:`~omnidrive.simulation.sensing.wander`."""


class Odometry(NamedTuple):
    """What wheels and gyro told of one interval, or of a share of it."""

    ways: Float[Array, " wheels"]
    """Of every rim, in m; NaN where the encoder told nothing."""
    yaw_rate: float
    """Mean over the interval, in rad/s; NaN: nothing told."""
    duration: float
    """In s."""
    share: float
    """Of an interval between two readings; counts are rounded once in each."""


@compiled
def propagate(belief: Belief, odometry: Odometry, model: MotionModel) -> Belief:
    """What is believed after the interval.

    Wheels first: least squares for the motion, with a slip that the residuals reveal. Then the gyro
    as a measurement of the motion's turn and of the gyro's own bias, at once. Then along the
    measured motion.
    """
    dt = odometry.duration
    if dt <= 0.0:
        return belief
    rate = odometry.yaw_rate - belief.mean[3]
    slip = max(belief.slip * exp(-dt / model.slip_memory), _slip(belief, odometry, model, rate))
    motion, spread, whole = _motion(belief, odometry, model, slip)
    mean, joint = belief.mean.copy(), np.zeros((13, 13))
    joint[:10, :10] = belief.covariance
    joint[10:, 10:] = spread
    if isfinite(rate):
        weight = np.zeros(13)
        weight[3], weight[12] = dt, 1.0
        variance = model.gyro_noise**2 * dt
        cross = joint @ weight
        total = weight @ cross + variance
        if total > 0.0:
            gain = cross / total
            step = gain * (odometry.yaw_rate * dt - motion[2] - mean[3] * dt)
            mean[:3] = after(mean[:3], exponential(step[:3]))
            mean[3:] += step[3:10]
            motion = motion + step[10:]
            left = np.eye(13) - np.outer(gain, weight)
            joint = left @ joint @ left.T + variance * np.outer(gain, gain)  # Joseph's form
    return _moved(mean, joint, motion, model, dt, slip, 0.0 if whole else belief.blind + dt)


@inlined
def _slip(belief: Belief, odometry: Odometry, model: MotionModel, rate: float) -> float:
    """Speed in m/s at which rims must slip to explain what wheels and gyro tell.

    The largest of three: a multiple of the root mean square of what remains of the rims' ways after
    least squares for the motion, whose turn is the gyro's where there is one; what is usual for the
    part of their grip that the wheels need; and what of the acceleration the floor cannot give.
    """
    dt, ways = odometry.duration, odometry.ways
    turning = isfinite(rate)
    unknown = 2 if turning else 3
    normal, right = 1e-9 * np.eye(3), np.zeros(3)
    known, nominal = 0, 0.0
    for i in range(len(ways)):
        if isfinite(ways[i]):
            row = model.rims[i]
            way = ways[i] - (row[2] * rate * dt if turning else 0.0)
            for a in range(unknown):
                right[a] += row[a] * way
                for b in range(unknown):
                    normal[a, b] += row[a] * row[b]
            known += 1
            nominal += _variance(odometry, model, ways[i])
    if turning:
        normal[2, 2] = 1.0
    motion = np.linalg.solve(normal, right)
    if turning:
        motion[2] = rate * dt
    squares = 0.0
    for i in range(len(ways)):
        if isfinite(ways[i]):
            squares += (ways[i] - model.rims[i] @ motion) ** 2
    found = 0.0
    if known > unknown:
        excess = squares / (known - unknown) - 4.0 * nominal / known
        found = model.slip_doubt * sqrt(max(excess, 0.0)) / dt
    if known >= unknown:
        change = motion / dt - belief.motion
        push = np.abs(model.traction @ change).max() * odometry.share / dt
        found = max(found, model.slip_at_grip * min(push, 1.0) ** 2)
        if push > 1.0:  # which no wheel can give
            found = max(found, (1.0 - 1.0 / push) * sqrt(change[0] ** 2 + change[1] ** 2))
    return min(found, _MOST_SLIP)


@inlined
def _variance(odometry: Odometry, model: MotionModel, way: float) -> float:
    """Of a rim's way without slip, in m^2: two roundings to whole counts, and creep."""
    return model.quantum**2 / 6.0 * odometry.share + model.creep**2 * abs(way)


@inlined
def _motion(
    belief: Belief, odometry: Odometry, model: MotionModel, slip: float
) -> tuple[Float[Array, " 3"], Float[Array, "3 3"], bool]:
    """Motion by the wheels with its covariance, and whether wheels and gyro tell all of it.

    Before anything is measured the motion is that of the interval before, give or take what the
    robot can accelerate by.
    """
    dt = odometry.duration
    information, told = np.zeros((3, 3)), np.zeros((3, 3))
    for a in range(3):
        # steps of one unknown velocity add up in full, not in squares
        reach = model.agility[a] * dt
        before, now = 0.5 * reach * belief.blind**2 / dt, reach * (belief.blind + 0.5 * dt)
        information[a, a] = 1.0 / (now * now + 2.0 * before * now)
    motion = belief.motion * dt
    right = information @ motion
    if isfinite(odometry.yaw_rate):
        told[2, 2] = 1.0
    for i in range(len(odometry.ways)):
        way = odometry.ways[i]
        if isfinite(way):
            row = model.rims[i]
            product = np.outer(row, row)
            certainty = 1.0 / (_variance(odometry, model, way) + (slip * dt) ** 2 + 1e-12)
            information += certainty * product
            told += product
            right += certainty * way * row
    spread = np.linalg.inv(information)
    return spread @ right, spread, np.linalg.det(told) > 1e-6


@inlined
def _moved(
    mean: Float[Array, " 10"],
    joint: Float[Array, "13 13"],
    motion: Float[Array, " 3"],
    model: MotionModel,
    dt: float,
    slip: float,
    blind: float,
) -> Belief:
    """The belief carried along ``motion``; ``joint`` is its covariance with the motion's."""
    carry = np.zeros((10, 13))
    carry[:3, :3] = transport(motion)
    carry[:3, 10:] = right_jacobian(motion)
    carry[3, 3] = 1.0
    a, b, c, d = wander(dt, model.bias_time, model.bias_damping)
    for i in range(3):
        carry[4 + i, 4 + i], carry[4 + i, 7 + i] = a, b
        carry[7 + i, 4 + i], carry[7 + i, 7 + i] = c, d
    covariance = carry @ joint @ carry.T
    covariance[3, 3] += model.gyro_walk**2 * dt
    for i in range(3):
        level = model.bias_sigma[i] ** 2
        steep = level / model.bias_time**2
        cross = a * c * level + b * d * steep
        covariance[4 + i, 4 + i] += level - a * a * level - b * b * steep
        covariance[7 + i, 7 + i] += steep - c * c * level - d * d * steep
        covariance[4 + i, 7 + i] -= cross
        covariance[7 + i, 4 + i] -= cross
    moved = mean.copy()
    moved[:3] = after(mean[:3], exponential(motion))
    moved[4:7] = a * mean[4:7] + b * mean[7:]
    moved[7:] = c * mean[4:7] + d * mean[7:]
    return Belief(moved, 0.5 * (covariance + covariance.T), motion / dt, slip, blind)
