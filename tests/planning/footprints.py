"""Footprints, and their contacts with squares by the separating axis theorem."""

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array

RECTANGLE = np.array([[0.31, 0.12], [-0.17, 0.12], [-0.17, -0.12], [0.31, -0.12]])
CHEVRON = np.array([[0.33, 0.0], [-0.21, 0.27], [-0.07, 0.0], [-0.21, -0.27]])
ASIDE = np.array([[0.11, 0.08], [0.42, 0.08], [0.42, 0.31], [0.11, 0.31]])
CONVEX_PARTS = {
    "rectangle": (RECTANGLE, [RECTANGLE]),
    "chevron": (CHEVRON, [CHEVRON[[0, 1, 2]], CHEVRON[[0, 2, 3]]]),
    "aside": (ASIDE, [ASIDE]),
}
"""Outline, and convex polygons whose union it is."""
HEADINGS = 72


def turned(points, yaw):
    along, across = np.cos(yaw), np.sin(yaw)
    return points @ np.array([[along, across], [-across, along]])


def depths(part, squares, side):
    """Return how far a convex polygon reaches into squares (lower left corners), at most.

    It is the least overlap over the axes of both; negative where an axis separates them.
    """
    edges = np.roll(part, -1, axis=0) - part
    axes = np.vstack([np.eye(2), np.column_stack([-edges[:, 1], edges[:, 0]])])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    corners = np.array([[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]])
    own, other = part @ axes.T, (squares[:, None] + corners) @ axes.T
    return np.minimum(own.max(axis=0) - other.min(axis=1), other.max(axis=1) - own.min(axis=0)).min(
        axis=1
    )


def covered(parts, yaws, reach):
    """Return the cells around a cell that convex parts (in cells) cover at any of the yaws."""
    offsets = np.arange(-reach, reach + 1)
    cols, rows = np.meshgrid(offsets, offsets)
    squares = np.column_stack([cols.ravel(), rows.ravel()]) - 0.5
    hit = np.zeros(len(squares), bool)
    for yaw in yaws:
        for part in parts:
            hit |= depths(turned(part, yaw), squares, 1.0) > 1e-7
    return np.column_stack([rows.ravel(), cols.ravel()])[hit]


def blocked(occupied, cells):
    """Return where a set of cells, placed relative to each cell, covers an occupied one."""
    reach = int(np.abs(cells).max())
    full = np.pad(occupied, reach, constant_values=True)
    rows, cols = occupied.shape
    out = np.zeros(occupied.shape, bool)
    for r, c in cells + reach:
        out |= full[r : r + rows, c : c + cols]
    return out


def pose_graph(grid, parts, turn):
    """Return free poses (heading, row, column) and the matrix of the moves between them."""
    cells = [part / grid.resolution for part in parts]
    reach = int(max(np.hypot(*part.T).max() for part in cells)) + 2
    yaws = 2 * np.pi / HEADINGS * np.arange(HEADINGS + 1) - grid.yaw
    free = np.array([~blocked(grid.occupied, covered(cells, [yaw], reach)) for yaw in yaws[:-1]])
    turns = np.array(
        [
            ~blocked(grid.occupied, covered(cells, np.linspace(a, b, 17), reach))
            for a, b in pairwise(yaws)
        ]
    )
    number = np.arange(free.size).reshape(free.shape)
    found = []

    def add(allowed, one, other, length):
        found.append((number[one][allowed], number[other][allowed], length))

    every, low, high, here = slice(None), slice(0, -1), slice(1, None), slice(None)
    for one, other in (((every, low, here), (every, high, here)),
                       ((every, here, low), (every, here, high))):  # fmt: skip
        add(free[one] & free[other], one, other, 1.0)
    four = free[:, :-1, :-1] & free[:, 1:, :-1] & free[:, :-1, 1:] & free[:, 1:, 1:]
    add(four, (every, low, low), (every, high, high), np.sqrt(2.0))
    add(four, (every, low, high), (every, high, low), np.sqrt(2.0))
    found.append((number[turns], np.roll(number, -1, axis=0)[turns], turn))
    a, b = (np.concatenate([each[i] for each in found]) for i in (0, 1))
    lengths = np.concatenate([np.full(len(each[0]), each[2]) for each in found])
    return free, coo_array((lengths, (a, b)), shape=(free.size, free.size)).tocsr()


def deepest_contact(grid, parts, poses):
    """Return how far convex parts in m reach into occupied squares at poses in W, in m, at most.

    The walls around the grid are left out.
    """
    corner, side = np.array(grid.origin), grid.resolution
    squares = np.argwhere(grid.occupied)[:, ::-1] * side
    deepest = -np.inf
    for x, y, yaw in poses:
        at = turned(np.array([[x, y]]) - corner, -grid.yaw)[0]
        near = squares[np.hypot(*(squares - at).T) < 2.0]
        for part in parts if len(near) else []:
            deepest = max(deepest, depths(turned(part, yaw - grid.yaw) + at, near, side).max())
    return deepest
