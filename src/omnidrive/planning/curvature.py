"""Greatest curvature of a spline between bounds."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.planning.parts import Parts
from omnidrive.planning.pieces import Pieces

STANDSTILL = 1e-9  # of the greatest speed
_MOST_PARTS = 200_000


def curvature_bounds(pieces: Pieces, tolerance: float) -> tuple[float, float]:
    """Bounds on the greatest curvature, in 1 over the points' unit: one attained, one certified.

    On a part of a piece |r' x r''| is at most the greatest of its Bezier control points, and |r'|
    at least the distance from 0 to the triangle of its own. Parts whose bound exceeds what was
    attained elsewhere are halved, until the bounds differ by no more than ``tolerance`` times the
    curvature, or than a turn of ``tolerance`` rad on the whole path.

    Both are infinite where the path stands still for a moment: it may turn on the spot there.
    Both are 0 for a path without length.
    """
    parts = Parts.of(pieces)
    hodograph = parts.hodograph()
    fastest = float(np.linalg.norm(hodograph, axis=-1).max())
    if fastest == 0.0:
        return 0.0, 0.0
    negligible = tolerance / float(np.linalg.norm(hodograph, axis=-1).max(axis=0).sum())
    attained = settled = 0.0
    while True:
        hodograph, crosses = parts.hodograph(), np.abs(_crosses(parts))
        speeds = np.linalg.norm(hodograph[::2], axis=-1)
        if speeds.min() <= STANDSTILL * fastest:
            return np.inf, np.inf
        attained = max(attained, float((crosses[::2] / speeds**3).max()))
        least = _distance_to_triangle(hodograph)
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds = np.where(least > 0.0, crosses.max(axis=0) / least**3, np.inf)
        wide = bounds > max(attained * (1.0 + tolerance), attained + negligible)
        settled = max(settled, float(bounds[~wide].max(initial=0.0)))
        if not wide.any() or 2 * np.count_nonzero(wide) > _MOST_PARTS:
            return attained, max(settled, attained, float(bounds[wide].max(initial=0.0)))
        parts = parts.halved(wide)


def _crosses(parts: Parts) -> Float[Array, "3 parts"]:
    """Bezier control points of r' x r'', which is quadratic on a piece."""
    first = _cross(parts.slopes, parts.bends)
    middle = first + 0.5 * parts.width * _cross(parts.slopes, parts.jerks)
    bent = 0.5 * parts.width**2 * _cross(parts.bends, parts.jerks)
    return np.stack([first, middle, 2.0 * middle - first + bent])


def _cross(a: Float[Array, "*n 2"], b: Float[Array, "*n 2"]) -> Float[Array, "*n"]:
    """Third component of a x b."""
    cross: Float[Array, "*n"] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross


def _distance_to_triangle(corners: Float[Array, "3 n 2"]) -> Float[Array, " n"]:
    """Distance from 0 to each triangle; 0 inside."""
    ends = np.roll(corners, -1, axis=0)
    sides = ends - corners
    squares = np.einsum("kni,kni->kn", sides, sides)
    along = -np.einsum("kni,kni->kn", corners, sides) / np.where(squares > 0.0, squares, 1.0)
    nearest = corners + np.clip(along, 0.0, 1.0)[..., None] * sides
    turns = _cross(corners, ends)
    inside = (turns > 0.0).all(axis=0) | (turns < 0.0).all(axis=0)
    return np.where(inside, 0.0, np.linalg.norm(nearest, axis=-1).min(axis=0))
