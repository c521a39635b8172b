"""Offsets of the wheels' contacts along their axles: damped oscillators in the wheel angle.

Two rows of rollers touch the floor by turns, and on a tilted roller the contact moves along the
axle; this changes the lever arm of the wheel. The phase is unknown, because incremental encoders
measure changes only. The offset is the sum of a cosine and a sine of the rim's displacement with
random amplitudes, the fundamental of the pattern: it cancels over a period of a wheel that turns,
and stays on a wheel that stands still while the robot turns. The damping covers the harmonics.
"""

from __future__ import annotations

from math import cos, exp, isfinite, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.pose_filter.filter_state import SIZE
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry

_PERIODS = 3.0
"""Displacement over which the oscillation decays to 1/e, in periods."""


@compiled
def contact_means(odometry: Odometry, model: MotionModel) -> Float[Array, "wheels 2"]:
    """Return the weights of each wheel's two components in its mean offset over an interval.

    They are zero for a wheel of unknown displacement.
    """
    weights = np.zeros((len(odometry.displacements), 2))
    for i in range(len(weights)):
        if isfinite(odometry.displacements[i]):
            angle = odometry.displacements[i] / model.contact_length[i]
            weights[i, 0] = sin(angle) / angle if abs(angle) > 1e-6 else 1.0
            weights[i, 1] = (1.0 - cos(angle)) / angle if abs(angle) > 1e-6 else 0.5 * angle
    return weights


@compiled
def propagate_contacts(
    mean: Float[Array, " size"],
    transition: Float[Array, "size size_and_3"],
    odometry: Odometry,
    model: MotionModel,
) -> Float[Array, " size"]:
    """Propagate the offsets in ``mean``, and set their transition, in place.

    Returns:
        The variances of the process noise, zero but for the offsets. A wheel of unknown
        displacement has moved far.
    """
    noise = np.zeros(len(mean))
    for i in range((len(mean) - SIZE) // 2):
        k, decay, angle = SIZE + 2 * i, 0.0, 0.0
        if isfinite(odometry.displacements[i]):
            angle = odometry.displacements[i] / model.contact_length[i]
            decay = exp(-abs(angle) / (2.0 * np.pi * _PERIODS))
        c, s = decay * cos(angle), decay * sin(angle)
        transition[k, k], transition[k, k + 1] = c, s
        transition[k + 1, k], transition[k + 1, k + 1] = -s, c
        mean[k], mean[k + 1] = c * mean[k] + s * mean[k + 1], c * mean[k + 1] - s * mean[k]
        noise[k] = noise[k + 1] = model.contact_sigma[i] ** 2 * (1.0 - decay * decay)
    return noise
