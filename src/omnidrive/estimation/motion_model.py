"""What the estimator knows of the robot, and what it is told of its motion."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array


class MotionModel(NamedTuple):
    """The robot's wheels and gyro, and how far they are to be trusted."""

    rim_jacobian: Float[Array, "wheels 3"]
    """Speed of every rim per unit of body twist, in 1, 1 and m/rad."""
    friction_limits: Float[Array, " wheels"]
    """What friction carries of each wheel's push at rest, in N; not finite: wheels never slip, as
    without masses."""
    load_transfer: Float[Array, "wheels 2"]
    """How much more of it there is when the floor pushes the robot along x or y of B, in N/N."""
    motor: float
    """Push that a motor gives at most, in N."""
    inertia: Float[Array, " 3"]
    """Mass in kg, twice, and yaw inertia in kg m^2."""
    stiffness: float
    """Push of a wheel per speed of its rim over the floor, while it holds, in N s/m."""
    agility: Float[Array, " 3"]
    """Acceleration along each axis of B that is not expected to be exceeded, in m/s^2, rad/s^2."""
    quantum: float
    """Way of a rim from count to count, in m."""
    creep: float
    """Standard deviation of a rim's way after 1 m, in m / sqrt(m)."""
    slip_error: float
    """Standard deviation of a slip, as a part of the slip expected, root mean square of rims."""
    slip_doubt: float
    """The same of a slip not expected, as a multiple of what residuals show of it."""
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
    """See :func:`~omnidrive.estimation.gauss_markov.gauss_markov`."""


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
