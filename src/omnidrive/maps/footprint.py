"""Cells of a grid covered by a robot's footprint, and inflation by the footprint."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled

_TOUCH = 1e-9  # side lengths of a cell; an edge that enters a square by less only touches it


def covered_runs(polygon: Float[Array, "corners 2"], rows: int, cols: int) -> Int[Array, "runs 3"]:
    """Return the cells of a grid that a polygon covers wholly or in part, as runs along the rows.

    A cell is covered if an edge of the polygon passes through the interior of its square or its
    centre lies inside the polygon; contact alone does not count. Points with a non-zero winding
    number are inside (Sunday 2001, "Inclusion of a point in a polygon"), so an area that the
    polygon encloses twice in the same direction is no hole.

    Args:
        polygon: Corners (row, column) in cells, relative to the centre of cell (0, 0).
        rows: Only cells in the rows -rows to rows are returned.
        cols: Only cells in the columns -cols to cols are returned.

    Returns:
        Row, first and last column (included) of each run of adjacent covered cells.
    """
    lowest, highest = np.floor(polygon.min(axis=0) + 0.5), np.ceil(polygon.max(axis=0) - 0.5)
    bottom, left = np.clip(lowest, (-rows, -cols), (rows, cols)).astype(int).tolist()
    top, right = np.clip(highest, (-rows, -cols), (rows, cols)).astype(int).tolist()
    columns = np.arange(left, right + 1)
    runs = [np.empty((0, 3), np.int64)]
    for row in range(bottom, top + 1):
        covered = _covered(polygon, row, columns)
        ends = np.flatnonzero(np.diff(np.concatenate([[False], covered, [False]])))
        first, last = columns[ends[::2]], columns[ends[1::2] - 1]
        runs.append(np.column_stack([np.full(len(first), row), first, last]))
    return np.concatenate(runs)


def _covered(
    polygon: Float[Array, "corners 2"], row: int, columns: Int[Array, " columns"]
) -> Bool[Array, " columns"]:
    """Whether the polygon covers the cell of each column in one row."""
    crossed = np.zeros(len(columns), bool)
    winding = np.zeros(len(columns), int)
    for (v0, u0), (v1, u1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crossed |= _crosses((v0, u0), (v1, u1), row, columns)
        if (v0 <= row) != (v1 <= row):  # the edge crosses the line through the centres at ``u``
            u = u0 + (row - v0) / (v1 - v0) * (u1 - u0)
            winding += np.where(columns < u, 1 if v1 > v0 else -1, 0)
    inside: Bool[Array, " columns"] = crossed | (winding != 0)
    return inside


def _crosses(
    start: tuple[float, float], end: tuple[float, float], row: int, columns: Int[Array, " columns"]
) -> Bool[Array, " columns"]:
    """Whether an edge passes through the interior of the cell of each column in one row.

    It does if the part of the edge within the row overlaps the part within the column; the parts
    are intervals of the edge parameter, 0 at ``start`` and 1 at ``end`` (Liang & Barsky 1984, "A
    new concept and method for line clipping").
    """
    half = 0.5 - _TOUCH
    first, last = np.zeros(len(columns)), np.ones(len(columns))
    for begin, stop, middle in ((start[0], end[0], row), (start[1], end[1], columns)):
        along = stop - begin
        near, far = middle - half - begin, middle + half - begin
        if along == 0.0:  # parallel: within as a whole or not at all (first > last)
            first = np.where((near < 0.0) & (far > 0.0), first, 2.0)
        else:
            with np.errstate(over="ignore"):  # a nearly parallel edge: infinity is right
                enter, leave = near / along, far / along
            first = np.maximum(first, np.minimum(enter, leave))
            last = np.minimum(last, np.maximum(enter, leave))
    return first < last


@compiled
def _mark(out: Bool[Array, " cols"], ahead: Int[Array, " cols"], maximum: int) -> None:
    """Set ``out`` to True where the next occupied cell is at most ``maximum`` columns ahead."""
    for col in range(len(out)):
        out[col] |= ahead[col] <= maximum


@compiled
def footprint_hits(
    occupied: Bool[Array, "rows cols"], outside: bool, runs: Int[Array, "runs 3"]
) -> Bool[Array, "rows cols"]:
    """Return for each cell whether the runs, placed relative to it, cover an occupied cell.

    Args:
        occupied: Occupancy of the grid.
        outside: Whether everything outside the grid counts as occupied.
        runs: Row, first and last column (included) of each run, relative to the cell.
    """
    rows, cols = occupied.shape
    ahead = np.empty((rows, cols), np.int32)  # columns to the next occupied cell, 0 at one
    for row in range(rows):
        steps = 0 if outside else 2 * cols + 1
        for col in range(cols - 1, -1, -1):
            steps = 0 if occupied[row, col] else steps + 1
            ahead[row, col] = steps
    out = np.zeros((rows, cols), np.bool_)
    for row in range(rows):
        for k in range(len(runs)):
            run_row, first, last = row + runs[k, 0], runs[k, 1], runs[k, 2]
            if not 0 <= run_row < rows:
                if outside:
                    out[row] = True
                continue
            # the run starts in the grid
            begin, end = max(-first, 0), min(cols - first, cols)
            if begin < end:
                _mark(
                    out[row, begin:end], ahead[run_row, begin + first : end + first], last - first
                )
            # the run starts left of the grid
            for col in range(min(max(-first, 0), cols)):
                out[row, col] |= outside or ahead[run_row, 0] <= col + last
            # the run starts right of the grid
            for col in range(max(min(cols - first, cols), 0), cols):
                out[row, col] |= outside
    return out
