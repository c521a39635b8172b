"""Minimum time: corridor, free headings, and durations on the paper's map."""

import sys
from importlib import import_module
from itertools import pairwise
from math import inf

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidReference, MissingExtra, NoPathFound
from omnidrive.maps import OccupancyGrid, paper_map, rooms_map
from omnidrive.planning import PathOptions, SplinePath, Waypoint, plan
from omnidrive.reference import (
    Corridor,
    MotionLimits,
    minimum_time,
    time_within_limits,
)
from omnidrive.reference.headings.free_heading import free_heading
from omnidrive.reference.headings.initial_headings import with_end_headings
from omnidrive.reference.path_optimisation import transcription
from omnidrive.reference.path_optimisation.spline_basis import bezier_basis
from omnidrive.reference.path_optimisation.transcription import (
    InitialGuess,
    OptimisedPath,
    Transcription,
    _limit_step,
    optimise_path,
)
from omnidrive.reference.timing.limits import limit_rows
from omnidrive.robot import Chassis, named_robot
from tests.reference.sample_paths import CROSS, FOUR, straight, turning, wandering, worst_shares

MODULE = import_module(
    "omnidrive.reference.path_optimisation.minimum_time"
)  # the package exports a function of this name

PIECES = MODULE._PIECES
ALPHA = 25.0
LIMITS = MotionLimits(wheel_acceleration=ALPHA)

# the paper's map, wheels at 0.15 m, 1.06 m/s and 1 m/s^2 at the rim
PAPER = Chassis.omni(angles=CROSS, ring_radius=0.15, wheel_radius=0.05, max_wheel_speed=1.06 / 0.05)
PAPER_LIMITS = MotionLimits(wheel_acceleration=1.0 / 0.05)


@pytest.fixture(scope="module")
def papers_path():
    return plan(
        paper_map(), Waypoint(1.0, 1.0), Waypoint(8.0, 6.0), inflation=0.0,
        options=PathOptions(smooth="spline", turn_within=0.0),
    ).spline  # fmt: skip


def room():
    """Return a map with a wall between two halves, and a path around its end."""
    occupied = np.zeros((30, 30), bool)
    occupied[:16, 14] = True
    grid, options = OccupancyGrid(occupied, 0.2), PathOptions(smooth="spline", turn_within=0.0)
    ends = Waypoint(1.0, 1.0), Waypoint(5.0, 1.5)
    return grid, plan(grid, *ends, inflation=0.0, options=options).spline


@pytest.fixture(scope="module", params=["room", pytest.param("paper", marks=pytest.mark.long)])
def optimised(request):
    """A map, a path on it, and the minimum; in the room with a quarter of the spline's pieces."""
    if request.param == "paper":
        grid, path = paper_map(), request.getfixturevalue("papers_path")
        return grid, path, minimum_time(path, PAPER, PAPER_LIMITS, grid)
    grid, path = room()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MODULE, "_PIECES", PIECES // 4)
        return grid, path, minimum_time(path, PAPER, PAPER_LIMITS, grid)


def test_minimum_is_shorter_than_with_tangent_heading(optimised):
    """On the paper's map the robot needs two thirds of the time."""
    grid, path, minimum = optimised
    tangent = time_within_limits(path, PAPER, PAPER_LIMITS, heading="tangent").duration
    assert minimum.status == "converged"
    on_paper = grid.occupied.shape == paper_map().occupied.shape
    assert tangent == pytest.approx(11.48 if on_paper else 7.92, abs=0.02)
    assert minimum.reference.duration <= (7.55 if on_paper else 5.14)


def test_limits_hold(optimised):
    reference = optimised[-1].reference
    assert max(worst_shares(reference, PAPER, 20.0)) <= 1.01
    assert max(reference.limit_usage.values()) <= 1.0 + 1e-9


def test_path_stays_in_corridor(optimised):
    grid, _, minimum = optimised
    corridor = minimum.corridor
    pieces = corridor.pieces(PIECES if len(minimum.path.control_points) > PIECES else PIECES // 4)
    assert corridor.contains(minimum.path.control_points, pieces)
    window = minimum.reference.window(0.0, 20_001, minimum.reference.duration / 2e4)
    assert not any(grid.is_occupied(x, y) for x, y in window[:, :2].tolist())
    left, right, bottom, top = corridor.boxes.T
    x, y, _ = np.hsplit(corridor.from_world(window[:, :3]), 3)
    assert ((left <= x) & (x <= right) & (bottom <= y) & (y <= top)).any(axis=1).all()


def test_path_joins_start_and_goal(optimised):
    _, path, minimum = optimised
    reference = minimum.reference
    ends = np.array([reference.at(0.0).pose, reference.at(reference.duration).pose])
    assert ends[:, :2] == pytest.approx(path.control_points[[0, -1], :2], abs=1e-9)


@pytest.mark.long
def test_end_headings_are_met(papers_path):
    found = minimum_time(
        papers_path, PAPER, PAPER_LIMITS, paper_map(), start_yaw=0.0, goal_yaw=-2.0
    )
    reference = found.reference
    assert found.status == "converged"
    assert reference.at(0.0).pose.yaw == pytest.approx(0.0, abs=1e-9)
    turned = reference.at(reference.duration).pose.yaw + 2.0
    assert np.cos(turned) == pytest.approx(1.0)


@pytest.mark.long
def test_result_is_never_slower_than_start_path():
    """In a corridor one cell wide the gain is small."""
    occupied = np.ones((40, 40), dtype=bool)
    occupied[20, 2:38] = occupied[20:38, 37] = False
    grid = OccupancyGrid(occupied, 0.1)
    ends = Waypoint(0.25, 2.05), Waypoint(3.75, 3.75)
    path = plan(grid, *ends, inflation=0.0, options=PathOptions(smooth="spline")).spline
    found = minimum_time(path, FOUR, LIMITS, grid)
    start = time_within_limits(path, FOUR, LIMITS)
    assert found.reference.duration <= start.duration


def test_fallback_if_path_is_not_free(papers_path):
    blank = paper_map()
    grid = OccupancyGrid(np.ones_like(blank.occupied), blank.resolution, blank.origin)
    found = minimum_time(papers_path, PAPER, PAPER_LIMITS, grid)
    assert found.status == "fallback"
    assert found.path is papers_path
    assert "no corridor" in found.message
    start = time_within_limits(papers_path, PAPER, PAPER_LIMITS)
    assert found.reference.duration == start.duration


def ends_of(reference):
    return [reference.at(t).pose.yaw for t in (0.0, reference.duration)]


@pytest.mark.parametrize("grid", [np.ones((90, 90), bool), np.zeros((90, 90), bool)])
def test_fallback_keeps_end_headings(grid, monkeypatch):
    """Without a corridor, and with a corridor whose best motion is (by a stub) slow."""
    path, yaws = straight(4.0, yaw=0.3), (1.0, -2.5)
    adjusted = with_end_headings(path, *yaws)
    slow = time_within_limits(adjusted, FOUR, LIMITS).with_duration(1e3)
    monkeypatch.setattr(
        MODULE,
        "optimise_path",
        lambda guesses, *_: OptimisedPath(slow, guesses[0].path, "guess"),
    )
    monkeypatch.setattr(MODULE, "_GAIN", 0.9)
    free = OccupancyGrid(grid, 0.1, (-2.0, -2.0))
    found = minimum_time(path, FOUR, LIMITS, free, start_yaw=yaws[0], goal_yaw=yaws[1])
    assert found.status == "fallback"
    assert np.cos(np.array(ends_of(found.reference)) - yaws) == pytest.approx([1.0, 1.0])
    assert found.path.control_points[:, :2] == pytest.approx(path.control_points[:, :2])
    assert max(worst_shares(found.reference, FOUR, ALPHA)) <= 1.01


def test_fallback_if_nothing_is_faster(monkeypatch):
    """One of the initial guesses is the start path, which is not faster than itself."""
    path, free = straight(4.0), OccupancyGrid(np.zeros((90, 90), bool), 0.1, (-2.0, -2.0))
    start = time_within_limits(path, FOUR, LIMITS)
    monkeypatch.setattr(Corridor, "contains", lambda *_: True)
    for source in ("guess", "converged", "capped"):
        monkeypatch.setattr(
            MODULE,
            "optimise_path",
            lambda *_, source=source: OptimisedPath(
                start, SplinePath(np.add(path.control_points, [2.0, 2.0, 0.0])), source
            ),
        )
        found = minimum_time(path, FOUR, LIMITS, free)
        assert found.status == "fallback"
        assert "instead of" not in found.message


def test_status_of_a_faster_guess(monkeypatch):
    """The headings of the start path are poor, those of a guess are good."""
    points = straight(4.0).control_points
    points[:, 2] = 3.0 * np.sin(np.arange(len(points)))
    free = OccupancyGrid(np.zeros((90, 90), bool), 0.1, (-2.0, -2.0))
    monkeypatch.setattr(
        Transcription, "solve", lambda _self, guess, _timed: (guess.path, False)
    )  # a path without motion
    monkeypatch.setattr(MODULE, "_PIECES", PIECES // 4)
    found = minimum_time(SplinePath(points), FOUR, LIMITS, free)
    assert found.status == "guess"
    assert found.reference.duration < time_within_limits(SplinePath(points), FOUR, LIMITS).duration


def test_fallback_if_path_leaves_the_corridor(monkeypatch):
    """A path outside the free boxes is never returned, whatever the optimiser's status."""
    path = straight(4.0)
    free = OccupancyGrid(np.zeros((90, 90), bool), 0.1, (-2.0, -2.0))
    start = time_within_limits(path, FOUR, LIMITS)

    def leave_corridor(guesses, *_):
        points = guesses[0].path.control_points.copy()
        points[20, 1] = 50.0
        return OptimisedPath(start, SplinePath(points), "converged")

    monkeypatch.setattr(MODULE, "optimise_path", leave_corridor)
    found = minimum_time(path, FOUR, LIMITS, free)
    assert found.status == "fallback"
    assert "leaves the corridor" in found.message
    assert found.path is path


def test_turn_on_the_spot_is_a_fallback():
    found = minimum_time(turning(1.0), FOUR, LIMITS, OccupancyGrid(np.zeros((9, 9), bool), 1.0))
    assert found.status == "fallback"
    assert "only turns" in found.message


def test_free_headings_meet_end_headings():
    rows = limit_rows(FOUR, LIMITS)
    points = free_heading(wandering(0), rows, start_yaw=7.0, goal_yaw=-2.0).control_points
    assert points[0, 2] == 7.0
    assert np.cos(points[-1, 2] + 2.0) == pytest.approx(1.0)
    assert points[:, :2] == pytest.approx(wandering(0).control_points[:, :2], abs=1e-12)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.long) for n in (1, 2))])
def test_free_headings_are_never_slower(seed):
    path = wandering(seed)
    free = time_within_limits(path, FOUR, LIMITS, heading="free")
    for heading in ("path", "fixed"):
        other = time_within_limits(path, FOUR, LIMITS, heading=heading)
        assert free.duration <= other.duration * 1.001
    assert max(worst_shares(free, FOUR, ALPHA)) <= 1.01


def test_free_heading_on_straight_line_is_the_fastest_direction():
    """Four wheels at 45 degrees are fastest along the axes of B, by the square root of 2."""
    path = straight(20.0, angle=0.25 * np.pi)
    fixed = time_within_limits(path, FOUR, LIMITS, heading="fixed")
    free = time_within_limits(path, FOUR, LIMITS, heading="free")
    assert free.duration == pytest.approx(20.0 / 2.1213 + 2.1213 / 1.7678, rel=3e-3)
    assert fixed.duration == pytest.approx(20.0 / 1.5 + 1.5 / 1.25, rel=3e-3)


@pytest.mark.parametrize("heading", [inf, np.nan])
def test_end_headings_must_be_finite(papers_path, heading):
    with pytest.raises(InvalidInput, match="heading at the goal must be a finite angle"):
        minimum_time(papers_path, PAPER, PAPER_LIMITS, paper_map(), goal_yaw=heading)


def test_too_many_headings_are_rejected():
    with pytest.raises(InvalidReference, match="at most 1000 control points"):
        time_within_limits(straight(10.0, points=1001), FOUR, LIMITS, heading="free")


def test_message_without_casadi(papers_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(MissingExtra, match="pip install casadi"):
        minimum_time(papers_path, PAPER, PAPER_LIMITS, paper_map())
    with pytest.raises(MissingExtra, match="timing 'limits'"):
        time_within_limits(papers_path, PAPER, PAPER_LIMITS, heading="free")


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        pytest.param(1.0, None, marks=pytest.mark.long),
        pytest.param(None, -2.0, marks=pytest.mark.long),
        (0.5, 3.0),
    ],
)
def test_free_headings_meet_required_ends(start, goal):
    reference = time_within_limits(
        wandering(1), FOUR, LIMITS, heading="free", start_yaw=start, goal_yaw=goal
    )
    for own, required in zip(ends_of(reference), (start, goal), strict=True):
        assert required is None or np.cos(own - required) == pytest.approx(1.0)


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0])
def test_corridor_boxes_are_free_and_overlap(yaw):
    rng = np.random.default_rng(4)
    grid = OccupancyGrid(rng.random((60, 60)) < 0.15, 0.1, (-1.0, 2.0), yaw=yaw)
    grid.occupied[[1, 58], [1, 58]] = False
    grid_path = plan(
        grid, Waypoint(*grid.centre(1, 1)), Waypoint(*grid.centre(58, 58)), inflation=0.0,
        options=PathOptions(),
    ).grid_path  # fmt: skip
    corridor = Corridor.along(grid_path.poses[:, :2], grid)
    for left, right, bottom, top in corridor.boxes.tolist():
        x, y = np.meshgrid(np.linspace(left, right, 60), np.linspace(bottom, top, 60))
        inside = np.column_stack([x.ravel(), y.ravel(), 0.0 * x.ravel()])
        inside[:, :2] += 1e-6 * np.sign(
            [0.5 * (left + right), 0.5 * (bottom + top)] - inside[:, :2]
        )
        assert not grid.occupied_at(corridor.to_world(inside)[:, :2]).any()
    a, b = corridor.boxes[:-1], corridor.boxes[1:]
    assert (np.minimum(a[:, [1, 3]], b[:, [1, 3]]) > np.maximum(a[:, [0, 2]], b[:, [0, 2]])).all()
    assert (np.diff(corridor.box_ends) > 0.0).all()
    low, high = corridor.control_point_bounds(corridor.pieces(48))
    assert (low < high).all()


@pytest.mark.long
def test_rotated_map_gives_rotated_motion():
    """A path around an obstacle, on a map and on the map rotated about its origin."""
    occupied = np.zeros((40, 60), bool)
    occupied[:26, 28:32] = True
    cells = np.array([[10, 10], [20, 16], [30, 24], [32, 30], [30, 36], [20, 44], [10, 50]])
    found = []
    for yaw in (0.0, 0.7):
        grid = OccupancyGrid(occupied, 0.1, (1.0, -2.0), yaw=yaw)
        points = np.column_stack([grid.centres(cells), np.full(len(cells), 0.2 + yaw)])
        path = SplinePath(points)
        assert path.clearance(grid)[0] > 0.0
        best = minimum_time(path, FOUR, LIMITS, grid, start_yaw=0.2 + yaw, goal_yaw=1.0 + yaw)
        assert best.status == "converged"
        assert best.path.clearance(grid)[0] >= 0.0
        found.append(best)
    level, turned = found
    assert turned.reference.duration == pytest.approx(level.reference.duration, rel=1e-2)
    assert np.cos(ends_of(turned.reference)[0] - 0.9) == pytest.approx(1.0)
    assert np.cos(ends_of(turned.reference)[1] - 1.7) == pytest.approx(1.0)


def test_corridor_needs_a_free_path():
    grid = OccupancyGrid(np.zeros((10, 10), dtype=bool), 1.0)
    grid.occupied[5, 5] = True
    with pytest.raises(NoPathFound, match=r"not free at \(5.50, 5.50\) m"):
        Corridor.along(np.array([[1.5, 5.5], [8.5, 5.5]]), grid)
    with pytest.raises(NoPathFound, match="not free"):
        Corridor.along(np.array([[1.5, 1.5], [20.5, 1.5]]), grid)
    with pytest.raises(NoPathFound, match="too long"):
        Corridor.along(np.array([[0.0, 0.0], [1e9, 0.0]]), grid)


@pytest.mark.parametrize("points", [4, 5, 6, 9, 30])
def test_bezier_points_give_the_same_curve(points):
    """Each piece, evaluated by de Casteljau's algorithm."""
    path = SplinePath(np.random.default_rng(points).normal(size=(points, 3)))
    bezier = bezier_basis(points) @ path.control_points
    r = np.linspace(0.0, 1.0, 7)[:, None]
    for piece in range(points - 3):
        polygon = [bezier[3 * piece + k] for k in range(4)]
        while len(polygon) > 1:
            polygon = [a + r * (b - a) for a, b in pairwise(polygon)]
        assert polygon[0] == pytest.approx(path.poses((piece + r[:, 0]) / (points - 3)), abs=1e-12)


@pytest.mark.parametrize("excess", [0.0, 1e-5, 0.3])
def test_step_is_limited_to_the_bounds(excess):
    """The result is on the line to the solver's result, as far as the bounds allow."""
    start = np.column_stack([np.linspace(0.0, 9.0, 10), np.zeros((10, 2))])
    found = start + np.array([0.0, 1.0 + excess, 0.5]) * (np.arange(10) == 5)[:, None]
    reached = bezier_basis(10) @ found[:, :2]
    largest = (reached / [1.0, 1.0 + excess]).max(axis=0)
    hull = np.tile([0.0, 0.0, *largest], (len(reached), 1))
    limited = _limit_step(start, found, hull)
    kept = bezier_basis(10) @ limited[:, :2]
    assert kept.max(axis=0) == pytest.approx(largest, abs=1e-12)
    assert limited[5] == pytest.approx([start[5, 0], 1.0, 0.5 / (1.0 + excess)])
    assert _limit_step(start, found, None) is found


@pytest.mark.long
def test_gain_through_narrow_doors():
    """Rooms with narrow doors, crossed at an angle, where boxes overlap little."""
    robot = named_robot("small")
    grid = rooms_map(96, 96, 31, np.random.default_rng(0), door=6, resolution=0.25)
    room = robot.body_radius + grid.resolution * 0.5**0.5
    ends = Waypoint(1.0, 1.0), Waypoint(22.0, 22.0)
    found = plan(grid, *ends, inflation=room, options=PathOptions())
    limits = MotionLimits.of_robot(robot)
    best = minimum_time(found.spline, robot.chassis, limits, found.free_space)
    start = time_within_limits(found.spline, robot.chassis, limits)
    assert best.status == "converged"
    assert best.reference.duration < 0.97 * start.duration
    assert max(best.reference.limit_usage.values()) <= 1.0 + 1e-9
    assert best.path.clearance(found.free_space)[0] >= 0.0


def test_one_guess_is_optimised_for_large_splines(monkeypatch):
    solved = []

    def solve(_self, guess, _timed):
        solved.append(guess)
        return guess.path, True

    monkeypatch.setattr(Transcription, "solve", solve)
    program = (None, np.zeros(0))
    monkeypatch.setattr(transcription, "_program", lambda *_: program)  # takes seconds
    rows = limit_rows(FOUR, LIMITS)
    for points, starts in ((200, 2), (201, 1)):
        path = straight(10.0, points=points)
        guesses = [InitialGuess(path, path.control_points, path.control_points)] * 3
        optimise_path(guesses, path.length, rows)
        assert len(solved) == starts
        solved.clear()


def test_spline_outside_its_boxes_is_detected():
    grid = OccupancyGrid(np.zeros((10, 10), dtype=bool), 1.0)
    corridor = Corridor.along(np.array([[1.5, 5.5], [8.5, 5.5]]), grid)
    pieces = corridor.pieces(5)
    path = SplinePath(np.column_stack([np.linspace(1.5, 8.5, 8), np.full(8, 5.5), np.zeros(8)]))
    assert corridor.contains(path.control_points, pieces)
    for y, inside in ((10.5, True), (13.0, False)):  # above the grid's last row, at 10
        path.control_points[3, 1] = y
        assert corridor.contains(path.control_points, pieces) == inside
        assert (path.poses(np.linspace(0.0, 1.0, 500))[:, 1].max() < 10.0) == inside


@pytest.mark.long
@pytest.mark.parametrize(
    ("seed", "yaw"), [*((seed, 0.0) for seed in range(8)), (1, 0.05), (2, 1.0), (3, -2.5)]
)
def test_path_never_enters_an_obstacle(seed, yaw):
    """On random maps: in free cells, within the limits, never slower than the start path."""
    rng = np.random.default_rng(seed)
    grid = OccupancyGrid(rng.random((50, 50)) < 0.12, 0.2, yaw=yaw)
    grid.occupied[[2, 46], [3, 45]] = False
    ends = [Waypoint(*grid.centre(2, 3)), Waypoint(*grid.centre(46, 45))]
    path = plan(grid, *ends, inflation=0.0, options=PathOptions(smooth="spline")).spline
    found = minimum_time(path, FOUR, LIMITS, grid)
    assert found.status != "fallback"
    assert found.reference.duration < time_within_limits(path, FOUR, LIMITS).duration
    assert max(worst_shares(found.reference, FOUR, ALPHA)) <= 1.01
    window = found.reference.window(0.0, 20_001, found.reference.duration / 2e4)
    assert not any(grid.is_occupied(x, y) for x, y in window[:, :2].tolist())
    pieces = found.corridor.pieces(48)
    assert found.corridor.contains(found.path.control_points, pieces)


def test_time_limit_leaves_the_best_path_so_far():
    grid, path = room()
    found = minimum_time(path, PAPER, PAPER_LIMITS, grid, time_limit=1e-6)
    start = time_within_limits(path, PAPER, PAPER_LIMITS)
    assert found.status in {"guess", "fallback"}
    assert found.reference.duration <= start.duration
    with pytest.raises(InvalidInput, match="time limit must be positive, got 0 s"):
        minimum_time(path, PAPER, PAPER_LIMITS, grid, time_limit=0.0)


def test_solver_stops_at_the_time_limit(monkeypatch):
    """The time limit reaches the solver, which then has not converged."""
    grid, path = room()
    monkeypatch.setattr(transcription.Deadline, "left", lambda _self: 1e-3)
    found = minimum_time(path, PAPER, PAPER_LIMITS, grid, time_limit=600.0)
    assert found.status in {"capped", "guess", "fallback"}
