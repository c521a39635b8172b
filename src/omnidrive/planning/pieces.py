"""Cubic pieces of a clamped uniform B-spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array


class KnotWeights(NamedTuple):
    """Weights of the control points j, j + 1 and j + 2 in the values of the spline at knot j.

    Attributes:
        positions: Weights for the position.
        second_derivatives: Weights for the second derivative.
    """

    positions: Float[Array, "knots 3"]
    second_derivatives: Float[Array, "knots 3"]


class Pieces(NamedTuple):
    """Values and derivatives of a cubic spline at its knots, which have distance 1.

    Piece j runs from knot j to knot j + 1. Its second derivative is linear, so for s in [0, 1] it
    is (de Boor, "A Practical Guide to Splines", ch. IV)

        (1 - s) p_j + s p_{j+1} - s (1 - s) / 6 ((2 - s) b_j + (1 + s) b_{j+1})

    with the positions p and the second derivatives b. Its distance from the point at s of its chord
    is therefore at most max(|b_j|, |b_{j+1}|) / 8.

    Attributes:
        positions: Positions at the knots.
        first_derivatives: First derivatives at the knots.
        second_derivatives: Second derivatives at the knots.
    """

    positions: Float[Array, "knots 2"]
    first_derivatives: Float[Array, "knots 2"]
    second_derivatives: Float[Array, "knots 2"]

    def piece(self, j: int) -> Pieces:
        """Return piece j."""
        return Pieces(*(values[j : j + 2] for values in self))

    def at(self, s: Float[Array, " samples"]) -> Float[Array, "pieces samples 2"]:
        """Evaluate every piece at ``s`` in [0, 1]."""
        s = s[:, None]
        chord = (1.0 - s) * self.positions[:-1, None] + s * self.positions[1:, None]
        second = self.second_derivatives
        bend = (2.0 - s) * second[:-1, None] + (1.0 + s) * second[1:, None]
        positions: Float[Array, "pieces samples 2"] = chord - s * (1.0 - s) / 6.0 * bend
        return positions


def knot_weights(control_points: int) -> KnotWeights:
    """Return the weights of a clamped uniform cubic B-spline (de Boor, ch. IX and X)."""
    knots = _Knots.of(control_points)
    positions = np.stack([knots.first, 1.0 - knots.first - knots.third, knots.third], axis=1)
    first, third = 6.0 / (knots.gap * knots.wide[:-1]), 6.0 / (knots.gap * knots.wide[1:])
    return KnotWeights(positions, np.stack([first, -first - third, third], axis=1))


def pieces(control_points: Float[Array, "points 2"]) -> Pieces:
    """Return the pieces of the clamped uniform cubic B-spline with these control points.

    The computation uses differences of control points, so that the first derivative is exactly 0
    where three control points coincide.
    """
    knots = _Knots.of(len(control_points))
    first, third, gap, after = (
        values[:, None] for values in (knots.first, knots.third, knots.gap, knots.after)
    )
    steps = np.diff(control_points, axis=0)
    positions = control_points[1:-1] - first * steps[:-1] + third * steps[1:]
    positions[0], positions[-1] = control_points[0], control_points[-1]
    rates = 3.0 * steps / knots.wide[:, None]
    first_derivatives = (after * rates[:-1] + (gap - after) * rates[1:]) / gap
    return Pieces(positions, first_derivatives, 2.0 * np.diff(rates, axis=0) / gap)


class _Knots(NamedTuple):
    """Distances between knots, and the weights of the control points that follow from them.

    Attributes:
        first: Weight of control point j in the position at knot j.
        third: Weight of control point j + 2 in the position at knot j.
        gap: Distance from the previous to the next knot.
        after: Distance from the knot to the next knot.
        wide: Length of the three intervals that two consecutive control points share.
    """

    first: Float[Array, " knots"]
    third: Float[Array, " knots"]
    gap: Float[Array, " knots"]
    after: Float[Array, " knots"]
    wide: Float[Array, " steps"]

    @classmethod
    def of(cls, control_points: int) -> _Knots:
        """Create knots of distance 1, with fourfold end knots."""
        last = control_points - 3.0
        t = np.concatenate([[0.0] * 3, np.arange(control_points - 2), [last] * 3])
        wide = t[4:-1] - t[1:-4]
        before, here, following = t[2:-4], t[3:-3], t[4:-2]
        gap, after = following - before, following - here
        first = after**2 / (gap * wide[:-1])
        third = (here - before) ** 2 / (gap * wide[1:])
        return cls(first, third, gap, after, wide)
