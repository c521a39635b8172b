"""Curvature of planned paths: its rate, limits, and paths without kinks."""

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, NoPathFound
from omnidrive.maps import CostMap, Inflation, OccupancyGrid
from omnidrive.planning import PathOptions, Planner, SplinePath, plan
from omnidrive.planning.pieces import pieces
from omnidrive.planning.smoothing.fairing import CurvatureLimits, is_within
from tests.reference.sample_paths import wandering


def blocks(seed, size=120, count=12):
    """Return a map of 0.05 m with random rectangles."""
    rng = np.random.default_rng(seed)
    occupied = np.zeros((size, size), bool)
    for row, col in rng.integers(10, size - 20, (count, 2)).tolist():
        height, width = rng.integers(4, 14, 2).tolist()
        occupied[row : row + height, col : col + width] = True
    return OccupancyGrid(occupied, 0.05)


def fine(path, per_piece):
    """Return the greatest curvature and rate of a path by definition, from dense samples."""
    count = len(path.control_points) - 3
    inner = (np.arange(count)[:, None] + np.linspace(1e-7, 1.0 - 1e-7, per_piece)) / count
    _, d1, d2 = (spline(inner.ravel())[:, :2] for spline in path._derivatives)
    d3 = path._derivatives[2].derivative()(inner.ravel())[:, :2]
    speed = np.linalg.norm(d1, axis=1)
    turn = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    change = d1[:, 0] * d3[:, 1] - d1[:, 1] * d3[:, 0]
    rate = (change - 3.0 * turn * (d1 * d2).sum(axis=1) / speed**2) / speed**4
    return np.abs(turn / speed**3).max(), np.abs(rate).max()


def planned(seed, **options):
    grid = blocks(seed)
    return plan(
        grid, (0.3, 0.3), (5.7, 5.7), inflation=0.1, options=PathOptions(**options),
        around_obstacles=Inflation(),
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_rate_of_the_curvature_is_its_derivative(seed):
    path = wandering(seed)
    curvature, rate = fine(path, 400)
    assert path.max_curvature_rate == pytest.approx(rate, rel=1e-3)
    assert path.max_curvature_rate >= rate * (1.0 - 1e-9)
    u = np.linspace(0.0, 1.0, 200_001)
    speeds = np.linalg.norm(path.first_derivatives(u)[:, :2], axis=1)
    step = np.diff(u) * 0.5 * (speeds[:-1] + speeds[1:])
    assert np.abs(np.diff(path.curvature(u)) / step).max() == pytest.approx(rate, rel=1e-2)
    assert path.max_curvature[0] * (1.0 - 1e-4) <= curvature <= path.max_curvature[1]


def test_rate_at_a_corner_is_infinite():
    corner = np.repeat([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [1, 3, 1], axis=0)
    assert SplinePath(corner).max_curvature_rate == np.inf
    assert not is_within(pieces(corner[:, :2]), CurvatureLimits(rate=1e9))


@pytest.mark.parametrize("seed", range(4))
def test_limits_of_the_curvature_are_kept(seed):
    free = planned(seed).spline
    limits = 0.93 * free.max_curvature[1], 0.93 * free.max_curvature_rate
    found = planned(seed, max_curvature=limits[0], max_curvature_rate=limits[1])
    assert found.clearance >= 0.0
    for value, limit in zip(fine(found.spline, 100), limits, strict=True):
        assert value <= limit * (1.0 + 1e-9)


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 200, 20))
def test_limits_of_the_curvature_are_kept_on_random_maps(first):
    kept = 0
    for seed in range(first, first + 20):
        rng = np.random.default_rng(seed)
        limits = 10.0 ** rng.uniform(-0.3, 0.7), 10.0 ** rng.uniform(0.0, 1.3)
        try:
            found = planned(seed, max_curvature=limits[0], max_curvature_rate=limits[1])
        except NoPathFound:
            continue
        kept += 1
        for value, limit in zip(fine(found.spline, 800), limits, strict=True):
            assert value <= limit * (1.0 + 1e-9)
        assert found.spline.clearance(found.free_space)[1] >= 0.0
    assert kept >= 10


def test_a_path_with_costs_has_no_kinks():
    """Its curvature changes more slowly than that of a path of low curvature only."""
    rates = []
    for seed in range(8):
        grid = blocks(seed)
        both = [
            plan(
                grid, (0.3, 0.3), (5.7, 5.7), inflation=0.1, options=PathOptions(), costs=costs
            ).spline
            for costs in (None, CostMap.of(grid).with_inflation(0.1, Inflation(0.2, 1.0, 0.01)))
        ]
        rates.append([each.max_curvature_rate for each in both])
    without, fair = np.median(rates, axis=0)
    assert fair < 0.5 * without


def test_limits_that_no_path_keeps_are_named():
    with pytest.raises(NoPathFound, match=r"curvature within 0.01 1/m was found.* at \("):
        planned(1, max_curvature=0.01)


def test_limits_need_a_certified_path():
    with pytest.raises(InvalidInput, match="smooth: certified"):
        PathOptions(smooth="spline", max_curvature=1.0)


def test_no_time_to_keep_limits():
    planner = Planner(blocks(2), inflation=0.1, options=PathOptions(max_curvature=2.0))
    ticks = iter(np.arange(0.0, 1e6))
    with pytest.raises(NoPathFound, match=r"in time|within the time"):
        planner.plan((0.3, 0.3), (5.7, 5.7), time_limit=2.0, clock=lambda: float(next(ticks)))
