"""Map of the paper's study."""

from __future__ import annotations

from math import floor

import numpy as np

from omnidrive.maps.grid import OccupancyGrid


def paper_wall() -> OccupancyGrid:
    """Return the wall without inflation, on cells of 0.05 m, for collision checks.

    Neither the paper nor its code states the thickness of the wall; 0.1 m is our choice.
    """
    cells = OccupancyGrid(np.zeros((200, 200), dtype=bool), 0.05, paper_map().origin, walled=False)
    (bottom, _), (top, _) = cells.cell(5.0, 2.9501), cells.cell(5.0, 3.0501)
    (_, left), (_, right) = cells.cell(4.0001, 3.0), cells.cell(6.0001, 3.0)
    cells.occupied[bottom:top, :left] = cells.occupied[bottom:top, right:] = True
    return cells


def paper_map() -> OccupancyGrid:
    """Return a wall with a gap on 50 x 50 cells of 0.2 m, inflated by the robot's 0.75 m.

    The wall runs along y = 3 m and is open from x = 4 m to x = 6 m. As in the published code, cell
    (i, j), counted from 1, represents the point (0.2 j, 0.2 i) m, and the inflated wall covers rows
    f(3 - b) to f(3 + b), columns 1 to f(4 + b) and f(6 - b) to 50, with b = 0.75 and
    f(v) = floor(5 v). The cell centres are at those points.
    """
    per_metre, body = 5, 0.75

    def index(metres: float) -> int:
        """Evaluate f of the published code."""
        return floor(per_metre * metres)

    occupied = np.zeros((50, 50), dtype=bool)
    rows = slice(index(3 - body) - 1, index(3 + body))
    occupied[rows, : index(4 + body)] = True
    occupied[rows, index(6 - body) - 1 :] = True
    return OccupancyGrid(occupied, 1 / per_metre, (0.5 / per_metre, 0.5 / per_metre))
