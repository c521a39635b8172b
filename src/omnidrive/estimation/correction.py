"""What a fix of the pose tells."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.filter_state import FilterState
from omnidrive.estimation.matrices import inverse, product, sandwich
from omnidrive.estimation.se2 import after, exponential, logarithm, seen_from


@compiled
def correct(
    belief: FilterState, fix: Float[Array, " 3"], sigma: tuple[float, float], gate: float
) -> tuple[FilterState, float]:
    """What is believed after a fix, and the squared length of its innovation.

    The innovation is the motion from the mean to the fix less its bias: however far they are apart,
    a fix that is trusted fully is the new mean. Joseph's form keeps the covariance positive.

    Args:
        belief: When the fix was taken.
        fix: Pose in W, in m, m, rad.
        sigma: Its standard deviations, in m and rad.
        gate: Squared length, in standard deviations, beyond which the fix is not believed.
    """
    mean, covariance = belief.mean, belief.covariance
    surprise = logarithm(seen_from(mean[:3], fix - mean[4:7]))
    c, s = cos(mean[2]), sin(mean[2])
    shows = np.zeros((3, 10))
    shows[0, 0] = shows[1, 1] = shows[2, 2] = shows[2, 6] = 1.0
    shows[0, 4], shows[0, 5], shows[1, 4], shows[1, 5] = c, s, -s, c
    noise = np.zeros((3, 3))
    noise[0, 0] = noise[1, 1] = sigma[0] ** 2
    noise[2, 2] = sigma[1] ** 2
    total = sandwich(shows, covariance)
    for i in range(3):
        total[i, i] += noise[i, i]
    certainty, _ = inverse(total)
    length = 0.0
    for i in range(3):
        for j in range(3):
            length += surprise[i] * certainty[i, j] * surprise[j]
    if not length <= gate:
        return belief, length
    gain = product(product(covariance, np.ascontiguousarray(shows.T)), certainty)
    left = np.eye(10) - product(gain, shows)
    kept = sandwich(left, covariance) + sandwich(gain, noise)
    moved, step = mean.copy(), np.zeros(10)
    for i in range(10):
        for j in range(3):
            step[i] += gain[i, j] * surprise[j]
        moved[i] += step[i]
    moved[:3] = after(mean[:3], exponential(step[:3]))
    return FilterState(moved, kept, belief.velocity, belief.slip, belief.blind), length
