"""Basis of clamped uniform cubic B-splines, as matrices on their control points."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from omnidrive.arrays import Array


def spline_basis(points: int) -> BSpline:
    """All basis functions of splines of ``points`` control points; s grows by 1 on every piece."""
    pieces = points - 3
    knots = np.concatenate([[0.0] * 3, np.arange(pieces + 1.0), [pieces] * 3])
    return BSpline(knots, np.eye(points), 3)


def bezier_basis(points: int) -> Float[Array, "bezier points"]:
    """What makes the Bezier points of all pieces from the spline's control points.

    Piece k has those from 3 k to 3 k + 3: its ends, and a third of its slopes from there (Farin,
    "Curves and surfaces for CAGD", ch. 5). It lies in their convex hull, which lies in that of its
    control points.
    """
    basis, nodes = spline_basis(points), np.arange(points - 2.0)
    ends, thirds = basis(nodes), basis.derivative()(nodes) / 3.0
    bezier = np.empty((3 * len(nodes) - 2, points))
    bezier[::3] = ends
    bezier[1::3], bezier[2::3] = (ends + thirds)[:-1], (ends - thirds)[1:]
    return bezier
