"""Basis matrices of clamped uniform cubic B-splines."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.arrays import Array


def spline_basis(points: int) -> BSpline:
    """Return the basis functions for a number of control points, at least 4, as one function.

    It maps the spline parameter s to one basis value per control point. s is 0 at the beginning,
    increases by 1 on each piece and is ``points - 3`` at the end.
    """
    pieces = points - 3
    knots = np.concatenate([[0.0] * 3, np.arange(pieces + 1.0), [pieces] * 3])
    return BSpline(knots, np.eye(points), 3)


def bezier_basis(points: int) -> Float[Array, "bezier points"]:
    """Return the matrix that maps a spline's control points to the Bezier points of its pieces.

    Piece k has the Bezier points 3 k to 3 k + 3. The outer two are the ends of the piece. The inner
    two differ from the nearer end by a third of the derivative with respect to s there (Farin,
    "Curves and surfaces for CAGD", ch. 5). The piece is within the convex hull of its Bezier
    points, which is within that of its control points.
    """
    basis, nodes = spline_basis(points), np.arange(points - 2.0)
    ends, thirds = basis(nodes), basis.derivative()(nodes) / 3.0
    bezier = np.empty((3 * len(nodes) - 2, points))
    bezier[::3] = ends
    bezier[1::3], bezier[2::3] = (ends + thirds)[:-1], (ends - thirds)[1:]
    return bezier
