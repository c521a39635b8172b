"""Worlds made by chance: scattered obstacles, rooms and warehouses."""

from __future__ import annotations

import numpy as np

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.maps.grid import OccupancyGrid
from omnidrive.maps.source import refuse_size


def random_map(
    rows: int, cols: int, density: float, rng: np.random.Generator, *, resolution: float = 1.0
) -> OccupancyGrid:
    """Cells that are obstacles with the probability ``density``, each for itself.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        density: From 0 to 1.
        rng: Source of chance.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: A number is out of range.
    """
    refuse_size(rows, cols, "the random map")
    _refuse_share(density, "the density of obstacles")
    return OccupancyGrid(rng.random((rows, cols), dtype=np.float32) < density, resolution)


def rooms_map(
    rows: int, cols: int, room: int, rng: np.random.Generator, *, door: int = 1,
    resolution: float = 1.0,
) -> OccupancyGrid:  # fmt: skip
    """Square rooms between walls of one cell, with one door to every neighbour.

    The door is anywhere in the wall that two rooms share. Rooms that do not fit whole are left
    smaller; where not even a door fits, there is wall.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        room: Side of a room, in cells.
        rng: Source of chance.
        door: Width of the doors, in cells; at most ``room``.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: A number is out of range.
    """
    refuse_size(rows, cols, "the map of rooms")
    if not 1 <= door <= room:
        raise InvalidInput(f"doors must have 1 to {room} cells, the side of a room, got {door}")
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
    """Open a door in every piece of the walls that run along the columns of the array."""
    rows, cols = occupied.shape
    walls = np.arange(room, rows - door, room + 1)  # beyond the others there is no room
    starts = np.arange(0, cols, room + 1)
    starts = starts[cols - starts >= door]
    free = np.minimum(room, cols - starts) - door + 1  # places for a door's first cell
    first = starts + rng.integers(0, free, size=(len(walls), len(starts)))
    for step in range(door):
        occupied[walls[:, None], first + step] = False


def warehouse_map(
    rows: int, cols: int, rng: np.random.Generator, *, shelf: tuple[int, int] = (2, 10),
    aisle: int = 1, filled: float = 0.9, resolution: float = 1.0,
) -> OccupancyGrid:  # fmt: skip
    """Shelves in rows, with aisles between them and all around.

    Args:
        rows: Number of rows.
        cols: Number of columns.
        rng: Source of chance: which places for a shelf stay empty.
        shelf: Depth and length of a shelf, in cells: rows and columns.
        aisle: Width of the aisles, in cells.
        filled: Share of the places that hold a shelf, from 0 to 1.
        resolution: Side of a cell, in m.

    Raises:
        InvalidInput: A number is out of range.
    """
    refuse_size(rows, cols, "the warehouse")
    _refuse_share(filled, "the share of places with a shelf")
    if min(*shelf, aisle) < 1:
        raise InvalidInput(f"shelves ({shelf}) and aisles ({aisle}) must have a cell or more")
    row, inside_row = _places(rows, shelf[0], aisle)
    col, inside_col = _places(cols, shelf[1], aisle)
    there = rng.random((row[-1] + 1, col[-1] + 1)) < filled
    occupied = there[np.ix_(row, col)] & np.outer(inside_row, inside_col)
    return OccupancyGrid(occupied, resolution)


def _places(count: int, size: int, aisle: int) -> tuple[Array, Array]:
    """For each line of cells: the place for a shelf that it belongs to, and whether inside it."""
    place, at = np.divmod(np.arange(count) - aisle, size + aisle)
    whole = (place + 1) * (size + aisle) + aisle <= count  # with the aisle behind it
    return np.maximum(place, 0), (place >= 0) & (at < size) & whole


def _refuse_share(value: float, what: str) -> None:
    """Refuse what is no share of a whole.

    Raises:
        InvalidInput: It is not from 0 to 1.
    """
    if not 0.0 <= value <= 1.0:
        raise InvalidInput(f"{what} must be from 0 to 1, got {value:g}")
