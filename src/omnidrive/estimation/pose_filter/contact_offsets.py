"""Offsets of the wheels' contacts along their axles: oscillators in the wheel angle.

Two rows of rollers touch the floor by turns, and on a tilted roller the contact moves along the
axle; this changes the lever arm of the wheel. The phase is unknown, because incremental encoders
measure changes only. The offset is the sum of a fundamental and its strongest harmonic, each a
cosine and a sine of the rim's displacement with random amplitudes: it cancels over a period of a
wheel that turns, and stays on a wheel that stands still while the robot turns. The second
oscillator has the variance of all harmonics; those beyond it are also noise of the displacements.
"""

from __future__ import annotations

from math import cos, isfinite, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.pose_filter.filter_state import SIZE
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry

COMPONENTS = 4
"""Components of the state vector per wheel: cosine and sine of fundamental and harmonic."""


@compiled
def contact_means(odometry: Odometry, model: MotionModel) -> Float[Array, "wheels components"]:
    """Return the weights of each wheel's components in its mean offset over an interval.

    They are zero for a wheel of unknown displacement.
    """
    weights = np.zeros((len(odometry.displacements), COMPONENTS))
    for i in range(len(weights)):
        if isfinite(odometry.displacements[i]):
            for h in range(2):
                angle = odometry.displacements[i] / model.contact_lengths[i, h]
                near = abs(angle) < 1e-6
                weights[i, 2 * h] = 1.0 if near else sin(angle) / angle
                weights[i, 2 * h + 1] = 0.5 * angle if near else (1.0 - cos(angle)) / angle
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
        The variances of the process noise, zero but for the offsets of wheels of unknown
        displacement: these may have moved far.
    """
    noise = np.zeros(len(mean))
    for j in range((len(mean) - SIZE) // 2):
        i, h, k = j // 2, j % 2, SIZE + 2 * j
        c, s = 0.0, 0.0
        if isfinite(odometry.displacements[i]):
            angle = odometry.displacements[i] / model.contact_lengths[i, h]
            c, s = cos(angle), sin(angle)
        else:
            noise[k] = noise[k + 1] = model.contact_sigmas[i, h] ** 2
        transition[k, k], transition[k, k + 1] = c, s
        transition[k + 1, k], transition[k + 1, k + 1] = -s, c
        mean[k], mean[k + 1] = c * mean[k] + s * mean[k + 1], c * mean[k + 1] - s * mean[k]
    return noise
