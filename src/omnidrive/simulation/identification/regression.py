"""Least squares with standard errors that allow for correlation within segments of a log."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import least_squares

from omnidrive.arrays import Array

_SINGULAR = 1e-7  # smallest singular value over the largest, of scaled columns


class Fit(NamedTuple):
    """Result of a fit."""

    values: Float[Array, " parameters"]
    sigmas: Float[Array, " parameters"]
    """Standard errors; infinite for parameters that the data do not determine."""
    residuals: Float[Array, " rows"]


def segments_of(t: Float[Array, " rows"], length: float) -> Int[Array, " rows"]:
    """Return the index of the segment of each sample.

    Args:
        t: Times, s.
        length: Least length of a segment, s.
    """
    count = max(int((t[-1] - t[0]) / length), 1)
    index: Int[Array, " rows"] = np.minimum((t - t[0]) / (t[-1] - t[0]) * count, count - 1).astype(
        np.int64
    )
    return index


def without_means(
    block: Float[Array, "rows columns"], segments: Int[Array, " rows"]
) -> Float[Array, "rows columns"]:
    """Return a block without the mean of each segment."""
    counts = np.maximum(np.bincount(segments), 1)
    centred = np.empty_like(block)
    for k in range(block.shape[1]):
        means = np.bincount(segments, block[:, k]) / counts
        centred[:, k] = block[:, k] - means[segments]
    return centred


def fit(
    residuals: Callable[[Float[Array, " parameters"]], Float[Array, " rows"]],
    start: Float[Array, " parameters"],
    bounds: tuple[Float[Array, " parameters"], Float[Array, " parameters"]],
    scales: Float[Array, " parameters"],
    segments: Int[Array, " rows"],
) -> Fit:
    """Minimise the sum of squares of the residuals.

    The covariance is ``B (sum of g g^T over segments) B S / (S - 1)`` with ``B = (J^T J)^-1`` and
    the gradient ``g = J^T e`` of each of the S segments. It is valid whatever the correlation
    within segments (Liang & Zeger, "Longitudinal data analysis using generalized linear models",
    Biometrika 73, 1986).

    Args:
        residuals: Residuals of the parameters.
        start: First iterate.
        bounds: Lower and upper bounds.
        scales: Typical sizes of the parameters.
        segments: Segment of each residual.
    """
    low, high = bounds
    start = np.clip(start, low + 1e-9 * scales, high - 1e-9 * scales)
    result = least_squares(
        residuals, start, bounds=(low, high), x_scale=scales, diff_step=1e-4, xtol=1e-10
    )
    jacobian = _jacobian(residuals, result.x, scales, low, high)
    return Fit(result.x, scales * _sigmas(jacobian, result.fun, segments), result.fun)


def _jacobian(
    residuals: Callable[[Float[Array, " parameters"]], Float[Array, " rows"]],
    at: Float[Array, " parameters"],
    scales: Float[Array, " parameters"],
    low: Float[Array, " parameters"],
    high: Float[Array, " parameters"],
) -> Float[Array, "rows parameters"]:
    """Return the derivatives by the scaled parameters, central unless at a bound."""
    columns = []
    for k, scale in enumerate(scales):
        step = np.zeros_like(at)
        step[k] = 1e-3 * scale
        above, below = np.minimum(at + step, high), np.maximum(at - step, low)
        width = (above[k] - below[k]) / scale
        columns.append((residuals(above) - residuals(below)) / width)
    return np.column_stack(columns)


def _sigmas(
    jacobian: Float[Array, "rows parameters"],
    residuals: Float[Array, " rows"],
    segments: Int[Array, " rows"],
) -> Float[Array, " parameters"]:
    norms = np.linalg.norm(jacobian, axis=0)
    sigmas = np.full(jacobian.shape[1], np.inf)
    used = norms > 0.0
    count = len(np.unique(segments))
    if not used.any() or count < 2:
        return sigmas
    scaled = jacobian[:, used] / norms[used]
    _, singular, axes = np.linalg.svd(scaled, full_matrices=False)
    null: Bool[Array, " parameters"] = singular < _SINGULAR * singular[0]
    inverse = np.where(null, 0.0, 1.0 / np.maximum(singular, 1e-300)) ** 2
    bread = axes.T @ (inverse[:, None] * axes)
    gradients = np.zeros((int(segments.max()) + 1, scaled.shape[1]))
    np.add.at(gradients, segments, scaled * residuals[:, None])
    covariance = bread @ (gradients.T @ gradients) @ bread * count / (count - 1)
    found = np.sqrt(np.maximum(np.diag(covariance), 0.0)) / norms[used]
    undetermined = (np.abs(axes[null]) > 1e-3).any(axis=0)
    sigmas[used] = np.where(undetermined, np.inf, found)
    return sigmas
