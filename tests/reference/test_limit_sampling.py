"""Written motions keep the limits of the motion when they are read again."""

from dataclasses import replace
from inspect import unwrap

import numpy as np
import pytest

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.reference import (
    Circle,
    MotionLimits,
    SampledReference,
    ShapeReference,
    limit_rows,
    limit_usage,
    load_waypoints,
    sample_within_limits,
    save_waypoints,
    time_within_limits,
)
from omnidrive.robot import named_robot
from tests.reference.sample_paths import FOUR, worst_shares

ROBOT = named_robot("small")
LIMITS = MotionLimits.of_robot(ROBOT)
ROWS = limit_rows(ROBOT.chassis, LIMITS)


def wandering(seed):
    steps = np.random.default_rng(seed).normal(0.0, 0.5, (12, 3))
    return SplinePath(np.cumsum(steps, axis=0))


def staircase(seed):
    """Return the control points of a grid path with cells of 0.05 m."""
    moves = np.array([(0.05, 0.0), (0.0, 0.05), (0.05, 0.05)])
    steps = moves[np.repeat(np.random.default_rng(seed).integers(0, 3, 20), 6)]
    points = np.cumsum(steps, axis=0)
    return SplinePath(np.column_stack([points, np.zeros(len(points))]))


@pytest.mark.parametrize("path", [wandering(1), wandering(2), staircase(0), staircase(1)])
@pytest.mark.parametrize("dt", [0.1, 0.02])
@pytest.mark.parametrize("ending", [".csv", ".traj"])
def test_motion_read_again_keeps_its_limits(tmp_path, path, dt, ending):
    reference = time_within_limits(path, ROBOT.chassis, LIMITS)
    even = SampledReference.of(reference, dt)
    assert max(limit_usage(even, ROWS).values()) > 1.2  # the case that the added samples mend
    save_waypoints(tmp_path / f"a{ending}", reference, dt=dt)
    found = load_waypoints(tmp_path / f"a{ending}")
    moved = 5e-4 if ending == ".traj" else 1e-9  # samples that are closer are joined
    assert np.diff(found.times).max() <= even.times[1] + moved
    assert len(found.times) < len(even.times) + 200
    if ending == ".csv":
        assert max(limit_usage(found, ROWS).values()) <= 1.01
        return
    # a Choreo file has no samples less than 0.5 ms apart, so that two switches may fall together
    usage = found.interval_usage(ROWS)["wheel force"]
    over = usage > 1.01
    assert np.diff(found.times)[over].sum() < 0.02
    assert np.median(usage) <= 1.0


@pytest.mark.parametrize("path", [wandering(1), staircase(0)])
def test_wheel_limits_hold_by_differences_of_the_samples(path):
    """Independent of the formulas for the use of limits."""
    limits = MotionLimits(wheel_acceleration=40.0)
    reference = time_within_limits(path, FOUR, limits)
    assert worst_shares(SampledReference.of(reference, 0.1), FOUR, 40.0)[1] > 1.2
    speed, acceleration = worst_shares(sample_within_limits(reference, 0.1), FOUR, 40.0)
    assert speed <= 1.011
    assert acceleration <= 1.011


def test_samples_are_those_of_the_motion_and_include_the_even_ones():
    reference = time_within_limits(wandering(3), ROBOT.chassis, LIMITS)
    samples = sample_within_limits(reference, 0.1)
    for t, pose, twist in zip(samples.times, samples.poses, samples.twists, strict=True):
        expected = reference.at(t)
        np.testing.assert_allclose(pose, expected.pose, atol=1e-9)
        np.testing.assert_allclose(twist, expected.twist, atol=1e-9)
    even = SampledReference.of(reference, 0.1).times
    assert np.isin(even, samples.times).mean() > 0.9
    assert samples.duration == pytest.approx(reference.duration)


@pytest.mark.parametrize("jerk", [np.inf, 20.0])
@pytest.mark.parametrize("path", [wandering(1), wandering(3), staircase(1)])
@pytest.mark.parametrize("dt", [0.1, 0.02])
def test_written_motion_keeps_the_limits_of_zones(tmp_path, path, dt, jerk):
    """Stripes of 0.3 m, in which the robot is slow."""
    low = path.control_points[:, :2].min(axis=0) - 0.2
    cols = np.arange(160) // 6
    speeds = np.tile(np.where(cols % 2 == 0, 0.25, np.inf).astype(np.float32), (160, 1))
    grid = OccupancyGrid(np.zeros((160, 160), bool), 0.05, tuple(low.tolist()))
    zones = CostMap(grid, np.zeros((160, 160), np.float32), speeds)
    limits = replace(LIMITS, jerk=jerk)
    reference = time_within_limits(path, ROBOT.chassis, limits, zones=zones)

    def excess(motion):
        rows = motion.window(0.0, 40_001, motion.duration / 40_000)
        return (np.hypot(rows[:, 3], rows[:, 4]) / zones.max_speeds(rows[:, :2])).max()

    save_waypoints(tmp_path / "a.csv", reference, dt=dt, zones=zones)
    assert excess(load_waypoints(tmp_path / "a.csv")) <= 1.01 * max(1.0, excess(reference))
    if dt == 0.1 and jerk == np.inf:
        assert excess(SampledReference.of(reference, dt)) > 1.02  # what the added samples mend


def test_slow_motion_needs_no_more_samples():
    reference = time_within_limits(wandering(3), ROBOT.chassis, LIMITS)
    slow = reference.with_duration(3.0 * reference.duration)
    assert len(sample_within_limits(slow, 0.1).times) == len(SampledReference.of(slow, 0.1).times)


def test_smooth_motion_is_refined_by_halving():
    fastest = ShapeReference(Circle(radius=0.2), 1.0)
    usage = limit_usage(fastest, ROWS)
    duration = max(usage["wheel speed"], usage["wheel force"] ** 0.5)
    reference = ShapeReference(Circle(radius=0.2), duration)
    coarse = duration / 8.0
    assert max(limit_usage(SampledReference.of(reference, coarse), ROWS).values()) > 1.05
    samples = sample_within_limits(reference, coarse, ROWS)
    assert max(limit_usage(samples, ROWS).values()) <= 1.01


def test_motion_beyond_its_limits_is_kept_within_one_percent():
    reference = ShapeReference(Circle(radius=0.2), 0.8)
    usage = limit_usage(reference, ROWS)
    assert max(usage.values()) > 1.0
    samples = sample_within_limits(reference, 0.1, ROWS, usage)
    for name, share in limit_usage(samples, ROWS).items():
        assert share <= 1.01 * max(usage[name], 1.0)


@pytest.mark.long
def test_motion_that_needs_too_many_samples_is_rejected():
    reference = time_within_limits(wandering(1), ROBOT.chassis, LIMITS)
    tiny = limit_rows(ROBOT.chassis, MotionLimits(wheel_acceleration=1e-9))
    with pytest.raises(InvalidReference, match=r"more than 100,000 samples .* longer duration"):
        sample_within_limits(reference, 0.01, tiny, min_step=1e-6)


def test_first_line_of_a_timed_table_states_the_interpolation(tmp_path):
    reference = ShapeReference(Circle(), 5.0)
    save_waypoints(tmp_path / "a.csv", reference)
    first, header, *_ = (tmp_path / "a.csv").read_text().splitlines()
    assert first.startswith("# Between rows")
    assert header.startswith("t_s,x_m,y_m,yaw_rad,vx_m_per_s")


@pytest.mark.parametrize("heading", ["tangnet", None, ""])
def test_unknown_kind_of_heading_is_rejected(heading):
    untyped = unwrap(time_within_limits)  # the tests check annotations at run time
    with pytest.raises(InvalidInput, match=r"a heading is one of|there is no heading"):
        untyped(wandering(1), ROBOT.chassis, LIMITS, heading=heading)
