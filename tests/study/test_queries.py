"""Queries of scenario files, compared with the lengths that the file states."""

import numpy as np
import pytest

from omnidrive.maps import load_queries, random_map
from omnidrive.planning import GridSearch
from omnidrive.study import solve_queries

ROWS, COLS, QUERIES = 24, 40, 60


@pytest.fixture(scope="module")
def solved():
    """A random map, and start, goal and length of queries on it."""
    rng = np.random.default_rng(3)
    grid = random_map(ROWS, COLS, 0.15, rng)
    searcher, free = GridSearch(grid), np.argwhere(~grid.occupied)
    found = []
    while len(found) < QUERIES:
        start, goal = (tuple(cell) for cell in rng.choice(free, 2).tolist())
        if grid.region_size(*start) == grid.region_size(*goal):
            found.append((start, goal, searcher.search(start, goal).cost))
    return grid, found


def written(folder, grid, lines):
    text = "".join(
        f"0\tm.map\t{COLS}\t{ROWS}\t{c}\t{ROWS - 1 - r}\t{x}\t{ROWS - 1 - y}\t{length}\n"
        for (r, c), (y, x), length in lines
    )
    path = folder / "m.scen"
    path.write_text("version 1\n" + text)
    return load_queries(path, grid)


@pytest.mark.parametrize("digits", [".8f", ".6f", ".2f", ".1f", "g", ".4g", ".3e", ".0f"])
def test_rounded_lengths_do_not_differ(tmp_path, solved, digits):
    grid, found = solved
    lines = [(start, goal, f"{length:{digits}}") for start, goal, length in found]
    assert solve_queries(grid, written(tmp_path, grid, lines))["differing"] == []


@pytest.mark.parametrize(("digits", "step"), [(".8f", 1e-4), (".6f", 1e-4), (".2f", 0.015)])
def test_wrong_lengths_differ(tmp_path, solved, digits, step):
    grid, found = solved
    lines = [(start, goal, f"{length + step:{digits}}") for start, goal, length in found]
    wrong = solve_queries(grid, written(tmp_path, grid, lines))["differing"]
    assert [each["query"] for each in wrong] == list(range(QUERIES))
