"""Randomly generated maps: scattered obstacles, rooms and warehouses."""

from __future__ import annotations

import numpy as np

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.map_file import check_size


def random_map(
    rows: int, cols: int, density: float, rng: np.random.Generator, *, resolution: float = 1.0
) -> OccupancyGrid:
    """Generate independent obstacle cells with the probability ``density``.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        density: Probability of an obstacle, from 0 to 1.
        rng: Random generator.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: An argument is out of range.
    """
    check_size(rows, cols, "the random map")
    _check_fraction(density, "the density of obstacles")
    return OccupancyGrid(rng.random((rows, cols), dtype=np.float32) < density, resolution)


def rooms_map(
    rows: int, cols: int, room: int, rng: np.random.Generator, *, door: int = 1,
    resolution: float = 1.0,
) -> OccupancyGrid:  # fmt: skip
    """Generate square rooms with walls of one cell and one door to every adjacent room.

    The position of a door in the common wall of two rooms is uniformly distributed. Rooms at the
    upper ends of the rows and columns are truncated; a strip narrower than a door is occupied.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        room: Side of a room, in cells.
        rng: Random generator.
        door: Width of the doors, in cells; at most ``room``.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: An argument is out of range.
    """
    check_size(rows, cols, "the map of rooms")
    if not 1 <= door <= room:
        raise InvalidInput(
            f"the width of a door must be 1 to {room} cells, the side of a room, got {door}"
        )
    occupied = np.zeros((rows, cols), bool)
    occupied[room :: room + 1] = occupied[:, room :: room + 1] = True
    _open_doors(occupied, room, door, rng)
    _open_doors(occupied.T, room, door, rng)
    for axis, count in enumerate((rows, cols)):
        rest = count % (room + 1)
        if rest < door and count > rest:  # too narrow for a door
            occupied.swapaxes(0, axis)[count - rest :] = True
    return OccupancyGrid(occupied, resolution)


def _open_doors(occupied: Array, room: int, door: int, rng: np.random.Generator) -> None:
    """Open a door in every section of the walls that run along the rows of the array."""
    rows, cols = occupied.shape
    walls = np.arange(room, rows - door, room + 1)  # a wall without a room behind it has no doors
    starts = np.arange(0, cols, room + 1)
    starts = starts[cols - starts >= door]
    free = np.minimum(room, cols - starts) - door + 1  # number of positions of a door's first cell
    first = starts + rng.integers(0, free, size=(len(walls), len(starts)))
    for step in range(door):
        occupied[walls[:, None], first + step] = False


def warehouse_map(
    rows: int, cols: int, rng: np.random.Generator, *, shelf: tuple[int, int] = (2, 10),
    aisle: int = 1, filled: float = 0.9, resolution: float = 1.0,
) -> OccupancyGrid:  # fmt: skip
    """Generate rows of shelves with aisles between and around them.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        rng: Random generator; it selects the slots without a shelf.
        shelf: Depth and length of a shelf, in cells: rows and columns.
        aisle: Width of the aisles, in cells.
        filled: Probability that a slot holds a shelf, from 0 to 1.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: An argument is out of range.
    """
    check_size(rows, cols, "the warehouse")
    _check_fraction(filled, "the share of slots with a shelf")
    if min(*shelf, aisle) < 1:
        raise InvalidInput(f"shelves ({shelf}) and aisles ({aisle}) must be at least one cell wide")
    row, inside_row = _slots(rows, shelf[0], aisle)
    col, inside_col = _slots(cols, shelf[1], aisle)
    there = rng.random((row[-1] + 1, col[-1] + 1)) < filled
    occupied = there[np.ix_(row, col)] & np.outer(inside_row, inside_col)
    return OccupancyGrid(occupied, resolution)


def _slots(count: int, size: int, aisle: int) -> tuple[Array, Array]:
    """Return the slot of each row or column of cells, and whether it lies inside the slot."""
    slot, at = np.divmod(np.arange(count) - aisle, size + aisle)
    whole = (slot + 1) * (size + aisle) + aisle <= count  # including the aisle behind it
    return np.maximum(slot, 0), (slot >= 0) & (at < size) & whole


def _check_fraction(value: float, name: str) -> None:
    """Check a fraction.

    Raises:
        InvalidInput: The value is not from 0 to 1.
    """
    if not 0.0 <= value <= 1.0:
        raise InvalidInput(f"{name} must be from 0 to 1, got {value:g}")
