"""The map of the paper's study."""

from __future__ import annotations

from math import floor

import numpy as np

from omnidrive.maps.grid import OccupancyGrid


def paper_wall() -> OccupancyGrid:
    """The wall itself, on cells of 0.05 m: where a robot of 0.75 m would really collide.

    Neither the paper nor its code says how thick it is; 0.1 m is ours.
    """
    cells = OccupancyGrid(np.zeros((200, 200), dtype=bool), 0.05, paper_map().origin, walled=False)
    (bottom, _), (top, _) = cells.cell(5.0, 2.9501), cells.cell(5.0, 3.0501)
    (_, left), (_, right) = cells.cell(4.0001, 3.0), cells.cell(6.0001, 3.0)
    cells.occupied[bottom:top, :left] = cells.occupied[bottom:top, right:] = True
    return cells


def paper_map() -> OccupancyGrid:
    """A wall with a gap on 50 x 50 cells of 0.2 m, already inflated by the robot's 0.75 m.

    The wall runs along y = 3 m and is open from x = 4 m to x = 6 m. As in the published code, cell
    (i, j), counted from 1, stands for the point (0.2 j, 0.2 i) m, and the inflated wall covers rows
    f(3 - b) to f(3 + b), columns 1 to f(4 + b) and f(6 - b) to 50, with b = 0.75 and
    f(v) = floor(5 v). Cell centres are put on those points.
    """
    per_metre, body = 5, 0.75

    def index(metres: float) -> int:
        """The paper's f."""
        return floor(per_metre * metres)

    occupied = np.zeros((50, 50), dtype=bool)
    rows = slice(index(3 - body) - 1, index(3 + body))
    occupied[rows, : index(4 + body)] = True
    occupied[rows, index(6 - body) - 1 :] = True
    return OccupancyGrid(occupied, 1 / per_metre, (0.5 / per_metre, 0.5 / per_metre))
