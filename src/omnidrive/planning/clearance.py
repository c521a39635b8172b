"""Distance from a curve to the squares of a grid, with proof. Lengths are in cells here."""

from __future__ import annotations

from math import ceil, floor, inf, sqrt

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.compiled import compiled, inlined

Array = np.ndarray

TOUCH = 1e-9  # a chord that is less than this inside a square touches it and does not enter
_STRAIGHT = 1e-10  # eight times what a piece that counts as straight is beside its chord, in cells
_MOST_CHORDS = 65_536  # of a piece
_LONGEST_CHORD = 4.0  # so that few squares are near one


@inlined
def _crosses(ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether the chord from a to b enters the square of side 1 around 0 (separating axes)."""
    half = 0.5 - TOUCH
    mx, my, hx, hy = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (bx - ax), 0.5 * (by - ay)
    if abs(mx) > half + abs(hx) or abs(my) > half + abs(hy):
        return False
    return abs(hx * my - hy * mx) <= half * (abs(hx) + abs(hy))


@inlined
def _square_of_distance(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Square of the distance from (x, y) to the chord from a to b."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    along = ((x - ax) * dx + (y - ay) * dy) / square if square > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    gx, gy = ax + along * dx - x, ay + along * dy - y
    return gx * gx + gy * gy


@inlined
def _to_square(ax: float, ay: float, bx: float, by: float) -> float:
    """Distance from the chord from a to b to the square of side 1 around 0; -inf inside."""
    if _crosses(ax, ay, bx, by):
        return -inf
    # of two convex polygons apart, a corner of one is among the nearest points
    gx, gy = max(abs(ax) - 0.5, 0.0), max(abs(ay) - 0.5, 0.0)
    nearest = gx * gx + gy * gy
    gx, gy = max(abs(bx) - 0.5, 0.0), max(abs(by) - 0.5, 0.0)
    nearest = min(nearest, gx * gx + gy * gy)
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            nearest = min(nearest, _square_of_distance(x, y, ax, ay, bx, by))
    return sqrt(nearest)


@inlined
def chord_clearance(
    occupied: Bool[Array, "rows cols"], walled: bool,
    ax: float, ay: float, bx: float, by: float, limit: float,
) -> float:  # fmt: skip
    """Distance from the chord from a to b to the nearest occupied square, in cells.

    Args:
        occupied: The cells; row i, column j is the square from (j, i) to (j + 1, i + 1).
        walled: Whether everything outside is occupied.
        ax: Place of a across the columns, in cells; ``ay`` across the rows, ``bx`` and ``by`` of b.
        limit: No square further away than this is looked at.

    Returns:
        The distance, or ``limit`` if it is not less; -inf if the chord enters a square.
    """
    rows, cols = occupied.shape
    left, right, below, above = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
    if walled and (left < -TOUCH or below < -TOUCH or right > cols + TOUCH or above > rows + TOUCH):
        return -inf
    # of the squares outside, one in the ring around the grid is nearest
    first = int(floor(min(max(left - limit, -1.0), float(cols))))
    last = int(floor(min(max(right + limit, -1.0), float(cols))))
    lowest = int(floor(min(max(below - limit, -1.0), float(rows))))
    highest = int(floor(min(max(above + limit, -1.0), float(rows))))
    nearest = limit
    for row in range(lowest, highest + 1):
        for col in range(first, last + 1):
            outside = row < 0 or col < 0 or row >= rows or col >= cols
            if walled if outside else occupied[row, col]:
                across, along = max(col - right, left - col - 1.0), max(row - above, below - row - 1.0)
                if max(across, along) < nearest or nearest <= 0.0:
                    x, y = col + 0.5, row + 0.5
                    nearest = min(nearest, _to_square(ax - x, ay - y, bx - x, by - y))
    return nearest


@inlined
def _is_straight(cx: float, cy: float, ux: float, uy: float, vx: float, vy: float) -> bool:
    """Whether a piece runs along its chord c and never back; u and v are its bends.

    The Bezier control points of its slope, c - u / 3 - v / 6, c + u / 6 - v / 6 and
    c + u / 6 + v / 3, must point along the chord.
    """
    near = _STRAIGHT * (abs(cx) + abs(cy))
    if abs(cx * uy - cy * ux) > near or abs(cx * vy - cy * vx) > near:
        return False
    square, u, v = cx * cx + cy * cy, (cx * ux + cy * uy) / 6.0, (cx * vx + cy * vy) / 6.0
    slowest = square + min(-2.0 * u - v, u - v, u + 2.0 * v)
    return square > 0.0 and slowest >= -_STRAIGHT * square


@inlined
def piece_clearance(
    occupied: Bool[Array, "rows cols"], walled: bool,
    points: Float[Array, "knots 2"], bends: Float[Array, "knots 2"], j: int,
    tolerance: float, limit: float,
) -> tuple[float, float]:  # fmt: skip
    """Lower bound on the distance from piece j to the nearest occupied square, and its excess.

    The piece is cut into chords. A part of it is no further from its chord than the greatest
    second derivative allows (see :class:`Pieces`): an eighth of it, over the square of the number
    of chords. One to seven chords per cell bring that under a hundredth of a cell, where samples
    and a bound on the speed would take seventy: that bound falls only with the number itself. The
    hull of a piece's Bezier control points is no wider than needed only after as many cuts.

    Args:
        occupied: As in :func:`chord_clearance`, with ``walled`` and ``limit``.
        walled: See there.
        points: Places at the knots, in cells.
        bends: Second derivatives at the knots, in cells.
        j: Number of the piece.
        tolerance: Distance from chord to piece that is good enough, in cells.
        limit: See there.

    Returns:
        A bound, at most ``limit``, -inf if a chord enters a square; and how far the piece is from
        its chords at most: where the bound is less than ``limit``, the distance is at most twice
        this more.
    """
    ax, ay = points[j]
    cx, cy = points[j + 1, 0] - ax, points[j + 1, 1] - ay
    ux, uy, vx, vy = bends[j, 0], bends[j, 1], bends[j + 1, 0], bends[j + 1, 1]
    span = abs(cx) + abs(cy)
    bend = 0.0 if _is_straight(cx, cy, ux, uy, vx, vy) else sqrt(max(ux**2 + uy**2, vx**2 + vy**2))
    wanted = max(sqrt(0.125 * bend / tolerance), (span + bend) / _LONGEST_CHORD)
    chords = int(ceil(min(max(wanted, 1.0), float(_MOST_CHORDS))))
    apart = 0.125 * bend / chords**2
    bound = limit
    for k in range(1, chords + 1):
        s = k / chords
        t = 1.0 - s
        p, q = s * t * (1.0 + t) / 6.0, s * t * (1.0 + s) / 6.0
        bx = points[j, 0] + s * cx - p * ux - q * vx
        by = points[j, 1] + s * cy - p * uy - q * vy
        bound = min(
            bound, chord_clearance(occupied, walled, ax, ay, bx, by, bound + apart) - apart
        )
        if bound == -inf:
            break
        ax, ay = bx, by
    return bound, apart


@compiled
def piece_clearances(
    occupied: Bool[Array, "rows cols"], walled: bool,
    points: Float[Array, "knots 2"], bends: Float[Array, "knots 2"],
    tolerance: float, limit: float,
) -> Float[Array, "pieces 2"]:  # fmt: skip
    """:func:`piece_clearance` of every piece."""
    bounds = np.empty((len(points) - 1, 2))
    for j in range(len(bounds)):
        bounds[j] = piece_clearance(occupied, walled, points, bends, j, tolerance, limit)
    return bounds


@compiled
def curve_clearance(
    occupied: Bool[Array, "rows cols"], walled: bool,
    points: Float[Array, "knots 2"], bends: Float[Array, "knots 2"], tolerance: float,
) -> tuple[float, float]:  # fmt: skip
    """Bounds on the distance from the curve to the nearest occupied square, in cells.

    They differ by twice ``tolerance``, unless a piece would need more chords than are looked at.

    Args:
        occupied: As in :func:`piece_clearance`, with the others.
        walled: See there.
        points: See there.
        bends: See there.
        tolerance: See there.

    Returns:
        The bounds; both -inf if the curve enters a square, both inf if there is none.
    """
    rows, cols = occupied.shape
    x, y = points[0]
    reach = abs(x) + abs(y) + rows + cols + 2.0
    limit = upper = 1.0
    while limit < 2.0 * reach:
        upper = chord_clearance(occupied, walled, x, y, x, y, limit)
        if upper < limit:
            break
        limit *= 2.0
    if upper >= reach:
        return inf, inf
    lower = upper
    for j in range(len(points) - 1):
        bound, apart = piece_clearance(occupied, walled, points, bends, j, tolerance, upper)
        if bound == -inf:
            return -inf, -inf
        if bound < upper:
            lower, upper = min(lower, bound), min(upper, bound + 2.0 * apart)
    return lower, upper
