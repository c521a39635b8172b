"""Kalman correction with a pose fix."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.pose_filter.filter_state import FIX_BIAS, POSE, FilterState
from omnidrive.estimation.pose_filter.matrices import congruence, inverse, product
from omnidrive.estimation.pose_filter.se2 import compose, exponential, logarithm, relative_pose

UNKNOWN_YAW = 1e3
"""Standard deviation of a yaw that a fix does not measure, rad."""
INITIAL_COUNT = 10.0
"""Number of fixes with the information of the stated covariance: how slowly it is adapted."""
_MAX_COUNT = 200.0
"""Largest number of fixes that the adaptation averages."""
_SCALES = (0.1, 10.0)
"""Least and largest ratio of the fixes' covariance to the stated one."""


@compiled
def correct(
    state: FilterState, fix: Float[Array, " 3"], sigma: tuple[float, float], gate: float
) -> tuple[FilterState, float]:
    """Return the filter state after a pose fix, and the fix's normalised innovation squared (NIS).

    The innovation is ``Log(mean^-1 o (fix - bias))``, the motion from the mean pose to the fix
    without its bias, so that a fix without noise becomes the new mean at any distance. The
    covariance update has Joseph's form, which keeps the covariance positive semidefinite. The NIS
    is the squared Mahalanobis length of the innovation (Bar-Shalom, Li & Kirubarajan, "Estimation
    with Applications to Tracking and Navigation", 2001, section 5.4).

    Args:
        state: Filter state at the stamp of the fix.
        fix: Measured pose of B in W; m, m, rad.
        sigma: Standard deviations of the fix's position (m) and yaw (rad).
        gate: NIS above which the fix is rejected; ``state`` is then returned unchanged.
    """
    mean, covariance = state.mean, state.covariance
    size = len(mean)
    innovation = logarithm(relative_pose(mean[POSE], fix - mean[FIX_BIAS]))
    c, s = cos(mean[2]), sin(mean[2])
    observation = np.zeros((3, size))
    by_pose, by_bias = observation[:, POSE], observation[:, FIX_BIAS]
    by_pose[0, 0] = by_pose[1, 1] = by_pose[2, 2] = by_bias[2, 2] = 1.0
    by_bias[0, 0], by_bias[0, 1] = c, s
    by_bias[1, 0], by_bias[1, 1] = -s, c
    noise = np.zeros((3, 3))
    noise[0, 0] = noise[1, 1] = state.fix_scale * sigma[0] ** 2
    noise[2, 2] = state.fix_scale * sigma[1] ** 2
    innovation_covariance = congruence(observation, covariance)
    for i in range(3):
        innovation_covariance[i, i] += noise[i, i]
    information, _ = inverse(innovation_covariance)
    nis = 0.0
    for i in range(3):
        for j in range(3):
            nis += innovation[i] * information[i, j] * innovation[j]
    if not nis <= gate:
        return state, nis
    gain = product(product(covariance, np.ascontiguousarray(observation.T)), information)
    factor = np.eye(size) - product(gain, observation)
    corrected = congruence(factor, covariance) + congruence(gain, noise)
    new_mean, step = mean.copy(), np.zeros(size)
    for i in range(size):
        for j in range(3):
            step[i] += gain[i, j] * innovation[j]
        new_mean[i] += step[i]
    new_mean[POSE] = compose(mean[POSE], exponential(step[POSE]))
    measured = 2 if sigma[1] >= UNKNOWN_YAW else 3
    scale, count = _adapt_scale(state, innovation, information, noise, measured)
    return FilterState(
        new_mean,
        corrected,
        state.velocity,
        state.excess_slip,
        state.unobserved_time,
        scale,
        count,
    ), nis


@compiled
def _adapt_scale(
    state: FilterState,
    innovation: Float[Array, " 3"],
    information: Float[Array, "3 3"],
    noise: Float[Array, "3 3"],
    measured: int,
) -> tuple[float, float]:
    """Return the ratio of the fixes' covariance to the stated one, and its number of fixes.

    A recursive maximum-likelihood estimate from the innovations (Mehra, "On the identification of
    variances and adaptive Kalman filtering", IEEE TAC 15, 1970): with the innovation covariance S
    and the fixes' covariance R, the score of the ratio is
    ``(innovation^T S^-1 R S^-1 innovation - tr(S^-1 R)) / 2`` and its information
    ``tr((S^-1 R)^2) / 2``. A gain of 2 / count forgets the stated value quadratically in the number
    of fixes.

    Args:
        state: Filter state before the fix.
        innovation: Of the fix.
        information: Inverse of its covariance.
        noise: Covariance of the fix, diagonal.
        measured: Number of measured components.
    """
    score, weight = 0.0, 0.0
    for i in range(measured):
        weighted = 0.0
        for j in range(measured):
            weighted += information[i, j] * innovation[j]
            weight += information[i, j] ** 2 * noise[i, i] * noise[j, j]
        score += noise[i, i] * (weighted * weighted - information[i, i])
    count = min(state.fix_count + weight / measured, _MAX_COUNT)
    scale = state.fix_scale * (1.0 + 2.0 * score / measured / count)
    return min(max(scale, _SCALES[0]), _SCALES[1]), count
