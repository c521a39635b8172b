"""Curvature of a spline and its change with the arc length."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.planning.pieces import Pieces

_SHARES = np.linspace(0.0, 1.0, 9)
_ZOOMS, _NEAR = 8, 0.97
"""Number of times that the neighbourhood of a peak is divided, and share of the greatest sample
from which a sample is taken for a neighbour of the peak."""


def curvature_and_rate(
    curve: Pieces, piece: Int[Array, " n"], s: Float[Array, " n"]
) -> Float[Array, "2 n"]:
    """Return |k| and |dk/dl| of the signed curvature k over the arc length l, at s in [0, 1].

    With derivatives r', r'', r''' with respect to the parameter, k = r' x r'' / |r'|^3 and dk/dl =
    (r' x r''' |r'|^2 - 3 (r' x r'') (r' . r'')) / |r'|^6. Both are infinite where the path comes to
    rest. The unit is 1 over that of the curve, and its square.
    """
    b = curve.second_derivatives[piece]
    third = curve.second_derivatives[piece + 1] - b
    at = s[:, None]
    first = curve.first_derivatives[piece] + at * (b + 0.5 * at * third)
    second = b + at * third
    square = (first**2).sum(axis=1)
    turn = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    change = first[:, 0] * third[:, 1] - first[:, 1] * third[:, 0]
    rise = change * square - 3.0 * turn * (first * second).sum(axis=1)
    moves = square > 1e-18 * square.max(initial=0.0)
    safe = np.where(moves, square, 1.0)
    values = np.stack([turn / safe**1.5, rise / safe**3])
    return np.where(moves, np.abs(values), np.inf)


def curvature_peaks(curve: Pieces) -> Float[Array, "2 pieces"]:
    """Return the greatest |k| and |dk/dl| of each piece at nine points."""
    count = len(curve.positions) - 1
    piece, s = np.repeat(np.arange(count), len(_SHARES)), np.tile(_SHARES, count)
    peaks: Float[Array, "2 pieces"] = (
        curvature_and_rate(curve, piece, s).reshape(2, count, -1).max(axis=2)
    )
    return peaks


def max_curvature_rate(curve: Pieces) -> float:
    """Return the greatest |dk/dl|, by dividing the neighbourhoods of the greatest samples."""
    count = len(curve.positions) - 1
    piece, s = np.repeat(np.arange(count), len(_SHARES)), np.tile(_SHARES, count)
    values = curvature_and_rate(curve, piece, s)[1]
    greatest = float(values.max())
    if not 0.0 < greatest < np.inf:
        return greatest
    near = values >= _NEAR * greatest
    piece, s, width = piece[near], s[near], float(_SHARES[1])
    for _ in range(_ZOOMS):
        around = np.clip(s[:, None] + width * np.linspace(-1.0, 1.0, len(_SHARES)), 0.0, 1.0)
        found = curvature_and_rate(curve, np.repeat(piece, len(_SHARES)), around.ravel())[1]
        found = found.reshape(around.shape)
        s = around[np.arange(len(s)), found.argmax(axis=1)]
        greatest, width = max(greatest, float(found.max())), 2.0 * width / (len(_SHARES) - 1)
    return greatest
