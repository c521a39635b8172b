"""Distance from a curve to the squares of a grid, with proof. Lengths are in cells here."""

from __future__ import annotations

from math import ceil, floor, inf, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.maps import OccupancyGrid

_TOUCH = 1e-9  # a chord that is less than this inside a square touches it and does not enter
_STRAIGHT = 1e-10  # eight times what a piece that counts as straight may be beside its chord
_MOST_CHORDS = 65_536  # of a piece
_BLOCK = 16  # cells along a side
_LONGEST_CHORD = 4.0  # so that few squares are near one


class Floor(NamedTuple):
    """The squares to keep off.

    Attributes:
        occupied: Row i, column j is the square from (j, i) to (j + 1, i + 1).
        blocks: Whether any of 16 x 16 cells is occupied: far squares are found quickly.
        walled: Whether everything outside is occupied.
    """

    occupied: Bool[Array, "rows cols"]
    blocks: Bool[Array, "block_rows block_cols"]
    walled: bool

    @classmethod
    def of(cls, grid: OccupancyGrid) -> Floor:
        """The occupied cells of a grid."""
        rows, cols = grid.occupied.shape
        full = np.pad(grid.occupied, ((0, -rows % _BLOCK), (0, -cols % _BLOCK)))
        parts = full.reshape(len(full) // _BLOCK, _BLOCK, -1, _BLOCK)
        return cls(grid.occupied, np.logical_or.reduce(parts, axis=(1, 3)), grid.walled)


class Chord(NamedTuple):
    """The straight line from a to b; x across the columns, y across the rows."""

    ax: float
    ay: float
    bx: float
    by: float


class Piece(NamedTuple):
    """A cubic by its start a, the way c from there to its end, and its bends u and v at both.

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
def piece_at(places: Float[Array, "knots 2"], bends: Float[Array, "knots 2"], j: int) -> Piece:
    """Piece j of a spline with these places and second derivatives at its knots."""
    return Piece(
        places[j, 0],
        places[j, 1],
        places[j + 1, 0] - places[j, 0],
        places[j + 1, 1] - places[j, 1],
        bends[j, 0],
        bends[j, 1],
        bends[j + 1, 0],
        bends[j + 1, 1],
    )


@inlined
def _crosses(chord: Chord) -> bool:
    """Whether a chord enters the square of side 1 around 0 (separating axes)."""
    half = 0.5 - _TOUCH
    mx, my = 0.5 * (chord.ax + chord.bx), 0.5 * (chord.ay + chord.by)
    hx, hy = 0.5 * (chord.bx - chord.ax), 0.5 * (chord.by - chord.ay)
    if abs(mx) > half + abs(hx) or abs(my) > half + abs(hy):
        return False
    return abs(hx * my - hy * mx) <= half * (abs(hx) + abs(hy))


@inlined
def _square_of_distance(x: float, y: float, chord: Chord) -> float:
    """Square of the distance from (x, y) to a chord."""
    dx, dy = chord.bx - chord.ax, chord.by - chord.ay
    square = dx * dx + dy * dy
    along = ((x - chord.ax) * dx + (y - chord.ay) * dy) / square if square > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    gx, gy = chord.ax + along * dx - x, chord.ay + along * dy - y
    return gx * gx + gy * gy


@inlined
def _to_square(chord: Chord) -> float:
    """Distance from a chord to the square of side 1 around 0; -inf if it enters."""
    if _crosses(chord):
        return -inf
    # of two convex polygons apart, a corner of one is among the nearest points
    gx, gy = max(abs(chord.ax) - 0.5, 0.0), max(abs(chord.ay) - 0.5, 0.0)
    nearest = gx * gx + gy * gy
    gx, gy = max(abs(chord.bx) - 0.5, 0.0), max(abs(chord.by) - 0.5, 0.0)
    nearest = min(nearest, gx * gx + gy * gy)
    for x in (-0.5, 0.5):
        for y in (-0.5, 0.5):
            nearest = min(nearest, _square_of_distance(x, y, chord))
    return sqrt(nearest)


@inlined
def _cell(place: float, count: int) -> int:
    """Column or row of a place, of ``count``; the first or the last if it is outside."""
    return floor(min(max(place, 0.0), count - 1.0))


@inlined
def chord_clearance(ground: Floor, chord: Chord, limit: float) -> float:
    """Distance from a chord to the nearest occupied square no further away than ``limit``.

    ``limit`` if there is none; -inf if the chord enters a square.
    """
    rows, cols = ground.occupied.shape
    left, right = min(chord.ax, chord.bx), max(chord.ax, chord.bx)
    below, above = min(chord.ay, chord.by), max(chord.ay, chord.by)
    nearest = limit
    if ground.walled:
        edge = min(left, below, cols - right, rows - above)
        if edge < -_TOUCH:
            return -inf
        nearest = min(nearest, max(edge, 0.0))
    low, high = _cell(below - nearest, rows), _cell(above + nearest, rows)
    first, last = _cell(left - nearest, cols), _cell(right + nearest, cols)
    for i in range(low // _BLOCK, high // _BLOCK + 1):
        for j in range(first // _BLOCK, last // _BLOCK + 1):
            if not ground.blocks[i, j]:
                continue
            for row in range(max(low, i * _BLOCK), min(high, i * _BLOCK + _BLOCK - 1) + 1):
                for col in range(max(first, j * _BLOCK), min(last, j * _BLOCK + _BLOCK - 1) + 1):
                    gap = max(col - right, left - col - 1.0, row - above, below - row - 1.0)
                    if gap <= nearest and ground.occupied[row, col]:
                        x, y = col + 0.5, row + 0.5
                        moved = Chord(chord.ax - x, chord.ay - y, chord.bx - x, chord.by - y)
                        nearest = min(nearest, _to_square(moved))
    return nearest


@compiled
def chord_clearances(
    ground: Floor, polygon: Float[Array, "points 2"], limit: float
) -> Float[Array, " chords"]:
    """:func:`chord_clearance` of every side of a polygon."""
    found = np.empty(len(polygon) - 1)
    for i in range(len(found)):
        chord = Chord(polygon[i, 0], polygon[i, 1], polygon[i + 1, 0], polygon[i + 1, 1])
        found[i] = chord_clearance(ground, chord, limit)
    return found


@inlined
def _is_straight(piece: Piece) -> bool:
    """Whether a piece runs along its chord and never back.

    The Bezier control points of its slope, c - u / 3 - v / 6, c + u / 6 - v / 6 and
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
    ground: Floor, piece: Piece, tolerance: float, limit: float
) -> tuple[float, float]:
    """Lower bound on the distance from a piece to the nearest occupied square, and its excess.

    The piece is cut into chords. A part of it is no further from its chord than an eighth of its
    greatest second derivative, over the square of the number of chords. So one to seven chords a
    cell are within a hundredth of a cell, where samples and a bound on the speed would take
    seventy: that bound falls with the number, and not with its square. The hull of a part's Bezier
    control points reaches further out of the bend, a sixth instead of an eighth, and finding its
    distance from a square takes longer than a chord's.

    Args:
        ground: The squares.
        piece: The piece.
        tolerance: Distance from chord to piece that is good enough.
        limit: No square further away than this is looked at.

    Returns:
        A bound, at most ``limit``, -inf if a chord enters a square; and how far the piece is from
        its chords at most. Where the bound is less than ``limit``, the distance is at most twice
        this more.
    """
    ax, ay, cx, cy, ux, uy, vx, vy = piece
    bend = 0.0 if _is_straight(piece) else sqrt(max(ux * ux + uy * uy, vx * vx + vy * vy))
    wanted = max(sqrt(0.125 * bend / tolerance), (abs(cx) + abs(cy) + bend) / _LONGEST_CHORD)
    chords = ceil(min(max(wanted, 1.0), float(_MOST_CHORDS)))
    apart = 0.125 * bend / chords**2
    bound, x, y = limit, ax, ay
    for k in range(1, chords + 1):
        s = k / chords
        p = s * (1.0 - s) * (2.0 - s) / 6.0
        q = s * (1.0 - s) * (1.0 + s) / 6.0
        chord = Chord(x, y, ax + s * cx - p * ux - q * vx, ay + s * cy - p * uy - q * vy)
        reach = bound + apart
        nearest = chord_clearance(ground, chord, reach)
        if nearest < reach:  # else the bound stays, to the last digit
            bound = nearest - apart
        if nearest == -inf:
            break
        x, y = chord.bx, chord.by
    return bound, apart


@compiled
def piece_clearances(
    ground: Floor,
    places: Float[Array, "knots 2"],
    bends: Float[Array, "knots 2"],
    tolerance: float,
    limit: float,
) -> Float[Array, " pieces"]:
    """The bound of :func:`piece_clearance` for every piece."""
    bounds = np.empty(len(places) - 1)
    for j in range(len(bounds)):
        bounds[j], _ = piece_clearance(ground, piece_at(places, bends, j), tolerance, limit)
    return bounds


@compiled
def curve_clearance(
    ground: Floor,
    places: Float[Array, "knots 2"],
    bends: Float[Array, "knots 2"],
    tolerance: float,
) -> tuple[float, float]:
    """Bounds on the distance from the curve to the nearest occupied square.

    They differ by twice ``tolerance`` at most, unless a piece would need more chords than it gets.

    Returns:
        The bounds; both -inf if a chord enters a square, both inf if there is none.
    """
    rows, cols = ground.occupied.shape
    x, y = places[0]
    reach = abs(x) + abs(y) + rows + cols + 2.0
    limit = upper = 1.0
    while limit < 2.0 * reach:
        upper = chord_clearance(ground, Chord(x, y, x, y), limit)
        if upper < limit:
            break
        limit *= 2.0
    if upper >= reach:
        return inf, inf
    lower = upper
    for j in range(len(places) - 1):
        bound, apart = piece_clearance(ground, piece_at(places, bends, j), tolerance, upper)
        if bound == -inf:
            return -inf, -inf
        if bound < upper:
            lower, upper = min(lower, bound), min(upper, bound + 2.0 * apart)
    return lower, upper
