"""Grid search: the published path, and properties over random maps."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid, paper_map
from omnidrive.planning import GridSearch, search
from tests.examples import examples
from tests.shared_data import shared_table

START, GOAL = (4, 4), (29, 39)
METHODS = ("astar", "jump-point", "lazy-theta", "greedy")
SHORTEST = ("astar", "jump-point")
ROWS, COLS = st.integers(1, 14), st.integers(1, 80)
ROOM = OccupancyGrid(np.zeros((20, 30), bool), 0.1)


def length(cells):
    return np.linalg.norm(np.diff(cells, axis=0), axis=1).sum()


def move_lengths(occupied, neighbours=8, cut_corners=False):
    """Return every allowed move as a sparse matrix, independent of the code under test."""
    rows, cols = occupied.shape
    a, b, w = [], [], []
    for r, c in np.argwhere(~occupied):
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                y, x = r + dr, c + dc
                if not (dr or dc) or not (0 <= y < rows and 0 <= x < cols) or occupied[y, x]:
                    continue
                if dr and dc:
                    if neighbours == 4:
                        continue
                    if not cut_corners and (occupied[r, x] or occupied[y, c]):
                        continue
                a.append(r * cols + c)
                b.append(y * cols + x)
                w.append(np.hypot(dr, dc))
    return coo_array((w, (a, b)), shape=(rows * cols, rows * cols)).tocsr()


def shortest(occupied, start, goal, **moves):
    cols = occupied.shape[1]
    found = dijkstra(move_lengths(occupied, **moves), indices=start[0] * cols + start[1])
    return found[goal[0] * cols + goal[1]]


def check_moves(occupied, cells, neighbours, cut_corners):
    """Check that every step of a path is an allowed move over free cells."""
    assert not occupied[tuple(cells.T)].any()
    steps = np.diff(cells, axis=0)
    assert np.abs(steps).max(initial=0) <= 1
    assert np.abs(steps).any(axis=1).all()
    if neighbours == 4:
        assert (np.abs(steps).sum(axis=1) == 1).all()
    if not cut_corners:
        assert not occupied[cells[:-1, 0], cells[1:, 1]].any()
        assert not occupied[cells[1:, 0], cells[:-1, 1]].any()


@st.composite
def maps_with_ends(draw, rows=ROWS, cols=COLS):
    """Draw a map of any shape, wider than a 64-bit word included, with a free start and goal."""
    shape = draw(rows), draw(cols)
    if draw(st.booleans()):
        shape = shape[::-1]
    density, seed = draw(st.floats(0.0, 0.5)), draw(st.integers(0, 2**32 - 1))
    occupied = np.random.default_rng(seed).random(shape) < density
    ends = [tuple(draw(st.integers(0, n - 1)) for n in shape) for _ in range(2)]
    for end in ends:
        occupied[end] = False
    return occupied, *ends


def test_greedy_search_reproduces_the_published_cells():
    theirs = shared_table("reference/path_paper_cells.csv") - 1
    ours = search(paper_map(), START, GOAL, method="greedy", cut_corners=True)
    assert (ours.cells == theirs).all()


@pytest.mark.parametrize("method", SHORTEST)
def test_shortest_path_has_the_reference_length(method):
    theirs = shared_table("reference/path_octile_nocut_cells.csv")
    ours = search(paper_map(), START, GOAL, method=method)
    assert ours.cost == pytest.approx(length(theirs), abs=1e-12)


@examples(300)
@given(
    case=maps_with_ends(),
    neighbours=st.sampled_from([4, 8]),
    cut_corners=st.booleans(),
    heuristic=st.sampled_from(["octile", "euclidean", "zero", None]),
)
def test_astar_is_as_short_as_dijkstra(case, neighbours, cut_corners, heuristic):
    occupied, start, goal = case
    moves = {"neighbours": neighbours, "cut_corners": cut_corners}
    best, grid = shortest(occupied, start, goal, **moves), OccupancyGrid(occupied, 0.1)
    if np.isinf(best):
        with pytest.raises(NoPathFound, match="can be reached from the start"):
            search(grid, start, goal, heuristic=heuristic, **moves)
        return
    found = search(grid, start, goal, heuristic=heuristic, **moves)
    assert found.cost == pytest.approx(best, abs=1e-9)
    assert length(found.cells) == pytest.approx(best, abs=1e-9)
    assert tuple(found.cells[0]) == start
    assert tuple(found.cells[-1]) == goal
    check_moves(occupied, found.cells, neighbours, cut_corners)


@examples(300)
@given(
    case=maps_with_ends(),
    heuristic=st.sampled_from(["octile", "euclidean", "zero", None]),
)
def test_jump_point_search_is_as_short_as_astar(case, heuristic):
    occupied, start, goal = case
    grid_search = GridSearch(OccupancyGrid(occupied, 0.1))
    try:
        theirs = grid_search.search(start, goal)
    except NoPathFound as none:
        with pytest.raises(NoPathFound, match=str(none).replace(".", r"\.")):
            grid_search.search(start, goal, method="jump-point", heuristic=heuristic)
        return
    ours = grid_search.search(start, goal, method="jump-point", heuristic=heuristic)
    assert ours.cost == theirs.cost  # counted in moves, hence exactly equal
    assert tuple(ours.cells[0]) == start
    assert tuple(ours.cells[-1]) == goal
    check_moves(occupied, ours.cells, 8, cut_corners=False)


@examples(100)
@given(case=maps_with_ends(), neighbours=st.sampled_from([4, 8]), cut_corners=st.booleans())
@pytest.mark.parametrize("heuristic", ["manhattan", "octile"])
@pytest.mark.parametrize("method", ["astar", "greedy"])
def test_path_is_found_if_one_exists(method, heuristic, case, neighbours, cut_corners):
    """Also by searches that are not optimal."""
    occupied, start, goal = case
    moves = {"neighbours": neighbours, "cut_corners": cut_corners}
    best, grid = shortest(occupied, start, goal, **moves), OccupancyGrid(occupied, 0.1)
    options = {"method": method, "heuristic": heuristic, **moves}
    if np.isinf(best):
        with pytest.raises(NoPathFound):
            search(grid, start, goal, **options)
        return
    found = search(grid, start, goal, **options)
    assert found.cost >= best - 1e-9
    check_moves(occupied, found.cells, neighbours, cut_corners)
    if method == "astar":
        assert found.cost <= best * 2**0.5 + 1e-9
    if neighbours == 4 and method == "astar":
        assert found.cost == pytest.approx(best)


def line_is_clear(occupied, one, other):
    """Whether a line between cell centres touches no square: separating axes, in integers."""
    squares = np.argwhere(occupied)
    (r0, c0), (r1, c1) = one, other
    inside = np.ones(len(squares), bool)
    for axis, (a, b) in enumerate(((r0, r1), (c0, c1))):
        low, high = 2 * squares[:, axis] - 1, 2 * squares[:, axis] + 1
        inside &= (low <= 2 * max(a, b)) & (high >= 2 * min(a, b))
    sides = [
        (2 * squares[:, 0] + dr - 2 * r0) * (c1 - c0)
        - (2 * squares[:, 1] + dc - 2 * c0) * (r1 - r0)
        for dr in (-1, 1)
        for dc in (-1, 1)
    ]
    crosses = (np.min(sides, axis=0) <= 0) & (np.max(sides, axis=0) >= 0)
    return not (inside & crosses).any()


@examples(80)
@given(case=maps_with_ends(st.integers(1, 9), st.integers(1, 9)))
@example(case=(np.zeros((9, 9), bool), (0, 0), (5, 8)))
def test_any_angle_paths_touch_no_obstacle_and_are_short(case):
    occupied, start, goal = case
    grid = OccupancyGrid(occupied, 0.1)
    try:
        along_moves = search(grid, start, goal).cost
    except NoPathFound as none:
        with pytest.raises(NoPathFound, match=str(none).replace(".", r"\.")):
            search(grid, start, goal, method="lazy-theta")
        return
    found = search(grid, start, goal, method="lazy-theta")
    assert tuple(found.cells[0]) == start
    assert tuple(found.cells[-1]) == goal
    corners = found.cells.tolist()
    assert all(map(line_is_clear, [occupied] * len(corners), corners, corners[1:]))
    assert found.cost == pytest.approx(length(found.cells))
    free = np.argwhere(~occupied)
    visible = [[i != j and line_is_clear(occupied, a, b) for j, b in enumerate(free)]
            for i, a in enumerate(free)]  # fmt: skip
    distances = np.linalg.norm(free[:, None] - free[None], axis=2) * visible
    ends = [int(np.flatnonzero((free == end).all(axis=1))[0]) for end in (start, goal)]
    best = dijkstra(distances, indices=ends[0])[ends[1]]
    assert best - 1e-9 <= found.cost <= along_moves + 1e-9


def test_any_angle_path_is_at_most_as_long_as_over_neighbours():
    """On this map, Lazy Theta* alone finds a path that is 7 % longer."""
    rows = ["..##.#", ".#....", "..#..#", "......", "....#.", "...#.."]
    occupied = np.array([[cell == "#" for cell in row] for row in rows])
    grid = GridSearch(OccupancyGrid(occupied, 0.1))
    shortest = grid.search((0, 0), (5, 5))
    assert grid.search((0, 0), (5, 5), method="lazy-theta").cost == pytest.approx(shortest.cost)


@examples(100)
@given(case=maps_with_ends())
def test_unreachable_goal_reports_the_size_of_the_region(case):
    occupied, start, goal = case
    graph = move_lengths(occupied)
    _, labels = connected_components(graph, directed=False)
    labels = labels.reshape(occupied.shape)
    if labels[start] == labels[goal]:
        return
    region, free = (labels == labels[start]).sum(), (~occupied).sum()
    for method in METHODS:
        with pytest.raises(NoPathFound, match=f"only {region} of {free} free cells"):
            search(OccupancyGrid(occupied, 0.1), start, goal, method=method)


@pytest.mark.parametrize("method", METHODS)
def test_start_and_goal_may_coincide(method):
    found = search(ROOM, (3, 4), (3, 4), method=method)
    assert found.cells.tolist() == [[3, 4]]
    assert found.cost == 0.0


@pytest.mark.parametrize("method", METHODS)
def test_search_is_repeatable(method):
    occupied = np.random.default_rng(3).random((70, 90)) < 0.2
    occupied[1, 2] = occupied[66, 81] = False
    grid_search = GridSearch(OccupancyGrid(occupied, 0.1))
    first, second = (grid_search.search((1, 2), (66, 81), method=method) for _ in range(2))
    fresh = search(grid_search.grid, (1, 2), (66, 81), method=method)
    assert first.cells.tolist() == second.cells.tolist() == fresh.cells.tolist()
    assert first.expansions == second.expansions == fresh.expansions > 0
    assert first.seconds > 0.0


def test_costs_of_the_options():
    """The order of lengths and expansions stated in the documentation."""
    occupied = np.random.default_rng(5).random((150, 150)) < 0.2
    occupied[2, 3] = occupied[140, 100] = False
    grid = OccupancyGrid(occupied, 0.1)

    def run(**options):
        return search(grid, (2, 3), (140, 100), **options)

    octile, euclidean, zero, manhattan = (
        run(heuristic=name) for name in ("octile", "euclidean", "zero", "manhattan")
    )
    assert octile.cost == euclidean.cost == zero.cost < manhattan.cost <= octile.cost * 2**0.5
    assert octile.expansions < euclidean.expansions < zero.expansions
    four, four_octile = run(neighbours=4), run(neighbours=4, heuristic="octile")
    assert octile.cost < four.cost == four_octile.cost <= octile.cost * 2**0.5
    assert four.expansions < four_octile.expansions
    assert run(cut_corners=True).cost < octile.cost
    assert run(method="lazy-theta").cost < octile.cost
    assert run(method="greedy").expansions < octile.expansions
    assert run(method="greedy").cost > octile.cost
    assert run(method="jump-point").expansions < octile.expansions


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ((20, 3), r"\(row 20, column 3\) lies outside the grid of 20 rows and 30 columns"),
        ((-1, 3), r"\(row -1, column 3\) lies outside"),
        (
            (10, 9),
            r"\(row 10, column 9\) is occupied; "
            r"the nearest free cell is \(row 9, column 9\), 1 cell away$",
        ),
    ],
)
def test_invalid_cells_are_rejected(cell, message):
    occupied = np.zeros((20, 30), bool)
    occupied[10] = True
    grid = OccupancyGrid(occupied, 0.1)
    with pytest.raises(InvalidWaypoint, match="the start " + message):
        search(grid, cell, (3, 3))
    with pytest.raises(InvalidWaypoint, match="the goal " + message):
        search(grid, (3, 3), cell)


def test_map_without_free_cells_is_reported():
    with pytest.raises(InvalidWaypoint, match="no cell is free"):
        search(OccupancyGrid(np.ones((3, 4), bool), 0.1), (1, 1), (2, 2))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "dijkstra"}, "no search method 'dijkstra'; there are astar, jump-point"),
        ({"heuristic": "chebyshev"}, "no heuristic 'chebyshev'; there are octile, manhattan"),
        ({"neighbours": 6}, "neighbours must be 8 or 4, got 6"),
        ({"method": "jump-point", "neighbours": 4}, "jump-point .* use astar"),
        ({"method": "jump-point", "cut_corners": True}, "jump-point .* use astar"),
        ({"method": "lazy-theta", "cut_corners": True}, "lazy-theta .* use astar"),
    ],
)
def test_invalid_options_are_rejected(options, message):
    with pytest.raises(InvalidInput, match=message):
        search(ROOM, (1, 1), (5, 5), **options)
