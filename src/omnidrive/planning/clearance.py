"""Proved distances from curves to the occupied cells of a grid; all lengths are in cells."""

from __future__ import annotations

from math import ceil, floor, inf, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.maps import OccupancyGrid

_TOUCH = 1e-9  # a chord that penetrates a square by less than this only touches it
_STRAIGHT = 1e-10  # eight times the permitted deviation of a straight piece from its chord
_MAX_CHORDS = 65_536  # per piece
_BLOCK = 16  # cells per side of a block
_LONGEST_CHORD = 4.0  # limits the number of squares near a chord


class Obstacles(NamedTuple):
    """Occupied squares of a grid.

    Attributes:
        occupied: Occupancy; row i, column j is the square from (j, i) to (j + 1, i + 1).
        blocks: Whether any of 16 x 16 cells is occupied; accelerates the search for squares.
        walled: Whether everything outside the grid is occupied.
    """

    occupied: Bool[Array, "rows cols"]
    blocks: Bool[Array, "block_rows block_cols"]
    walled: bool

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Obstacles:
        """Create the obstacles of a grid."""
        rows, cols = grid.occupied.shape
        full = np.pad(grid.occupied, ((0, -rows % _BLOCK), (0, -cols % _BLOCK)))
        parts = full.reshape(len(full) // _BLOCK, _BLOCK, -1, _BLOCK)
        return cls(grid.occupied, np.logical_or.reduce(parts, axis=(1, 3)), grid.walled)


class Chord(NamedTuple):
    """Line segment from a to b; x runs across the columns, y across the rows."""

    ax: float
    ay: float
    bx: float
    by: float


class Piece(NamedTuple):
    """Cubic piece: start a, chord vector c, and second derivatives u and v at start and end.

    See :class:`omnidrive.planning.pieces.Pieces`.
    """

    ax: float
    ay: float
    cx: float
    cy: float
    ux: float
    uy: float
    vx: float
    vy: float


@inlined
def piece_at(
    positions: Float[Array, "knots 2"], second_derivatives: Float[Array, "knots 2"], j: int
) -> Piece:
    """Return piece j of a spline from positions and second derivatives at its knots."""
    return Piece(
        positions[j, 0],
        positions[j, 1],
        positions[j + 1, 0] - positions[j, 0],
        positions[j + 1, 1] - positions[j, 1],
        second_derivatives[j, 0],
        second_derivatives[j, 1],
        second_derivatives[j + 1, 0],
        second_derivatives[j + 1, 1],
    )


@inlined
def _crosses(chord: Chord) -> bool:
    """Whether a chord enters the unit square centred at 0 (separating axis theorem)."""
    half = 0.5 - _TOUCH
    mx, my = 0.5 * (chord.ax + chord.bx), 0.5 * (chord.ay + chord.by)
    hx, hy = 0.5 * (chord.bx - chord.ax), 0.5 * (chord.by - chord.ay)
    if abs(mx) > half + abs(hx) or abs(my) > half + abs(hy):
        return False
    return abs(hx * my - hy * mx) <= half * (abs(hx) + abs(hy))


@inlined
def _squared_distance(x: float, y: float, chord: Chord) -> float:
    """Return the squared distance from (x, y) to a chord."""
    dx, dy = chord.bx - chord.ax, chord.by - chord.ay
    square = dx * dx + dy * dy
    along = ((x - chord.ax) * dx + (y - chord.ay) * dy) / square if square > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    gx, gy = chord.ax + along * dx - x, chord.ay + along * dy - y
    return gx * gx + gy * gy


@inlined
def _distance_to_square(chord: Chord) -> float:
    """Return the distance from a chord to the unit square centred at 0; -inf if it enters."""
    if _crosses(chord):
        return -inf
    # the distance of two disjoint convex polygons is attained at a corner of one of them
    gx, gy = max(abs(chord.ax) - 0.5, 0.0), max(abs(chord.ay) - 0.5, 0.0)
    nearest = gx * gx + gy * gy
    gx, gy = max(abs(chord.bx) - 0.5, 0.0), max(abs(chord.by) - 0.5, 0.0)
    nearest = min(nearest, gx * gx + gy * gy)
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            nearest = min(nearest, _squared_distance(x, y, chord))
    return sqrt(nearest)


@inlined
def _cell(coordinate: float, count: int) -> int:
    """Return the column or row of a coordinate, clamped to 0 ... ``count`` - 1."""
    return floor(min(max(coordinate, 0.0), count - 1.0))


@inlined
def chord_clearance(obstacles: Obstacles, chord: Chord, limit: float) -> float:
    """Return the distance from a chord to the nearest occupied square, at most ``limit``.

    -inf if the chord enters an occupied square.
    """
    rows, cols = obstacles.occupied.shape
    left, right = min(chord.ax, chord.bx), max(chord.ax, chord.bx)
    below, above = min(chord.ay, chord.by), max(chord.ay, chord.by)
    nearest = limit
    if obstacles.walled:
        edge = min(left, below, cols - right, rows - above)
        if edge < -_TOUCH:
            return -inf
        nearest = min(nearest, max(edge, 0.0))
    low, high = _cell(below - nearest, rows), _cell(above + nearest, rows)
    first, last = _cell(left - nearest, cols), _cell(right + nearest, cols)
    for i in range(low // _BLOCK, high // _BLOCK + 1):
        for j in range(first // _BLOCK, last // _BLOCK + 1):
            if not obstacles.blocks[i, j]:
                continue
            for row in range(max(low, i * _BLOCK), min(high, i * _BLOCK + _BLOCK - 1) + 1):
                for col in range(max(first, j * _BLOCK), min(last, j * _BLOCK + _BLOCK - 1) + 1):
                    gap = max(col - right, left - col - 1.0, row - above, below - row - 1.0)
                    if gap <= nearest and obstacles.occupied[row, col]:
                        x, y = col + 0.5, row + 0.5
                        shifted = Chord(chord.ax - x, chord.ay - y, chord.bx - x, chord.by - y)
                        nearest = min(nearest, _distance_to_square(shifted))
    return nearest


@compiled
def chord_clearances(
    obstacles: Obstacles, polygon: Float[Array, "points 2"], limit: float
) -> Float[Array, " chords"]:
    """Return :func:`chord_clearance` of every edge of a polygon."""
    found = np.empty(len(polygon) - 1)
    for i in range(len(found)):
        chord = Chord(polygon[i, 0], polygon[i, 1], polygon[i + 1, 0], polygon[i + 1, 1])
        found[i] = chord_clearance(obstacles, chord, limit)
    return found


@inlined
def _is_straight(piece: Piece) -> bool:
    """Whether a piece lies on its chord and never reverses.

    The Bezier control points of its first derivative, c - u / 3 - v / 6, c + u / 6 - v / 6 and
    c + u / 6 + v / 3, must point along the chord.
    """
    cx, cy, ux, uy, vx, vy = piece[2:]
    near = _STRAIGHT * (abs(cx) + abs(cy))
    if abs(cx * uy - cy * ux) > near or abs(cx * vy - cy * vx) > near:
        return False
    square, u, v = cx * cx + cy * cy, (cx * ux + cy * uy) / 6.0, (cx * vx + cy * vy) / 6.0
    slowest = square + min(-2.0 * u - v, u - v, u + 2.0 * v)
    return square > 0.0 and slowest >= -_STRAIGHT * square


@inlined
def piece_clearance(
    obstacles: Obstacles, piece: Piece, tolerance: float, limit: float
) -> tuple[float, float]:
    """Return a lower bound on the distance from a piece to the nearest occupied square.

    The piece is approximated by chords. The deviation of the piece from n chords is at most an
    eighth of the greatest second derivative divided by n^2. One to seven chords per cell are
    therefore accurate to 0.01 cells; samples with a bound on the speed, whose error falls with n
    only, would need seventy. The hull of the Bezier control points deviates by a sixth instead of
    an eighth, and its distance from a square takes longer to compute than that of a chord.

    Args:
        obstacles: The occupied squares.
        piece: The piece.
        tolerance: Permitted deviation of the piece from its chords.
        limit: Distance beyond which squares are ignored.

    Returns:
        The lower bound, at most ``limit``, -inf if a chord enters a square; and the greatest
        deviation of the piece from its chords. A bound below ``limit`` is exceeded by the true
        distance by at most twice this deviation.
    """
    ax, ay, cx, cy, ux, uy, vx, vy = piece
    second = 0.0 if _is_straight(piece) else sqrt(max(ux * ux + uy * uy, vx * vx + vy * vy))
    needed = max(sqrt(0.125 * second / tolerance), (abs(cx) + abs(cy) + second) / _LONGEST_CHORD)
    chords = ceil(min(max(needed, 1.0), float(_MAX_CHORDS)))
    deviation = 0.125 * second / chords**2
    bound, x, y = limit, ax, ay
    for k in range(1, chords + 1):
        s = k / chords
        p = s * (1.0 - s) * (2.0 - s) / 6.0
        q = s * (1.0 - s) * (1.0 + s) / 6.0
        chord = Chord(x, y, ax + s * cx - p * ux - q * vx, ay + s * cy - p * uy - q * vy)
        reach = bound + deviation
        nearest = chord_clearance(obstacles, chord, reach)
        if nearest < reach:  # otherwise the bound is left unchanged, free of rounding
            bound = nearest - deviation
        if nearest == -inf:
            break
        x, y = chord.bx, chord.by
    return bound, deviation


@compiled
def piece_clearances(
    obstacles: Obstacles,
    positions: Float[Array, "knots 2"],
    second_derivatives: Float[Array, "knots 2"],
    tolerance: float,
    limit: float,
) -> Float[Array, " pieces"]:
    """Return the bound of :func:`piece_clearance` for every piece."""
    bounds = np.empty(len(positions) - 1)
    for j in range(len(bounds)):
        bounds[j], _ = piece_clearance(
            obstacles, piece_at(positions, second_derivatives, j), tolerance, limit
        )
    return bounds


@compiled
def curve_clearance(
    obstacles: Obstacles,
    positions: Float[Array, "knots 2"],
    second_derivatives: Float[Array, "knots 2"],
    tolerance: float,
) -> tuple[float, float]:
    """Return bounds on the distance from the curve to the nearest occupied square.

    The bounds differ by at most twice ``tolerance``, unless a piece would need more than the
    greatest number of chords. Both are -inf if a chord enters a square, and inf if no square is
    occupied.
    """
    rows, cols = obstacles.occupied.shape
    x, y = positions[0]
    reach = abs(x) + abs(y) + rows + cols + 2.0
    limit = upper = 1.0
    while limit < 2.0 * reach:
        upper = chord_clearance(obstacles, Chord(x, y, x, y), limit)
        if upper < limit:
            break
        limit *= 2.0
    if upper >= reach:
        return inf, inf
    lower = upper
    for j in range(len(positions) - 1):
        bound, deviation = piece_clearance(
            obstacles, piece_at(positions, second_derivatives, j), tolerance, upper
        )
        if bound == -inf:
            return -inf, -inf
        if bound < upper:
            lower, upper = min(lower, bound), min(upper, bound + 2.0 * deviation)
    return lower, upper
