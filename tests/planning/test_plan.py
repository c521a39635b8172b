"""Planning from start to goal: end poses, headings and rejected waypoints."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from omnidrive.errors import InvalidInput, InvalidWaypoint, NoPathFound
from omnidrive.maps import OccupancyGrid
from omnidrive.planning import PathOptions, SplinePath, Waypoint, plan
from tests.examples import examples

ROOM = OccupancyGrid(np.zeros((40, 60), bool), 0.1)


def room(*walls):
    occupied = np.zeros((40, 60), bool)
    for rows, cols in walls:
        occupied[rows, cols] = True
    return OccupancyGrid(occupied, 0.1)


def plan_path(grid, start=(1.0, 1.0), goal=(5.0, 3.0), inflation=0.3, min_inflation=0.0, **options):
    return plan(
        grid, Waypoint(*start), Waypoint(*goal), inflation=inflation,
        options=PathOptions(**options), min_inflation=min_inflation,
    )  # fmt: skip


@examples(40)
@given(
    occupied=arrays(bool, (12, 14), elements=st.sampled_from([False, False, False, True])),
    inflation=st.sampled_from([0.0, 0.05, 0.12]),
)
def test_path_stays_in_free_cells(occupied, inflation):
    occupied[1, 1] = occupied[10, 12] = False
    grid = OccupancyGrid(np.kron(occupied, np.ones((2, 2))).astype(bool), 0.1)
    try:
        spline = plan_path(grid, (0.3, 0.3), (2.5, 2.1), inflation).spline
    except (NoPathFound, InvalidWaypoint):
        return
    free = grid.inflated(inflation)
    x, y, _ = spline.poses(np.linspace(0.0, 1.0, 1500)).T
    assert not any(map(free.is_occupied, x.tolist(), y.tolist()))


def test_path_ends_at_start_and_goal():
    plan = plan_path(ROOM, (1.03, 1.07), (5.02, 3.01, 1.0))
    assert plan.spline.poses(0.0)[:2] == pytest.approx((1.03, 1.07))
    assert plan.spline.poses(1.0) == pytest.approx((5.02, 3.01, 1.0))
    assert plan.grid_path.poses[0, :2] == pytest.approx((1.03, 1.07))


@given(start=st.floats(-6.2, 6.2), goal=st.floats(-6.2, 6.2), x=st.sampled_from([1, 1.2, 2, 5]))
@examples(60)
def test_headings_are_continuous_and_match_the_ends(start, goal, x):
    """Also for a path shorter than ``turn_within``, and for a turn on the spot."""
    spline = plan_path(ROOM, (1.0, 1.0, start), (x, 1.0, goal)).spline
    yaw = spline.poses(np.linspace(0.0, 1.0, 1000))[:, 2]
    assert yaw[0] == pytest.approx(start)
    assert np.cos(yaw[-1] - goal) == pytest.approx(1.0)
    assert np.abs(np.diff(yaw)).max() < 0.1
    assert np.ptp(yaw) < 2.1 * pi


def test_start_and_goal_may_coincide():
    spline = plan_path(ROOM, (2.0, 2.0), (2.0, 2.0)).spline
    assert spline.length == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("waypoint", "message"),
    [
        ((7.0, 1.0), "outside the map, which spans x 0 to 6 m and y 0 to 4 m"),
        ((3.05, 1.0), r"inside an obstacle, .*nearest valid position is \(2\.\d+, 0?\.?\d*"),
        ((2.8, 1.0), r"is 0\.20 m from an obstacle; the robot's centre must keep 0\.3 m, also"),
        ((np.nan, 1.0), "must be finite"),
        ((1.0, 1.0, np.inf), "must be finite"),
    ],
)
@pytest.mark.parametrize("end", ["start", "goal"])
def test_invalid_waypoint_is_rejected(end, waypoint, message):
    grid = room((slice(0, 30), slice(30, 32)))
    with pytest.raises(InvalidWaypoint, match=message) as caught:
        plan_path(grid, **{end: waypoint})
    assert end in str(caught.value)


def test_proposed_position_is_valid():
    grid = room((slice(0, 30), slice(30, 32)))
    with pytest.raises(InvalidWaypoint) as caught:
        plan_path(grid, start=(3.05, 1.0))
    x, y = map(float, str(caught.value).rsplit("(", 1)[1].split(")")[0].split(","))
    assert f"{np.hypot(x - 3.05, y - 1.0):.2g} m away" in str(caught.value)
    plan_path(grid, start=(x, y))


def test_wall_across_the_map_leaves_no_path():
    with pytest.raises(NoPathFound, match="no path from start to goal"):
        plan_path(room((slice(0, 40), slice(30, 32))))


def test_map_without_free_cells_is_reported():
    with pytest.raises(
        InvalidWaypoint,
        match=r"lower the margin .--margin on the command line; .* keyword inflation",
    ):
        plan_path(ROOM, inflation=3.0)


def test_way_out_of_a_narrow_map_helps():
    """A lower margin is advised only if there is a path without a margin."""
    occupied = np.zeros((40, 60), bool)
    occupied[:, 30] = True
    occupied[10:15, 30] = False  # a gap of 0.5 m
    grid = OccupancyGrid(occupied, 0.1)
    for least, advice in ((0.1, "lower the margin"), (0.35, "the robot is too large without a")):
        with pytest.raises(NoPathFound, match=advice):
            plan_path(grid, inflation=0.4, min_inflation=least)
    occupied[10:15, 30] = True
    with pytest.raises(NoPathFound, match="a robot of any size needs a gap in the obstacles"):
        plan_path(grid, inflation=0.4)
    with pytest.raises(InvalidWaypoint, match="the robot is too large without a margin"):
        plan_path(ROOM, inflation=3.0, min_inflation=2.9)


def test_spline_needs_four_finite_control_points():
    with pytest.raises(InvalidInput, match="needs at least 4 control points, got 3"):
        SplinePath(np.zeros((3, 3)))
    with pytest.raises(InvalidInput, match="must be finite"):
        SplinePath(np.full((4, 3), np.nan))


def test_spline_length_of_a_straight_line():
    points = np.column_stack([np.linspace(0, 3, 7), np.linspace(0, 4, 7), np.zeros(7)])
    assert SplinePath(points).length == pytest.approx(5.0, rel=1e-6)


@pytest.mark.parametrize(
    "waypoint",
    [Waypoint("a", 1.0), Waypoint(1.0, None), Waypoint(1.0, 1.0, "east"), Waypoint([1.0], 1.0)],
)
def test_non_numeric_waypoint_is_rejected(waypoint):
    with pytest.raises(
        InvalidWaypoint, match=r"the goal must be two or three numbers, x and y in m"
    ):
        plan_path(room(), goal=waypoint)


def test_waypoint_accepts_any_numeric_type():
    found = plan_path(room(), start=(np.float32(1.0), np.int64(1)), goal=(5, 3))
    assert (found.grid_path.poses == plan_path(room()).grid_path.poses).all()


def test_distant_waypoint_lies_outside_the_map():
    with pytest.raises(InvalidWaypoint, match=r"the goal \(1e\+308, 1\) m lies outside the map"):
        plan_path(room(), goal=Waypoint(1e308, 1.0))


@pytest.mark.parametrize("inflation", [-0.1, np.nan, np.inf])
def test_invalid_inflation_is_rejected(inflation):
    with pytest.raises(InvalidInput, match="a finite radius of 0 m or more, got"):
        plan_path(room(), inflation=inflation)


@pytest.mark.parametrize("inflation", [0.3, 9.0])
def test_message_contains_the_inflation_note(inflation):
    with pytest.raises(InvalidWaypoint, match=r"keeps? (0\.3|9) m \(this and that\)"):
        plan(
            room((slice(0, 30), slice(30, 32))),
            Waypoint(2.8, 1.0),
            Waypoint(5.0, 3.0),
            inflation=inflation,
            options=PathOptions(),
            inflation_note="this and that",
        )
