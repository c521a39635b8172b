"""Maps and queries of the planning benchmark."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

WALL = 1  # cells


def scattered(share: float):
    """Every cell is occupied with the same probability."""
    return lambda size, rng: rng.random((size, size)) < share


def maze(corridor: int):
    """A spanning tree of squares of ``corridor`` cells, every one as likely to be joined next."""

    def make(size: int, rng: np.random.Generator) -> np.ndarray:
        return joined(size, corridor, rng, doors=False)

    return make


def rooms(side: int):
    """Square rooms with a door of one cell in three of four walls."""

    def make(size: int, rng: np.random.Generator) -> np.ndarray:
        return joined(size, side, rng, doors=True)

    return make


def joined(size: int, side: int, rng: np.random.Generator, doors: bool) -> np.ndarray:
    step = side + WALL
    count = (size - WALL) // step
    occupied = np.ones((size, size), bool)
    for i in range(count):
        for j in range(count):
            r, c = WALL + i * step, WALL + j * step
            occupied[r : r + side, c : c + side] = False
    number = np.arange(count**2).reshape(count, count)
    pairs = np.concatenate([
        np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()], axis=1),
        np.stack([number[:-1].ravel(), number[1:].ravel()], axis=1),
    ])  # fmt: skip
    if doors:
        chosen = pairs[rng.random(len(pairs)) < 0.75]
    else:
        graph = coo_array((rng.random(len(pairs)) + 1.0, pairs.T), shape=(count**2, count**2))
        chosen = np.stack(minimum_spanning_tree(graph.tocsr()).nonzero(), axis=1)
        chosen = np.sort(chosen, axis=1)
    for a, b in chosen.tolist():
        (i, j), (k, _) = divmod(a, count), divmod(b, count)
        at = int(rng.integers(side)) if doors else 0
        width = 1 if doors else side
        r, c = WALL + i * step, WALL + j * step
        if k > i:
            occupied[r + side, c + at : c + at + width] = False
        else:
            occupied[r + at : r + at + width, c + side] = False
    return occupied


def queries(occupied: np.ndarray, count: int, rng: np.random.Generator) -> list:
    """Pairs of cells of the largest region, at least half the map apart."""
    regions, _ = label(~occupied)
    sizes = np.bincount(regions.ravel())
    sizes[0] = 0
    cells = np.argwhere(regions == sizes.argmax())
    chosen = []
    while len(chosen) < count:
        a, b = cells[rng.integers(len(cells), size=2)].tolist()
        if np.hypot(a[0] - b[0], a[1] - b[1]) >= 0.5 * len(occupied):
            chosen.append((tuple(a), tuple(b)))
    return chosen
