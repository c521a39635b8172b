"""Exact distances to the nearest target cell, from a table of distances along the columns."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int, Int32, Int64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined

_NONE = 1 << 27  # distance in rows in a column without targets
_FAR = 2.0**30  # cells; coordinates are clamped to this
_BELOW, _ABOVE = 1, 2  # side of the nearest target; both flags if two are equally near


@compiled
def column_table(
    targets: Bool[Array, "rows cols"], outside: bool
) -> Int32[Array, "rows cols"]:  # fmt: skip
    """Return distance and side of the nearest target in the column of each cell.

    Args:
        targets: The target cells.
        outside: Whether all cells outside the grid are targets too.

    Returns:
        Four times the distance in rows, plus 1 if the target is below (towards row 0), plus 2 if
        it is above.
    """
    rows, cols = targets.shape
    table = np.empty((rows, cols), np.int32)
    below = np.full(cols, -1 if outside else -_NONE, np.int32)
    for row in range(rows):
        for col in range(cols):
            if targets[row, col]:
                below[col] = row
            table[row, col] = row - below[col]
    above = np.full(cols, rows if outside else _NONE, np.int32)
    for row in range(rows - 1, -1, -1):
        for col in range(cols):
            if targets[row, col]:
                above[col] = row
            down, up = table[row, col], above[col] - row
            side = (down <= up) * _BELOW + (up <= down) * _ABOVE
            table[row, col] = 4 * min(down, up) + side
    return table


@compiled
def square_distances(
    table: Int32[Array, "rows cols"],
    outside: bool,
    points: Float[Array, "points 2"],
    limit: float,
) -> Float[Array, " points"]:
    """Return the exact distance from each point to the square of the nearest target, in cells.

    The columns are searched outwards from the point until the distance to the column exceeds the
    least distance found.

    Args:
        table: Result of :func:`column_table`.
        outside: Whether all cells outside the grid are targets; then all points must lie inside.
        points: (row, column) in cells, relative to the grid's outer corner; finite.
        limit: Largest distance that is searched.

    Returns:
        The distances, at most ``limit``.
    """
    rows, cols = table.shape
    out = np.empty(len(points))
    for k in range(len(points)):
        v, u = points[k, 0], points[k, 1]
        row = int(min(max(np.floor(v), 0.0), rows - 1.0))
        left = int(min(max(np.floor(u), 0.0), cols - 1.0))
        right = left + 1
        best = limit * limit
        if outside:
            best = min(best, max(min(u, cols - u), 0.0) ** 2)
        while True:
            to_left = _beyond(u, left) ** 2 if left >= 0 else np.inf
            to_right = _beyond(u, right) ** 2 if right < cols else np.inf
            across = min(to_left, to_right)
            if across >= best:  # also after both sides are exhausted
                break
            col = left if to_left <= to_right else right
            left, right = left - (col == left), right + (col == right)
            best = min(best, across + _along(table[row, col], row, v) ** 2)
        out[k] = np.sqrt(best)
    return out


@inlined
def _beyond(at: float, cell: int) -> float:
    """Return the distance of a coordinate from the interval [cell, cell + 1]."""
    return max(cell - at, at - cell - 1.0, 0.0)


@inlined
def _along(entry: int, row: int, v: float) -> float:
    """Return the distance along a column from ``v``, in or next to ``row``, to the target."""
    steps = entry >> 2
    if steps > _NONE // 2:
        return np.inf
    below = _beyond(v, row - steps) if entry & _BELOW else np.inf
    above = _beyond(v, row + steps) if entry & _ABOVE else np.inf
    return min(below, above)


def disc_reach(radius: float, steps: int) -> Int64[Array, " _"]:
    """Return the half-width in columns of a disc of ``radius`` (cells), by distance in rows.

    The square of a cell m rows and n columns away has the distance hypot(max(m - 1/2, 0),
    max(n - 1/2, 0)) cells from the centre of the disc. A distance that equals the radius to 12
    digits counts as contact, not as overlap.

    Returns:
        The greatest n of an overlapped square for m = 0, 1, ..., at most ``steps`` entries.
    """
    rest = (
        2.0 * radius * (2.0 * radius) * (1.0 - 1e-12)
        - np.maximum(2.0 * np.arange(steps) - 1.0, 0.0) ** 2
    )
    reach = np.ceil(0.5 * np.sqrt(rest[rest > 0.0]) + 0.5) - 1.0
    columns: Int64[Array, " _"] = np.minimum(reach, 2.0**40).astype(np.int64)
    return columns


@compiled
def within_reach(
    table: Int32[Array, "rows cols"], outside: bool, reach: Int[Array, " steps"]
) -> Bool[Array, "rows cols"]:
    """Whether each cell has a target within reach.

    The nearest target of each column covers an interval of the row; the cells inside an interval
    are found by counting the ends of the intervals.

    Args:
        table: Result of :func:`column_table`.
        outside: Whether all cells outside the grid are targets too.
        reach: Reach in columns to either side, by distance in rows; see :func:`disc_reach`.
    """
    rows, cols = table.shape
    covered = np.empty((rows, cols), np.bool_)
    change = np.empty(cols + 1, np.int32)
    for row in range(rows):
        change[:] = 0
        if outside and len(reach) > 0:
            change[0] += 1
            change[min(reach[0], cols)] -= 1
            change[max(cols - reach[0], 0)] += 1
        for col in range(cols):
            steps = table[row, col] >> 2
            if steps < len(reach):
                change[max(col - reach[steps], 0)] += 1
                change[min(col + reach[steps] + 1, cols)] -= 1
        depth = 0
        for col in range(cols):
            depth += change[col]
            covered[row, col] = depth > 0
    return covered


@compiled
def nearest_cell(targets: Bool[Array, "rows cols"], v: float, u: float) -> tuple[int, int]:
    """Return row and column of the target whose centre is nearest to the point (v, u), in cells.

    Square rings around the cell of the point are searched until their distance exceeds the least
    distance found; the work is at most proportional to the number of cells. (-1, -1) if there is no
    target.
    """
    rows, cols = targets.shape
    v = min(max(v, -_FAR), _FAR)
    u = min(max(u, -_FAR), _FAR)
    row, col = int(np.floor(v)), int(np.floor(u))
    ring = max(-row, row - rows + 1, -col, col - cols + 1, 0)
    last = max(row, rows - 1 - row, col, cols - 1 - col)
    best, found = np.inf, (-1, -1)
    while ring <= last and ring - 0.5 <= best:
        # the rows between the first and the last of the ring have no cell if its columns have none
        between = col - ring >= 0 or col + ring < cols
        r = max(row - ring, 0)
        while r <= min(row + ring, rows - 1):
            # a whole side of the ring, or its two end cells
            step = 1 if abs(r - row) == ring else 2 * ring
            first = col - ring if step > 1 else max(col - ring, 0)
            for c in range(first, min(col + ring, cols - 1) + 1, step):
                if c >= 0 and targets[r, c]:
                    away = np.hypot(r + 0.5 - v, c + 0.5 - u)
                    if away < best:
                        best, found = away, (r, c)
            r += 1 if between else max(row + ring - r, 1)
        ring += 1
    return found
