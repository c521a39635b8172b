"""Bounds on the length and the greatest curvature of a spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.planning.pieces import Pieces

STANDSTILL = 1e-9
"""Share of the greatest speed below which the path counts as at rest."""
_MAX_LENGTH_SUBPIECES = 1_000_000
_MAX_CURVATURE_SUBPIECES = 200_000
_ROUNDING = 1e-12  # relative


class Subpieces(NamedTuple):
    """Parts of cubic pieces, all of one width.

    Attributes:
        first_derivatives: First derivatives at the start of each part.
        second_derivatives: Second derivatives at the start of each part.
        third_derivatives: Third derivatives, constant on a piece.
        width: Width of each part, in the parameter of the derivatives.
    """

    first_derivatives: Float[Array, "parts 2"]
    second_derivatives: Float[Array, "parts 2"]
    third_derivatives: Float[Array, "parts 2"]
    width: float

    @classmethod
    def of(cls, pieces: Pieces) -> Subpieces:
        """Return the whole pieces."""
        second = pieces.second_derivatives
        return cls(pieces.first_derivatives[:-1], second[:-1], np.diff(second, axis=0), 1.0)

    def halved(self, chosen: Bool[Array, " parts"]) -> Subpieces:
        """Return both halves of the chosen parts."""
        first, second = self.first_derivatives[chosen], self.second_derivatives[chosen]
        third, half = self.third_derivatives[chosen], 0.5 * self.width
        return Subpieces(
            np.concatenate([first, first + half * second + 0.5 * half**2 * third]),
            np.concatenate([second, second + half * third]),
            np.concatenate([third, third]),
            half,
        )

    def hodograph(self) -> Float[Array, "3 parts 2"]:
        """Return the Bezier control points of the first derivative; their triangle contains it."""
        first, second, width = self.first_derivatives, self.second_derivatives, self.width
        middle = first + 0.5 * width * second
        end = first + width * second + 0.5 * width**2 * self.third_derivatives
        return np.stack([first, middle, end])


def length_bounds(pieces: Pieces, tolerance: float) -> tuple[float, float]:
    """Return bounds on the length that differ by at most ``tolerance`` times the length.

    A part of a cubic is at least as long as its chord and at most as long as the polygon of its
    Bezier control points (Gravesen 1997, "Adaptive subdivision and the length and energy of Bezier
    curves"). Parts on which these differ too much are halved.

    Args:
        pieces: Pieces of the spline; the length is in their unit.
        tolerance: Relative tolerance.
    """
    parts, lower, upper = Subpieces.of(pieces), 0.0, 0.0
    share = tolerance / len(parts.first_derivatives)
    while True:
        # the sides of the control polygon are these, times a third of the width
        hodograph = parts.hodograph()
        chords = np.linalg.norm(hodograph.sum(axis=0), axis=-1) * parts.width / 3.0
        polygons = np.linalg.norm(hodograph, axis=-1).sum(axis=0) * parts.width / 3.0
        allowed = share * parts.width * (lower + chords.sum())
        wide = polygons - chords > allowed + _ROUNDING * polygons
        last = not wide.any() or 2 * np.count_nonzero(wide) > _MAX_LENGTH_SUBPIECES
        settled = slice(None) if last else ~wide
        lower, upper = lower + float(chords[settled].sum()), upper + float(polygons[settled].sum())
        if last:
            return lower * (1.0 - _ROUNDING), upper * (1.0 + _ROUNDING)
        parts = parts.halved(wide)


def curvature_bounds(pieces: Pieces, tolerance: float) -> tuple[float, float]:
    """Return a lower and an upper bound on the greatest curvature; the lower one is attained.

    On a part of a piece |r' x r''| is at most the greatest of its Bezier control points, and |r'|
    is at least the distance from 0 to the triangle of the control points of r'. Parts whose bound
    exceeds the greatest attained curvature are halved until the bounds differ by at most
    ``tolerance`` times the curvature, or by a turn of ``tolerance`` rad over the whole path.

    Args:
        pieces: Pieces of the spline; the curvature is in 1 over their unit.
        tolerance: Relative tolerance.

    Returns:
        The bounds; both infinite if the path comes to rest, where it may turn on the spot; both 0
        for a path of zero length.
    """
    parts = Subpieces.of(pieces)
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
        minimum = _distance_to_triangle(hodograph)
        with np.errstate(divide="ignore", invalid="ignore"):
            bounds = np.where(minimum > 0.0, crosses.max(axis=0) / minimum**3, np.inf)
        wide = bounds > max(attained * (1.0 + tolerance), attained + negligible)
        settled = max(settled, float(bounds[~wide].max(initial=0.0)))
        if not wide.any() or 2 * np.count_nonzero(wide) > _MAX_CURVATURE_SUBPIECES:
            return attained, max(settled, attained, float(bounds[wide].max(initial=0.0)))
        parts = parts.halved(wide)


def _crosses(parts: Subpieces) -> Float[Array, "3 parts"]:
    """Return the Bezier control points of r' x r'', which is quadratic on a piece."""
    d1, d2, d3, width = parts
    first = _cross(d1, d2)
    middle = first + 0.5 * width * _cross(d1, d3)
    quadratic = 0.5 * width**2 * _cross(d2, d3)
    return np.stack([first, middle, 2.0 * middle - first + quadratic])


def _cross(a: Float[Array, "*n 2"], b: Float[Array, "*n 2"]) -> Float[Array, "*n"]:
    """Return the third component of a x b."""
    cross: Float[Array, "*n"] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return cross


def _distance_to_triangle(corners: Float[Array, "3 n 2"]) -> Float[Array, " n"]:
    """Return the distance from 0 to each triangle; 0 inside."""
    ends = np.roll(corners, -1, axis=0)
    sides = ends - corners
    squares = np.einsum("kni,kni->kn", sides, sides)
    along = -np.einsum("kni,kni->kn", corners, sides) / np.where(squares > 0.0, squares, 1.0)
    nearest = corners + np.clip(along, 0.0, 1.0)[..., None] * sides
    turns = _cross(corners, ends)
    inside = (turns > 0.0).all(axis=0) | (turns < 0.0).all(axis=0)
    return np.where(inside, 0.0, np.linalg.norm(nearest, axis=-1).min(axis=0))
