"""Mazes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, UInt8

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.errors import InvalidInput
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.source import refuse_size

_CHOICES = 12  # a number below it, modulo 1, 2, 3 or 4, has equal chances


def maze_map(
    rows: int, cols: int, corridor: int, rng: np.random.Generator, *, resolution: float = 1.0
) -> OccupancyGrid:
    """A perfect maze: between any two places there is exactly one way.

    Made by a depth-first walk that turns back where no neighbour is new (Buck 2015, "Mazes for
    programmers", recursive backtracker), so that its corridors are long. Walls are one cell thick;
    rows and columns that are left over are wall.

    Args:
        rows: Number of rows, at least ``corridor + 2``.
        cols: Number of columns, at least ``corridor + 2``.
        corridor: Width of the corridors, in cells.
        rng: Source of chance.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: A number is out of range.
    """
    refuse_size(rows, cols, "the maze")
    if not 1 <= corridor <= min(rows, cols) - 2:
        raise InvalidInput(
            f"the corridors of a maze of {rows} rows of {cols} cells must be "
            f"1 to {min(rows, cols) - 2} cells wide, got {corridor}"
        )
    shape = ((rows - 1) // (corridor + 1), (cols - 1) // (corridor + 1))
    draws = rng.integers(0, _CHOICES, shape[0] * shape[1], dtype=np.uint8)
    walls = _carve(shape, draws)
    thick = [np.resize([1, corridor], count) for count in walls.shape]
    occupied = np.ones((rows, cols), bool)
    whole = walls.repeat(thick[0], axis=0).repeat(thick[1], axis=1)
    occupied[: whole.shape[0], : whole.shape[1]] = whole
    return OccupancyGrid(occupied, resolution)


@compiled
def _carve(shape: tuple[int, int], draws: UInt8[Array, " places"]) -> Bool[Array, "rows cols"]:
    """Walls and places of a maze by turns, each one cell: place (i, j) is (2 i + 1, 2 j + 1)."""
    walls = np.ones((2 * shape[0] + 1, 2 * shape[1] + 1), np.bool_)
    way = np.empty((len(draws), 2), np.int32)
    around = np.empty((4, 2), np.int32)
    way[0] = 1
    walls[1, 1] = False
    length, drawn = 1, 0
    while length > 0:
        row, col = way[length - 1, 0], way[length - 1, 1]
        count = 0
        for down, right in ((0, 2), (2, 0), (0, -2), (-2, 0)):
            r, c = row + down, col + right
            if 0 < r < walls.shape[0] and 0 < c < walls.shape[1] and walls[r, c]:
                around[count, 0], around[count, 1] = r, c
                count += 1
        if count == 0:
            length -= 1
            continue
        choice = draws[drawn] % count
        r, c = around[choice, 0], around[choice, 1]
        drawn += 1
        walls[r, c] = walls[(row + r) // 2, (col + c) // 2] = False
        way[length, 0], way[length, 1] = r, c
        length += 1
    return walls
