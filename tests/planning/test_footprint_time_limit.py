"""Time limits of the search and the smoothing for a polygon."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, NoPathYet
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import Waypoint
from omnidrive.planning.deadline import Deadline
from omnidrive.planning.footprint import PoseSearch, plan_footprint, pose_search, search_poses
from tests.planning.footprints import CONVEX_PARTS, RECTANGLE, deepest_contact

ENDS = Waypoint(0.9, 0.8, 1.0), Waypoint(3.1, 3.2, -2.0)


def hall():
    """Two rooms with a door for the rectangle only."""
    occupied = np.zeros((40, 40), bool)
    occupied[:, 19:22] = True
    occupied[17:23, 19:22] = False
    return OccupancyGrid(occupied, 0.1)


@pytest.mark.parametrize("looks", [0, 1, 3, 10, 100, 10_000])
def test_search_in_limited_time_is_bounded(looks, monkeypatch):
    monkeypatch.setattr(pose_search, "_LOOK", 50)
    searcher, start, goal = PoseSearch(hall(), RECTANGLE), (8, 9, 12), (32, 30, 48)
    exact = searcher.search(start, goal)
    assert exact.suboptimality == 1.0
    left = iter(range(looks))
    try:
        found = searcher.search(start, goal, lambda _: next(left, None) is None)
    except NoPathYet:
        assert looks < 10_000
        return
    assert exact.cost <= found.cost + 1e-9
    assert found.suboptimality >= 1.0
    if looks == 10_000:
        np.testing.assert_array_equal(found.poses, exact.poses)


def test_ample_time_gives_the_plan_without_limit():
    plans = [plan_footprint(hall(), *ENDS, footprint=RECTANGLE, time_limit=t) for t in (None, 600)]
    assert {each.status for each in plans} == {"complete"}
    assert plans[1].suboptimality == 1.0
    np.testing.assert_array_equal(*(each.spline.control_points for each in plans))


def test_path_that_is_not_smoothed_is_free(monkeypatch):
    monkeypatch.setattr(Deadline, "ends_smoothing", lambda *_: lambda: True)
    found = plan_footprint(hall(), *ENDS, footprint=RECTANGLE, time_limit=600.0)
    assert (found.shape, found.status) == ("polygon", "not smoothed")
    poses = found.spline.poses(np.linspace(0.0, 1.0, 3000))
    assert deepest_contact(hall(), CONVEX_PARTS["rectangle"][1], poses) < 1e-9


def test_no_path_in_time():
    with pytest.raises(NoPathYet, match="there may be one: allow more time"):
        search_poses(hall(), RECTANGLE, (8, 9, 12), (32, 30, 48), time_limit=1e-9)
    with pytest.raises(NoPathYet, match="within the time limit"):
        plan_footprint(hall(), *ENDS, footprint=RECTANGLE, time_limit=1e-9)


@pytest.mark.parametrize("limit", [0.0, -2.0, float("nan")])
def test_limit_must_be_positive(limit):
    with pytest.raises(InvalidInput, match="time limit must be positive"):
        search_poses(hall(), RECTANGLE, (8, 9, 12), (32, 30, 48), time_limit=limit)
    with pytest.raises(InvalidInput, match="time limit must be positive"):
        plan_footprint(hall(), *ENDS, footprint=RECTANGLE, time_limit=limit)
