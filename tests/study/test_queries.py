"""Queries of scenario files, compared with the lengths that the file states."""

import numpy as np
import pytest

from omnidrive.maps import OccupancyGrid, load_queries, random_map
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


def test_messages_count_cells_and_lines_as_the_file(tmp_path):
    """Row 3 of the grid is y = 2 from the top."""
    occupied = np.zeros((6, 9), bool)
    occupied[[2, 3], 1] = True
    (path := tmp_path / "m.scen").write_text(
        "version 1\n\n0\tm.map\t9\t6\t1\t2\t8\t5\t8.0\n0\tm.map\t9\t6\t0\t0\t1\t3\t3.4\n"
    )
    grid = OccupancyGrid(occupied, 1.0)
    first, second = solve_queries(grid, load_queries(path, grid))["differing"]
    assert (first["line"], first["start_in_file"], first["goal_in_file"]) == (3, [1, 2], [8, 5])
    assert first["why"] == (
        "the start (x 1, y 2) is occupied; the nearest free cell is (x 0, y 2), 1 cell away"
    )
    assert (second["line"], second["goal"], second["goal_in_file"]) == (4, [2, 1], [1, 3])
    assert "the goal (x 1, y 3) is occupied" in second["why"]
