"""The cubic pieces of a clamped uniform B-spline."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array


class KnotWeights(NamedTuple):
    """What the spline is at knot j, as sums over the control points j, j + 1 and j + 2.

    Attributes:
        places: Weights of its place.
        bends: Weights of its second derivative.
    """

    places: Float[Array, "knots 3"]
    bends: Float[Array, "knots 3"]


class Pieces(NamedTuple):
    """A spline by what it is at its knots, which are 1 apart.

    Piece j runs from knot j to knot j + 1. For s in [0, 1] it is, since its second derivative is
    linear (de Boor, "A Practical Guide to Splines", ch. IV),

        (1 - s) p_j + s p_{j+1} - s (1 - s) / 6 ((2 - s) b_j + (1 + s) b_{j+1})

    with the places p and the second derivatives b. It is therefore never further from the point
    at s of its chord than max(|b_j|, |b_{j+1}|) / 8.

    Attributes:
        places: Places.
        slopes: First derivatives.
        bends: Second derivatives.
    """

    places: Float[Array, "knots 2"]
    slopes: Float[Array, "knots 2"]
    bends: Float[Array, "knots 2"]

    def piece(self, j: int) -> Pieces:
        """Piece j alone."""
        return Pieces(*(values[j : j + 2] for values in self))

    def at(self, s: Float[Array, " samples"]) -> Float[Array, "pieces samples 2"]:
        """Places at ``s`` in [0, 1] of every piece."""
        s = s[:, None]
        chord = (1.0 - s) * self.places[:-1, None] + s * self.places[1:, None]
        bend = (2.0 - s) * self.bends[:-1, None] + (1.0 + s) * self.bends[1:, None]
        places: Float[Array, "pieces samples 2"] = chord - s * (1.0 - s) / 6.0 * bend
        return places


def knot_weights(control_points: int) -> KnotWeights:
    """Weights of a clamped uniform cubic B-spline (de Boor, ch. IX and X)."""
    knots = _Knots.of(control_points)
    places = np.stack([knots.first, 1.0 - knots.first - knots.third, knots.third], axis=1)
    first, third = 6.0 / (knots.gap * knots.wide[:-1]), 6.0 / (knots.gap * knots.wide[1:])
    return KnotWeights(places, np.stack([first, -first - third, third], axis=1))


def pieces(control_points: Float[Array, "points 2"]) -> Pieces:
    """The pieces of the clamped uniform cubic B-spline with these control points.

    Computed from their differences: the slope is exactly 0 where three of them coincide.
    """
    knots = _Knots.of(len(control_points))
    first, third, gap, after = (
        values[:, None] for values in (knots.first, knots.third, knots.gap, knots.after)
    )
    steps = np.diff(control_points, axis=0)
    places = control_points[1:-1] - first * steps[:-1] + third * steps[1:]
    places[0], places[-1] = control_points[0], control_points[-1]
    rates = 3.0 * steps / knots.wide[:, None]
    slopes = (after * rates[:-1] + (gap - after) * rates[1:]) / gap
    return Pieces(places, slopes, 2.0 * np.diff(rates, axis=0) / gap)


class _Knots(NamedTuple):
    """Distances between knots, and what they say of the place at each knot.

    Attributes:
        first: Weight of control point j in the place at knot j.
        third: Weight of control point j + 2 in it.
        gap: From the knot before to the knot after.
        after: From the knot to the one after.
        wide: Over the three intervals on which two neighbouring control points act together.
    """

    first: Float[Array, " knots"]
    third: Float[Array, " knots"]
    gap: Float[Array, " knots"]
    after: Float[Array, " knots"]
    wide: Float[Array, " steps"]

    @classmethod
    def of(cls, control_points: int) -> _Knots:
        """Knots 1 apart, the ends' four times."""
        last = control_points - 3.0
        t = np.concatenate([[0.0] * 3, np.arange(control_points - 2), [last] * 3])
        wide = t[4:-1] - t[1:-4]
        before, here, following = t[2:-4], t[3:-3], t[4:-2]
        gap, after = following - before, following - here
        first = after**2 / (gap * wide[:-1])
        third = (here - before) ** 2 / (gap * wide[1:])
        return cls(first, third, gap, after, wide)
