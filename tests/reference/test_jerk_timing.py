"""Timing with limits of the jerk: analytic cases, invariants, an independent optimiser."""

from math import inf, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import WorldTwist
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.reference import MotionLimits, SmoothReference, TimedReference, time_within_limits
from omnidrive.reference.timing.limits import jerk_rows, limit_rows
from omnidrive.reference.timing.piecewise_path import PiecewisePath
from omnidrive.robot import Chassis
from tests.examples import examples
from tests.reference.jerk_oracle import shortest_duration_by_ipopt
from tests.reference.sample_paths import CHASSIS, CROSS, FOUR, straight, turning, wandering

LIMITS = MotionLimits(wheel_acceleration=25.0, jerk=3.0, yaw_jerk=20.0)


def s_curve(length, speed, acceleration, jerk):
    """Return the time from rest to rest over a distance with limited jerk."""

    def rise(top):  # time from rest to a speed
        return (
            top / acceleration + acceleration / jerk
            if top * jerk > acceleration**2
            else 2 * sqrt(top / jerk)
        )

    if length >= speed * rise(speed):
        return length / speed + rise(speed)
    low, high = 0.0, speed
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle * rise(middle) < length else (low, middle)
    return 2.0 * rise(low)


def fine_shares(reference, limits, per_interval=100):
    """Return the largest norms of jerk and yaw jerk as shares of their limits, by differences.

    The mean jerk over a step, which is sampled, is at most the largest within it.
    """
    times = np.unique(
        np.linspace(reference.times[:-1], reference.times[1:], per_interval + 1).ravel()
    )
    window = np.array([reference.window(t, 3, 1e-4)[:, 3:] for t in times if t + 2e-4 <= times[-1]])
    jerk = (window[:, 2] - 2.0 * window[:, 1] + window[:, 0]) / 1e-8
    return (
        np.linalg.norm(jerk[:, :2], axis=1).max() / limits.jerk,
        np.abs(jerk[:, 2]).max() / limits.yaw_jerk,
    )


@examples(8)
@given(
    length=st.floats(0.01, 20.0), top=st.floats(4.0, 60.0),
    alpha=st.floats(5.0, 100.0), jerk=st.floats(0.2, 50.0),
)  # fmt: skip
def test_straight_line_is_an_s_curve(length, top, alpha, jerk):
    chassis = Chassis.omni(angles=CROSS, ring_radius=0.3, wheel_radius=0.05, max_wheel_speed=top)
    limits = MotionLimits(wheel_acceleration=alpha, jerk=jerk)
    reference = time_within_limits(straight(length), chassis, limits)
    rim = 0.05 * sqrt(2.0)
    best = s_curve(length, rim * top, rim * alpha, jerk)
    assert best * (1 - 1e-9) <= reference.duration <= best * 1.02


@pytest.mark.parametrize("chassis", CHASSIS.values(), ids=CHASSIS)
@pytest.mark.parametrize("seed", [1, 2])
def test_limits_hold_between_nodes(chassis, seed):
    reference = time_within_limits(wandering(seed), chassis, LIMITS)
    assert isinstance(reference, SmoothReference)
    usage = reference.limit_usage
    assert max(usage.values()) <= 1.0 + 1e-9
    assert max(usage.values()) >= 0.99
    assert max(fine_shares(reference, LIMITS, 4)) <= 1.0 + 1e-6


@pytest.mark.long
@pytest.mark.parametrize("seed", range(200))
def test_limits_hold_when_sampled_a_hundred_times_finer(seed):
    rng = np.random.default_rng(seed)
    limits = MotionLimits(
        wheel_acceleration=rng.uniform(5.0, 60.0),
        jerk=10.0 ** rng.uniform(-1.0, 2.0),
        yaw_jerk=10.0 ** rng.uniform(0.0, 2.0),
    )
    path = wandering(seed, points=int(rng.integers(6, 40)))
    chassis = list(CHASSIS.values())[seed % len(CHASSIS)]
    reference = time_within_limits(path, chassis, limits)
    assert max(reference.limit_usage.values()) <= 1.0 + 1e-9
    count = len(reference.coefficients)
    k, r = np.repeat(np.arange(count), 801), np.tile(np.linspace(0.0, 1.0, 801), count)
    for at in np.array_split(np.arange(len(k)), 20):
        assert reference._usage(k[at], r[at]).max() <= 1.0 + 1e-9
    assert max(fine_shares(reference, limits, 2)) <= 1.0 + 1e-5


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2, 5, 6, 7, 8, 9, 10, 11, 14])
def test_duration_is_that_of_an_independent_optimiser(seed):
    reference = time_within_limits(wandering(seed, points=8), FOUR, LIMITS)
    other = shortest_duration_by_ipopt(reference, FOUR, LIMITS)
    assert reference.duration <= 1.03 * other


def test_acceleration_is_continuous_and_zero_at_the_ends():
    reference = time_within_limits(wandering(3), FOUR, LIMITS)
    step = 1e-5
    for t in (0.0, reference.duration - step):
        assert np.diff(reference.window(t, 2, step)[:, 3:], axis=0) / step == pytest.approx(
            0.0, abs=1e-3
        )
    times = np.repeat(reference.times[1:-1], 2) + np.tile([-step, 0.0], len(reference.times) - 2)
    before, after = (
        np.array([np.diff(reference.window(t, 2, step)[:, 3:], axis=0)[0] / step for t in times])
        .reshape(-1, 2, 3)
        .swapaxes(0, 1)
    )
    assert np.abs(after - before).max() <= 2.0 * step * 20.0 + 1e-5


def test_a_limit_that_is_never_reached_changes_little():
    free = time_within_limits(wandering(5), FOUR, MotionLimits(wheel_acceleration=25.0))
    smooth = time_within_limits(wandering(5), FOUR, MotionLimits(wheel_acceleration=25.0, jerk=1e5))
    assert isinstance(free, TimedReference)
    assert smooth.duration == pytest.approx(free.duration, rel=5e-3)


@pytest.mark.parametrize(
    "limits", [{"jerk": 3.0}, {"yaw_jerk": 1.0}, {"jerk": 1e-3}, {"jerk": 1e6}]
)
@pytest.mark.parametrize(
    "path",
    [
        turning(3.0), straight(1e-3), straight(500.0, points=4),
        SplinePath(np.repeat(wandering(8).control_points, [3, *[1] * 4, 3, *[1] * 5, 3], axis=0)),
    ],
    ids=["turn", "millimetre", "long", "corners"],
)  # fmt: skip
def test_extreme_paths_keep_their_limits(path, limits):
    reference = time_within_limits(path, FOUR, MotionLimits(wheel_acceleration=25.0, **limits))
    assert np.isfinite(reference.duration)
    assert max(reference.limit_usage.values()) <= 1.0 + 1e-9


@pytest.mark.parametrize("jerk", [inf, 3.0])
def test_end_velocities_are_kept(jerk):
    limits = MotionLimits(wheel_acceleration=25.0, jerk=jerk)
    twists = WorldTwist(0.5, 0.0, 0.0), WorldTwist(0.3, 0.0, 0.0)
    reference = time_within_limits(
        straight(3.0), FOUR, limits, start_twist=twists[0], goal_twist=twists[1]
    )
    assert reference.at(0.0).twist == pytest.approx(twists[0], abs=2e-3)
    assert reference.at(reference.duration).twist == pytest.approx(twists[1], abs=2e-3)
    rest = time_within_limits(straight(3.0), FOUR, limits)
    assert reference.duration < rest.duration
    assert max(reference.limit_usage.values()) <= 1.0 + 1e-3
    with pytest.raises(InvalidReference, match=r"with the twist .* at the goal"):
        time_within_limits(straight(3.0), FOUR, limits, goal_twist=WorldTwist(0.0, 0.5, 0.0))


def test_zones_limit_the_speed():
    grid = OccupancyGrid(np.zeros((20, 80), bool), 0.05)
    speeds = np.full((20, 80), inf)
    speeds[:, 30:50] = 0.3
    zones = CostMap.of(grid)
    zones = zones.__class__(
        **{**{f: getattr(zones, f) for f in zones.__dataclass_fields__}, "max_speed": speeds}
    )
    path = SplinePath(np.column_stack([np.linspace(0.2, 3.8, 30), np.full(30, 0.5), np.zeros(30)]))
    reference = time_within_limits(path, FOUR, LIMITS, zones=zones)
    window = reference.window(0.0, 4000, reference.duration / 3999)
    inside = (window[:, 0] > 1.55) & (window[:, 0] < 2.45)
    assert window[inside, 3].max() <= 0.3 * (1.0 + 1e-3)
    assert window[inside, 3].max() >= 0.29
    assert window[~inside, 3].max() > 0.6


def test_slower_motion_has_smaller_jerks():
    reference = time_within_limits(wandering(4), FOUR, LIMITS)
    slow = reference.with_duration(2.0 * reference.duration)
    assert slow.limit_usage["jerk"] == pytest.approx(reference.limit_usage["jerk"] / 8.0)
    assert slow.at(2.0).pose == pytest.approx(reference.at(1.0).pose)
    with pytest.raises(InvalidReference, match="too short"):
        reference.with_duration(0.9 * reference.duration)


def test_yaw_jerk_of_a_tangent_heading_is_refused():
    with pytest.raises(InvalidInput, match="yaw jerk cannot be limited"):
        time_within_limits(wandering(1), FOUR, LIMITS, heading="tangent")
    only = MotionLimits(wheel_acceleration=25.0, jerk=3.0)
    assert (
        time_within_limits(wandering(1), FOUR, only, heading="tangent").limit_usage["jerk"]
        <= 1.0 + 1e-9
    )


def test_rows_of_the_jerk():
    assert jerk_rows(MotionLimits(wheel_acceleration=1.0)) == ()
    assert [row.name for row in jerk_rows(LIMITS)] == ["jerk", "yaw jerk"]
    assert all(row.kind != "jerk" for row in limit_rows(FOUR, LIMITS))
    assert PiecewisePath.of(wandering(1)).third_derivatives(np.array([0])).shape == (1, 3)
