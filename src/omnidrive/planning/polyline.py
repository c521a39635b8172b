"""Arc length and resampling of polylines."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array


def cumulative_length(points: Float[Array, "points 2"]) -> Float[Array, " points"]:
    """Return the length of the polyline up to each point, in m."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def resample(points: Float[Array, "points 2"], count: int) -> Float[Array, "count 2"]:
    """Return ``count`` points at equal distances along the polyline, its ends included."""
    distance = cumulative_length(points)
    at = np.linspace(0.0, distance[-1], count)
    return np.stack([np.interp(at, distance, column) for column in points.T], axis=1)
