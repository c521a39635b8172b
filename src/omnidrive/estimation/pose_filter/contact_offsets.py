"""Offsets of the wheels' contacts along their axles, a process in the wheel angle.

Two rows of rollers touch the floor by turns, and on a tilted roller the contact moves along the
axle; this changes the lever arm of the wheel. The phase is unknown, because incremental encoders
measure changes only. A wheel that stands still, as on a robot that turns about a point beyond it,
keeps its offset: the error of the odometry grows in proportion to the rotation.
"""

from __future__ import annotations

from math import exp, isfinite

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.pose_filter.filter_state import SIZE
from omnidrive.estimation.pose_filter.motion_model import MotionModel, Odometry


@compiled
def contact_correlation(odometry: Odometry, model: MotionModel, i: int) -> tuple[float, float]:
    """Return the correlation of a contact's offset with its mean over an interval.

    The offset is a first-order Gauss-Markov process in the rim's displacement. Returned are the
    covariance of its value at the start (or the end) of the interval with its mean, and the
    variance of the mean, both over the variance of the offset. Both are 1 for a wheel that stands
    still; a wheel of unknown displacement is taken to have moved far.
    """
    if not isfinite(odometry.displacements[i]):
        return 0.0, 1.0
    x = abs(odometry.displacements[i]) / model.contact_length[i]
    if x < 1e-4:  # first terms of the series, which has no rounding errors
        return 1.0 - 0.5 * x, 1.0 - x / 3.0
    share = (1.0 - exp(-x)) / x
    return share, 2.0 * (1.0 - share) / x


@compiled
def average_contacts(
    mean: Float[Array, " size"],
    joint: Float[Array, "size_and_3 size_and_3"],
    odometry: Odometry,
    model: MotionModel,
) -> None:
    """Replace the contacts' offsets at the start of an interval by their means over it, in place.

    See Sarkka & Solin, "Applied Stochastic Differential Equations", 2019, section 6.2.
    """
    for i in range(len(mean) - SIZE):
        k = SIZE + i
        share, variance = contact_correlation(odometry, model, i)
        mean[k] *= share
        joint[k, :] *= share
        joint[:, k] *= share
        joint[k, k] += model.contact_sigma[i] ** 2 * max(variance - share * share, 0.0)
