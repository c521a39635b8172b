"""Basis matrices of clamped uniform cubic B-splines."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.arrays import Array


def spline_basis(points: int) -> BSpline:
    """Return all basis functions for ``points`` control points; s increases by 1 on each piece."""
    pieces = points - 3
    knots = np.concatenate([[0.0] * 3, np.arange(pieces + 1.0), [pieces] * 3])
    return BSpline(knots, np.eye(points), 3)


def bezier_basis(points: int) -> Float[Array, "bezier points"]:
    """Return the matrix that maps a spline's control points to the Bezier points of its pieces.

    Piece k has the Bezier points 3 k to 3 k + 3: its ends, and the points a third of the end
    derivatives from there (Farin, "Curves and surfaces for CAGD", ch. 5). The piece is within their
    convex hull, which is within that of its control points.
    """
    basis, nodes = spline_basis(points), np.arange(points - 2.0)
    ends, thirds = basis(nodes), basis.derivative()(nodes) / 3.0
    bezier = np.empty((3 * len(nodes) - 2, points))
    bezier[::3] = ends
    bezier[1::3], bezier[2::3] = (ends + thirds)[:-1], (ends - thirds)[1:]
    return bezier
