"""Grid search: against the published path, and laws over random maps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid, paper_map
from omnidrive.planning import search
from tests.shared_data import shared_table

START, GOAL = (4, 4), (29, 39)


def length(cells):
    return np.linalg.norm(np.diff(cells, axis=0), axis=1).sum()


def test_greedy_search_finds_the_published_cells():
    theirs = shared_table("reference/path_paper_cells.csv") - 1
    ours = search(paper_map(), START, GOAL, greedy=True, cut_corners=True)
    assert (ours == theirs).all()


def test_shortest_path_has_the_reference_length():
    theirs = shared_table("reference/path_octile_nocut_cells.csv")
    ours = search(paper_map(), START, GOAL)
    assert length(ours) == pytest.approx(length(theirs), abs=1e-12)


def neighbour_lengths(occupied, cut_corners):
    """Every allowed move as a sparse matrix, written without the search's code."""
    rows, cols = occupied.shape
    a, b, w = [], [], []
    for r, c in np.argwhere(~occupied):
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                y, x = r + dr, c + dc
                if (dr or dc) and 0 <= y < rows and 0 <= x < cols and not occupied[y, x]:
                    if dr and dc and not cut_corners and (occupied[r, x] or occupied[y, c]):
                        continue
                    a.append(r * cols + c)
                    b.append(y * cols + x)
                    w.append(np.hypot(dr, dc))
    return coo_array((w, (a, b)), shape=(rows * cols, rows * cols)).tocsr()


@settings(max_examples=60, deadline=None)
@given(
    occupied=arrays(bool, (9, 11), elements=st.sampled_from([False, False, True])),
    cut_corners=st.booleans(),
)
def test_search_agrees_with_dijkstra(occupied, cut_corners):
    occupied[0, 0] = occupied[8, 10] = False
    grid = OccupancyGrid(occupied, 0.1)
    best = dijkstra(neighbour_lengths(occupied, cut_corners), indices=0)[-1]
    if np.isinf(best):
        with pytest.raises(NoPathFound, match="every cell"):
            search(grid, (0, 0), (8, 10), cut_corners=cut_corners)
    else:
        cells = search(grid, (0, 0), (8, 10), cut_corners=cut_corners)
        assert length(cells) == pytest.approx(best)
        assert not occupied[tuple(cells.T)].any()


@settings(max_examples=30, deadline=None)
@given(occupied=arrays(bool, (9, 11), elements=st.sampled_from([False, False, True])))
def test_greedy_search_finds_a_way_when_there_is_one(occupied):
    occupied[0, 0] = occupied[8, 10] = False
    grid = OccupancyGrid(occupied, 0.1)
    try:
        best = length(search(grid, (0, 0), (8, 10)))
    except NoPathFound:
        with pytest.raises(NoPathFound):
            search(grid, (0, 0), (8, 10), greedy=True)
    else:
        assert length(search(grid, (0, 0), (8, 10), greedy=True)) >= best - 1e-9
