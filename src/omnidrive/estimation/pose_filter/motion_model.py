"""Parameters of the motion model, and one interval of odometry."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array


class MotionModel(NamedTuple):
    """Robot, wheels, gyro and noise parameters with which the filter propagates its state."""

    rim_jacobian: Float[Array, "wheels 3"]
    """Rim speed of each wheel per unit of body twist; 1, 1 and m/rad."""
    contact_sigmas: Float[Array, "wheels 2"]
    """Standard deviations of the components of the contacts' offsets, m: of the fundamental, and of
    the harmonics; all zero if they have no place in the state vector."""
    contact_lengths: Float[Array, "wheels 2"]
    """Displacements of a rim per radian of the phases of fundamental and harmonic, m."""
    contact_rest: Float[Array, " wheels"]
    """Root mean square of the harmonics beyond these, m."""
    cornering: tuple[float, float]
    """Mean and standard deviation of the slip speed per centripetal acceleration, s."""
    friction_limits: Float[Array, " wheels"]
    """Largest force that friction transmits at each wheel of a robot at rest, N; not finite if the
    wheels never slip, as for a robot without masses."""
    load_transfer: Float[Array, "wheels 2"]
    """Change of the friction limits per force on the robot along x and y of B, N/N."""
    motor_limit: float
    """Largest force of a motor at the rim, N."""
    inertia: Float[Array, " 3"]
    """Mass, mass and yaw inertia; kg, kg and kg m^2."""
    stiffness: float
    """Force of a wheel at its rim per difference of set point and speed of its servo, N s/m."""
    following_time: float
    """Time constant with which the robot follows a change of the set points in translation, s."""
    max_acceleration: Float[Array, " 3"]
    """Largest expected acceleration along each axis of B; m/s^2, m/s^2, rad/s^2."""
    max_twist: Float[Array, " 3"]
    """Largest possible velocity along each axis of B; m/s, m/s, rad/s."""
    encoder_resolution: float
    """Rim displacement per encoder count, m."""
    creep: float
    """Standard deviation of a rim displacement of 1 m, m / sqrt(m)."""
    slip_error: float
    """Standard deviation of the slip as a share of the predicted slip, root mean square of all
    rims."""
    slip_doubt: float
    """Standard deviation of slip beyond the prediction, as a multiple of the odometry residual."""
    slip_memory: float
    """Time constant with which the excess slip decays, s."""
    gyro_noise: float
    """Noise density of the gyro, rad/s / sqrt(Hz)."""
    gyro_walk: float
    """Random walk of the gyro's bias, rad/s / sqrt(s)."""
    bias_sigma: Float[Array, " 3"]
    """Stationary standard deviation of the pose fixes' bias; m, m, rad."""
    bias_time: float
    """Standard deviation of this bias over that of its rate, s."""
    bias_damping: float
    """Damping ratio of this bias; see :func:`~omnidrive.estimation.gauss_markov.gauss_markov`."""


class Odometry(NamedTuple):
    """Wheel encoders and gyro over one interval between readings, or a fraction of it."""

    displacements: Float[Array, " wheels"]
    """Displacement of each rim, m; NaN if its encoder reports nothing."""
    yaw_rate: float
    """Mean yaw rate by the gyro, rad/s; NaN if it reports nothing."""
    duration: float
    """Duration, s."""
    fraction: float
    """Fraction of an interval between two readings; encoder counts are rounded once per
    interval."""
