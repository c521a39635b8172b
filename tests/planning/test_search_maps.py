"""Grid search on the shared benchmark maps and on large maps."""

import numpy as np
import pytest

from omnidrive.errors import NoPathFound
from omnidrive.maps import OccupancyGrid, load_map, load_queries
from omnidrive.planning import GridSearch, search
from tests.memory import allocates_at_most
from tests.shared_data import shared

MAPS = ("maze-32-32-4", "random-32-32-20", "room-64-64-8", "warehouse-10-20-10-2-1")


def benchmark(name):
    """Load a map and its queries."""
    grid = load_map(shared(f"maps/movingai/{name}.map"))
    return grid, load_queries(shared(f"maps/movingai/{name}.map.scen"), grid)


@pytest.mark.parametrize("method", ["astar", "jump-point"])
@pytest.mark.parametrize("name", MAPS)
def test_lengths_match_the_benchmark_files(name, method):
    grid, queries = benchmark(name)
    grid_search = GridSearch(grid)
    assert len(queries) >= 100
    for start, goal, length, *_ in queries:
        found = grid_search.search(start, goal, method=method)
        assert found.cost == pytest.approx(length, abs=1e-6)


@pytest.mark.parametrize("name", MAPS)
def test_any_angle_paths_are_shorter(name):
    grid, queries = benchmark(name)
    grid_search = GridSearch(grid)
    found = [grid_search.search(a, b, method="lazy-theta").cost for a, b, *_ in queries]
    lengths = np.array([query.length for query in queries])
    straight = [np.hypot(a[0] - b[0], a[1] - b[1]) for a, b, *_ in queries]
    assert (found >= np.array(straight) - 1e-9).all()
    assert (found <= lengths + 1e-6).all()
    assert np.sum(found) < 0.99 * lengths.sum()


@pytest.mark.parametrize(
    ("size", "limit"), [(1024, 120e6), pytest.param(4096, 400e6, marks=pytest.mark.long)]
)
@pytest.mark.parametrize("method", ["astar", "jump-point", "lazy-theta", "greedy"])
def test_memory_on_a_large_map_is_bounded(method, size, limit):
    """Without a path, where every reachable cell is expanded."""
    occupied = np.zeros((size, size), bool)
    occupied[:, size - 96] = True
    grid = OccupancyGrid(occupied, 0.05)
    message = f"only {size * (size - 96)} of {size * (size - 1)} free cells"
    with allocates_at_most(limit), pytest.raises(NoPathFound, match=message):
        search(grid, (17, 5), (size - 96, size - 1), method=method)


@pytest.mark.parametrize("cells", [200_000, pytest.param(5_000_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("rows", [1, 2, None])
@pytest.mark.parametrize("method", ["astar", "jump-point"])
def test_memory_on_narrow_maps_is_bounded(rows, method, cells):
    shape = (cells, 1) if rows is None else (rows, cells // rows)
    grid = OccupancyGrid(np.zeros(shape, bool), 1.0)
    with allocates_at_most(120 * cells):
        found = search(grid, (0, 0), (shape[0] - 1, shape[1] - 1), method=method)
    assert len(found.cells) == max(shape)
