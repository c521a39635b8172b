"""The nearest of the taken cells, found through a table of how near it is in each column."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int, Int32, Int64

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined

_NONE = 1 << 27  # rows to the nearest taken cell of a column that has none
_FAR = 2.0**30  # cells; points further out are taken to be there
_BELOW, _ABOVE = 1, 2  # on which side it is; both if there are two


@compiled
def column_table(
    taken: Bool[Array, "rows cols"], outside: bool
) -> Int32[Array, "rows cols"]:  # fmt: skip
    """How many rows each cell is from the nearest taken one of its column, and on which side.

    Args:
        taken: The cells looked for.
        outside: Whether everything outside the grid is taken too.

    Returns:
        Four times the number of rows, plus 1 if it is below (towards row 0), plus 2 if above.
    """
    rows, cols = taken.shape
    table = np.empty((rows, cols), np.int32)
    below = np.full(cols, -1 if outside else -_NONE, np.int32)
    for row in range(rows):
        for col in range(cols):
            if taken[row, col]:
                below[col] = row
            table[row, col] = row - below[col]
    above = np.full(cols, rows if outside else _NONE, np.int32)
    for row in range(rows - 1, -1, -1):
        for col in range(cols):
            if taken[row, col]:
                above[col] = row
            down, up = table[row, col], above[col] - row
            side = (down <= up) * _BELOW + (up <= down) * _ABOVE
            table[row, col] = 4 * min(down, up) + side
    return table


@compiled
def gaps(
    table: Int32[Array, "rows cols"], outside: bool, points: Float[Array, "points 2"]
) -> Float[Array, " points"]:
    """Exact distance from each point to the nearest taken cell's square, in cells.

    From the point's own column outwards, until the columns alone are further than the best.

    Args:
        table: As :func:`column_table` made it.
        outside: As there; then no point may lie outside the grid.
        points: (row, column) in cells, counted from the grid's outer corner; finite.

    Returns:
        Infinite where nothing is taken.
    """
    rows, cols = table.shape
    out = np.empty(len(points))
    for k in range(len(points)):
        v, u = points[k, 0], points[k, 1]
        row = int(min(max(np.floor(v), 0.0), rows - 1.0))
        left = int(min(max(np.floor(u), 0.0), cols - 1.0))
        right = left + 1
        best = max(min(u, cols - u), 0.0) ** 2 if outside else np.inf
        while True:
            to_left = _beyond(u, left) ** 2 if left >= 0 else np.inf
            to_right = _beyond(u, right) ** 2 if right < cols else np.inf
            across = min(to_left, to_right)
            if across >= best:  # also once both sides are used up
                break
            col = left if to_left <= to_right else right
            left, right = left - (col == left), right + (col == right)
            best = min(best, across + _along(table[row, col], row, v) ** 2)
        out[k] = np.sqrt(best)
    return out


@inlined
def _beyond(at: float, cell: int) -> float:
    """Distance of a coordinate from a cell's side of length 1."""
    return max(cell - at, at - cell - 1.0, 0.0)


@inlined
def _along(entry: int, row: int, v: float) -> float:
    """Distance along a column from v, in or next to ``row``, to its nearest taken cell."""
    steps = entry >> 2
    if steps > _NONE // 2:
        return np.inf
    below = _beyond(v, row - steps) if entry & _BELOW else np.inf
    above = _beyond(v, row + steps) if entry & _ABOVE else np.inf
    return min(below, above)


def disc_reach(radius: float, steps: int) -> Int64[Array, " _"]:
    """How many columns away a taken cell's square is still within ``radius`` (cells) of a centre.

    The square of a cell that is m rows and n columns away is hypot(max(m - 1/2, 0),
    max(n - 1/2, 0)) cells from a centre. One that is as far as the radius to 12 digits only
    touches the disc and is not within it.

    Returns:
        The greatest such n for m = 0, 1, ..., at most ``steps`` of them.
    """
    room = (
        2.0 * radius * (2.0 * radius) * (1.0 - 1e-12)
        - np.maximum(2.0 * np.arange(steps) - 1.0, 0.0) ** 2
    )
    reach = np.ceil(0.5 * np.sqrt(room[room > 0.0]) + 0.5) - 1.0
    columns: Int64[Array, " _"] = np.minimum(reach, 2.0**40).astype(np.int64)
    return columns


@compiled
def within_reach(
    table: Int32[Array, "rows cols"], outside: bool, reach: Int[Array, " steps"]
) -> Bool[Array, "rows cols"]:
    """Which cells have a taken one within reach.

    Each column's nearest taken cell covers an interval of the row; their ends are counted.

    Args:
        table: As :func:`column_table` made it.
        outside: As there.
        reach: How many columns to either side count, by the number of rows between them.
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
def nearest_cell(taken: Bool[Array, "rows cols"], v: float, u: float) -> tuple[int, int]:
    """Row and column of the taken cell whose centre is nearest to the point (v, u), in cells.

    Ring by ring around the point's cell, until a ring is further than the best; (-1, -1) if
    nothing is taken.
    """
    rows, cols = taken.shape
    v = min(max(v, -_FAR), _FAR)
    u = min(max(u, -_FAR), _FAR)
    row, col = int(np.floor(v)), int(np.floor(u))
    ring = max(-row, row - rows + 1, -col, col - cols + 1, 0)
    last = max(row, rows - 1 - row, col, cols - 1 - col)
    best, found = np.inf, (-1, -1)
    while ring <= last and ring - 0.5 <= best:
        for r in range(max(row - ring, 0), min(row + ring, rows - 1) + 1):
            step = 1 if abs(r - row) == ring else 2 * ring  # a side of the ring, or its two ends
            first = col - ring if step > 1 else max(col - ring, 0)
            for c in range(first, min(col + ring, cols - 1) + 1, step):
                if c >= 0 and taken[r, c]:
                    away = np.hypot(r + 0.5 - v, c + 0.5 - u)
                    if away < best:
                        best, found = away, (r, c)
        ring += 1
    return found
