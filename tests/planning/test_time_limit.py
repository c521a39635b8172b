"""Plans with a time limit, on a clock that advances by a fixed time whenever it is read."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, NoPathFound, NoPathYet
from omnidrive.maps import Inflation, OccupancyGrid, maze_map, random_map, rooms_map
from omnidrive.planning import PathOptions, Planner, Waypoint

MAPS = {
    "random": random_map(300, 300, 0.2, np.random.default_rng(1)),
    "maze": maze_map(300, 300, 8, np.random.default_rng(2)),
    "rooms": rooms_map(300, 300, 15, np.random.default_rng(3)),
}
LIMIT = 1.0  # s


class Clock:
    """Clock of which ``reads`` readings span the time limit."""

    def __init__(self, reads):
        self.step, self.now = LIMIT / reads, 0.0

    def __call__(self):
        self.now += self.step
        return self.now


def planner(name, costs=False, **options):
    grid = OccupancyGrid(MAPS[name].occupied, 0.05)
    around = Inflation() if costs else None
    return Planner(grid, inflation=0.0, options=PathOptions(**options), around_obstacles=around)


def ends(grid):
    """Return the first cell and the farthest that is connected with it, off their centres."""
    free = np.argwhere(~grid.occupied)
    start = next(c for c in free.tolist() if grid.region_size(*c) > len(free) // 2)
    goal = next(c for c in free[::-1].tolist() if grid.region_size(*c) > len(free) // 2)
    points = grid.centres(np.array([start, goal])) + np.array([[0.02, -0.015], [-0.02, 0.02]])
    return [Waypoint(*each) for each in points.tolist()]


def limited(planner, reads):
    return planner.plan(*ends(planner.grid), time_limit=LIMIT, clock=Clock(reads))


@pytest.mark.parametrize("costs", [False, True])
@pytest.mark.parametrize("name", MAPS)
def test_ample_time_gives_the_cost_of_a_plan_without_limit(name, costs):
    each = planner(name, costs)
    plan, exact = limited(each, 1e9), each.plan(*ends(each.grid))
    assert plan.status == "complete"
    assert plan.suboptimality == 1.0
    assert plan.search_result.cost == pytest.approx(exact.search_result.cost, rel=1e-9)


@pytest.mark.parametrize("costs", [False, True])
@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("reads", [12, 30, 80, 200, 500])
def test_paths_in_limited_time_are_free_and_bounded(name, costs, reads):
    each = planner(name, costs)
    try:
        plan = limited(each, reads)
    except NoPathYet:
        return
    exact = each.plan(*ends(each.grid)).search_result.cost
    assert exact <= plan.search_result.cost + 1e-9
    assert plan.search_result.cost <= exact * plan.suboptimality * (1.0 + 1e-6)
    if plan.status != "not optimal":
        assert plan.search_result.cost == pytest.approx(exact, rel=1e-9)
    lower, _ = plan.spline.clearance(plan.free_space)
    assert lower >= -1e-6
    assert 0.0 <= plan.clearance <= plan.spline.clearance(plan.free_space)[1] + 1e-9
    first, last = plan.spline.poses(0.0), plan.spline.poses(1.0)
    assert np.allclose([first[:2], last[:2]], [each[:2] for each in ends(plan.grid)])


def test_status_follows_the_time():
    each = planner("rooms", costs=True)
    with pytest.raises(NoPathYet, match="there may be one: allow more time"):
        limited(each, 1)
    found = [limited(each, reads).status for reads in (60, 10_000, 1_000_000)]
    assert found[0] == "not optimal"
    assert found[-1] == "complete"


def test_smoothing_ends_with_the_time():
    each = planner("maze")
    found = {limited(each, reads).status for reads in (100, 200, 400, 1000)}
    assert "not smoothed" in found


def test_unreachable_goal():
    occupied = MAPS["rooms"].occupied.copy()
    occupied[:, 150] = True
    each = Planner(OccupancyGrid(occupied, 0.05), inflation=0.0)
    start, goal = ends(planner("rooms").grid)
    with pytest.raises(NoPathFound, match="there is no path") as caught:
        each.plan(start, goal, time_limit=LIMIT, clock=Clock(1e9))
    assert not isinstance(caught.value, NoPathYet)


def test_changed_cells():
    each = planner("rooms")
    limited(each, 1e9)
    each.update([[40, 40]], occupied=True)
    changed = Planner(each.grid, inflation=0.0)
    plans = [limited(p, 1e9) for p in (each, changed)]
    assert np.array_equal(plans[0].spline.control_points, plans[1].spline.control_points)


def test_corner_cutting_spline():
    each = planner("random", cut_corners=True, smooth="spline")
    exact = each.plan(*ends(each.grid)).search_result.cost
    assert limited(each, 1e9).search_result.cost == pytest.approx(exact)


@pytest.mark.parametrize(
    ("limit", "options", "message"),
    [
        (0.0, {}, "time limit must be positive"),
        (float("nan"), {}, "time limit must be positive"),
        (1.0, {"search": "greedy"}, "greedy does not support a time limit; use astar"),
        (1.0, {"heuristic": "manhattan"}, "manhattan does not support a time limit; use octile"),
    ],
)
def test_rejected_arguments(limit, options, message):
    each = planner("rooms", **options)
    with pytest.raises(InvalidInput, match=message):
        each.plan(*ends(each.grid), time_limit=limit)
