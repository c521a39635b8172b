"""Fastest motion along a path: analytic cases, invariants, invalid input."""

from math import inf, nan, pi, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import WorldTwist
from omnidrive.maps import CostMap, OccupancyGrid
from omnidrive.planning import SplinePath
from omnidrive.reference import MotionLimits, Reference, time_within_limits
from omnidrive.robot import Chassis, named_robot
from tests.examples import examples
from tests.memory import allocates_at_most
from tests.reference.sample_paths import (
    CHASSIS,
    CROSS,
    FOUR,
    straight,
    turning,
    wandering,
    wheel_speeds,
    worst_shares,
)

ALPHA = 25.0
LIMITS = MotionLimits(wheel_acceleration=ALPHA)
HEADINGS = ["path", "tangent", "fixed"]


def trapezoid(length, speed, acceleration):
    """Return the time from rest to rest over a distance."""
    if length >= speed**2 / acceleration:
        return length / speed + speed / acceleration
    return 2 * sqrt(length / acceleration)


@examples(25)
@given(
    length=st.floats(0.01, 50.0),
    angle=st.floats(-pi, pi),
    top=st.floats(2.0, 60.0),
    alpha=st.floats(1.0, 200.0),
)
def test_straight_line_has_trapezoidal_speed(length, angle, top, alpha):
    chassis = Chassis.omni(angles=CROSS, ring_radius=0.3, wheel_radius=0.05, max_wheel_speed=top)
    reference = time_within_limits(
        straight(length, angle), chassis, MotionLimits(wheel_acceleration=alpha)
    )
    rim = 0.05 / np.abs(np.sin(np.array(CROSS) - angle)).max()  # metres per rad of fastest wheel
    best = trapezoid(length, rim * top, rim * alpha)
    assert best * (1 - 1e-9) <= reference.duration <= best * 1.002


@pytest.mark.parametrize("angle", [0.3, -2.0, 9.0, 40.0])
def test_turn_on_the_spot_has_trapezoidal_speed(angle):
    path = turning(angle)
    reference = time_within_limits(path, FOUR, LIMITS)
    best = trapezoid(abs(angle), 30.0 * 0.05 / 0.3, ALPHA * 0.05 / 0.3)
    assert best * (1 - 1e-9) <= reference.duration <= best * 1.002
    window = reference.window(0.0, 50, reference.duration / 49)
    assert np.ptp(window[:, :2], axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert window[[0, -1], 2] == pytest.approx([0.0, angle])


def test_yaw_rate_limit_alone():
    chassis = Chassis(FOUR.jacobian, inf)
    limits = MotionLimits(wheel_acceleration=1e7, yaw_rate=0.5)
    reference = time_within_limits(turning(2.0), chassis, limits)
    assert reference.duration == pytest.approx(4.0, rel=1e-3)
    assert reference.limit_usage["yaw rate"] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("limit", "name"),
    [
        ({"speed": 0.4}, "speed"),
        ({"forward_speed": 0.3}, "forward speed"),
        ({"sideways_speed": 0.2}, "sideways speed"),
    ],
)
def test_twist_limits_determine_cruise_speed(limit, name):
    """10 m in the direction (0.8, 0.6) of B: start and stop take a small share of the time."""
    parts = {"speed": 1.0, "forward speed": 0.8, "sideways speed": 0.6}
    limits = MotionLimits(wheel_acceleration=1e5, **limit)
    path = straight(10.0, np.arctan2(0.6, 0.8))
    reference = time_within_limits(path, FOUR, limits)
    (value,) = limit.values()
    assert reference.duration == pytest.approx(10.0 * parts[name] / value, rel=2e-3)


@pytest.mark.parametrize(
    ("limits", "acceleration"),
    [
        (MotionLimits(wheel_acceleration=1e6, acceleration=0.5), 0.5),
        (MotionLimits(acceleration_faces=np.diag([1 / 0.5, 1 / 0.7, 1.0])), 0.5),
    ],
)
def test_acceleration_limits(limits, acceleration):
    reference = time_within_limits(straight(0.5), FOUR, limits)
    assert reference.duration == pytest.approx(trapezoid(0.5, 2.1, acceleration), rel=6e-3)


@pytest.mark.parametrize("name", CHASSIS)
@pytest.mark.parametrize("heading", HEADINGS)
def test_wheel_limits_hold(name, heading):
    chassis = CHASSIS[name]
    for seed in range(4):
        reference = time_within_limits(wandering(seed), chassis, LIMITS, heading=heading)
        assert max(worst_shares(reference, chassis, ALPHA)) <= 1.01
        assert max(reference.limit_usage.values()) <= 1 + 1e-9


@examples(40)
@given(
    seed=st.integers(0, 10**6),
    points=st.integers(4, 30),
    step=st.floats(0.02, 3.0),
    turn=st.floats(0.0, 1.4),
    top=st.floats(5.0, 100.0),
    alpha=st.floats(1.0, 300.0),
    heading=st.sampled_from(HEADINGS),
    name=st.sampled_from(sorted(CHASSIS)),
)
def test_wheel_limits_hold_on_any_path(seed, points, step, turn, top, alpha, heading, name):
    chassis = Chassis(CHASSIS[name].jacobian, top)
    path = wandering(seed, points, step, turn)
    limits = MotionLimits(wheel_acceleration=alpha)
    try:
        reference = time_within_limits(path, chassis, limits, heading=heading)
    except InvalidReference:  # a random cusp
        with pytest.raises(InvalidReference, match="no direction"):
            time_within_limits(path, chassis, limits, heading="tangent")
        return
    assert max(worst_shares(reference, chassis, alpha)) <= 1.01


@pytest.mark.parametrize("heading", HEADINGS)
def test_velocity_is_continuous(heading):
    """Wheel accelerations over decreasing steps stay within the limit."""
    reference = time_within_limits(wandering(3), FOUR, LIMITS, heading=heading)
    for t in reference.times[:: len(reference.times) // 500]:
        for h in (1e-3, 1e-5, 1e-7):
            near = wheel_speeds(reference.window(t - h, 2, 2 * h), FOUR)
            assert np.abs(np.diff(near, axis=0)).max() <= 1.01 * ALPHA * 2 * h + 1e-9


@pytest.mark.parametrize("heading", HEADINGS)
def test_one_limit_is_always_active(heading):
    """The fastest motion along a path is at a limit at every time (Bobrow et al. 1985)."""
    reference = time_within_limits(wandering(5), FOUR, LIMITS, heading=heading)
    dt = reference.duration / 20_000
    speeds = wheel_speeds(reference.window(0.0, 20_001, dt), FOUR)
    use = np.maximum(
        np.abs(speeds[1:]).max(axis=1) / FOUR.max_wheel_speed,
        np.abs(np.diff(speeds, axis=0)).max(axis=1) / (dt * ALPHA),
    )
    assert np.mean(use > 0.98) > 0.98


def test_limit_usage_matches_wheel_motion():
    reference = time_within_limits(wandering(8), FOUR, LIMITS)
    slow = reference.with_duration(3.0 * reference.duration)
    speed, acceleration = worst_shares(slow, FOUR, ALPHA)
    assert slow.limit_usage["wheel speed"] == pytest.approx(speed, rel=2e-3)
    assert slow.limit_usage["wheel acceleration"] == pytest.approx(acceleration, rel=2e-2)
    fast = reference.limit_usage
    assert slow.limit_usage["wheel speed"] == pytest.approx(fast["wheel speed"] / 3)
    assert slow.limit_usage["wheel acceleration"] == pytest.approx(fast["wheel acceleration"] / 9)


@pytest.mark.parametrize("heading", HEADINGS)
def test_twist_columns_are_derivatives_of_the_pose_columns(heading):
    """Central differences within intervals of constant acceleration have errors of order h^2."""
    reference = time_within_limits(wandering(2), FOUR, LIMITS, heading=heading)
    middles = 0.5 * (reference.times[1:] + reference.times[:-1])
    longest = np.argsort(np.diff(reference.times))[-20:]
    for t, whole in zip(middles[longest], np.diff(reference.times)[longest], strict=True):
        errors = []
        for h in (whole / 4, whole / 8):
            before, _, after = reference.window(t - h, 3, h)
            slope = (after[:3] - before[:3]) / (2 * h)
            errors.append(np.abs(slope - np.array(reference.at(t).twist)).max())
        assert errors[1] < 0.3 * errors[0] + 1e-9


@given(t=st.floats(-1.0, 9.0), n=st.integers(1, 30), dt=st.floats(0.0, 0.5))
@examples(50)
def test_window_matches_setpoints(t, n, dt):
    reference = _SAMPLE
    assert isinstance(reference, Reference)
    window = reference.window(t, n, dt)
    rows = [(*s.pose, *s.twist) for s in (reference.at(t + dt * k) for k in range(n))]
    assert (window == np.array(rows)).all()


_SAMPLE = time_within_limits(wandering(2), FOUR, LIMITS)


@pytest.mark.parametrize("t", [-1.0, 0.0, _SAMPLE.duration, _SAMPLE.duration + 1.0, 1e9])
def test_reference_is_at_rest_at_its_ends_and_outside(t):
    setpoint = _SAMPLE.at(t)
    assert setpoint.twist == pytest.approx(WorldTwist(0.0, 0.0, 0.0), abs=1e-6)
    end = wandering(2).control_points[0 if t <= 0.0 else -1]
    assert np.array(setpoint.pose) == pytest.approx(end, abs=1e-9)


def test_reference_stays_on_the_path():
    path = wandering(2)
    samples = path.poses(np.linspace(0.0, 1.0, 200_001))
    for row in _SAMPLE.window(0.0, 60, _SAMPLE.duration / 59):
        assert np.abs(samples - row[:3]).max(axis=1).min() < 1e-4


def test_tangent_heading_moves_forward():
    reference = time_within_limits(wandering(4), FOUR, LIMITS, heading="tangent")
    window = reference.window(0.0, 500, reference.duration / 499)
    c, s = np.cos(window[:, 2]), np.sin(window[:, 2])
    assert np.abs(c * window[:, 4] - s * window[:, 3]).max() < 1e-9
    assert (c * window[:, 3] + s * window[:, 4]).min() >= -1e-9
    assert np.abs(np.diff(window[:, 2])).max() < 0.5  # unwrapped


def test_tangent_heading_of_spiral_is_unwrapped():
    angles = np.linspace(0.0, 6 * pi, 60)
    xy = (1.0 + 0.1 * angles) * np.stack([np.cos(angles), np.sin(angles)])
    path = SplinePath(np.column_stack([*xy, np.zeros(60)]))
    reference = time_within_limits(path, FOUR, LIMITS, heading="tangent")
    turned = reference.at(reference.duration).pose.yaw - reference.at(0.0).pose.yaw
    assert turned == pytest.approx(6 * pi, abs=0.3)


def test_fixed_heading():
    for yaw, expected in ((None, wandering(4).control_points[0, 2]), (1.5, 1.5)):
        reference = time_within_limits(wandering(4), FOUR, LIMITS, heading="fixed", yaw=yaw)
        window = reference.window(0.0, 50, 0.1)
        assert window[:, 2] == pytest.approx(np.full(50, expected))
        assert (window[:, 5] == 0.0).all()


def test_default_fixed_heading_is_the_required_end_heading():
    for ends in (
        {"start_yaw": 1.5},
        {"goal_yaw": 1.5},
        {"start_yaw": 1.5, "goal_yaw": 1.5 - 2 * pi},
    ):
        reference = time_within_limits(wandering(4), FOUR, LIMITS, heading="fixed", **ends)
        assert reference.at(0.3).pose.yaw == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("heading", "ends", "message"),
    [
        ("fixed", {"start_yaw": 0.5, "goal_yaw": 0.50001}, "at the goal"),
        ("fixed", {"yaw": 0.1, "start_yaw": 0.5}, "at the start is 0.100 rad, not 0.500 rad"),
        ("tangent", {"start_yaw": 2.0}, "at the start"),
        ("tangent", {"goal_yaw": 2.0}, "at the goal"),
        ("path", {"goal_yaw": 9.0}, "not 9.000 rad as required"),
    ],
)
def test_contradictory_end_headings_are_rejected(heading, ends, message):
    with pytest.raises(InvalidReference, match=message):
        time_within_limits(wandering(4), FOUR, LIMITS, heading=heading, **ends)


@pytest.mark.parametrize("heading", HEADINGS)
def test_consistent_end_headings_change_nothing(heading):
    free = time_within_limits(wandering(4), FOUR, LIMITS, heading=heading)
    start, goal = (free.at(t).pose.yaw for t in (0.0, free.duration))
    ends = {"start_yaw": start, "goal_yaw": goal + 2 * pi}
    again = time_within_limits(wandering(4), FOUR, LIMITS, heading=heading, **ends)
    assert again.duration == free.duration


@pytest.mark.parametrize("heading", HEADINGS)
def test_end_headings_must_be_finite(heading):
    with pytest.raises(InvalidInput, match="heading at the goal must be a finite angle"):
        time_within_limits(wandering(4), FOUR, LIMITS, heading=heading, goal_yaw=nan)


def test_duration_of_reversed_path_is_equal():
    path = wandering(6)
    there = time_within_limits(path, FOUR, LIMITS).duration
    back = time_within_limits(SplinePath(path.control_points[::-1]), FOUR, LIMITS).duration
    assert there == pytest.approx(back, rel=2e-3)


@pytest.mark.parametrize("name", ["paper", "small"])
def test_limits_of_robot(name):
    robot = named_robot(name)
    reference = time_within_limits(wandering(1), robot.chassis, MotionLimits.of_robot(robot))
    window = reference.window(0.0, 20_001, reference.duration / 20_000)
    mean = np.diff(window[:, 3:], axis=0) / (reference.duration / 20_000)
    yaw = 0.5 * (window[1:, 2] + window[:-1, 2])
    c, s = np.cos(yaw), np.sin(yaw)
    body = np.stack(
        [c * mean[:, 0] + s * mean[:, 1], c * mean[:, 1] - s * mean[:, 0], mean[:, 2]], axis=1
    )
    assert np.abs(body @ robot.acceleration_faces.T).max() <= 0.77 * 1.01
    assert max(worst_shares(reference, robot.chassis, inf)) <= 1.01


def test_duration_slows_the_whole_motion():
    fast = time_within_limits(wandering(7), FOUR, LIMITS)
    slow = time_within_limits(wandering(7), FOUR, LIMITS, duration=2.5 * fast.duration)
    assert slow.duration == pytest.approx(2.5 * fast.duration)
    rows, slower = fast.window(0.0, 40, 0.05), slow.window(0.0, 40, 0.125)
    assert slower[:, :3] == pytest.approx(rows[:, :3], abs=1e-9)
    assert slower[:, 3:] == pytest.approx(rows[:, 3:] / 2.5, abs=1e-9)


@pytest.mark.parametrize("duration", [0.1, 0.0, -1.0, nan, inf])
def test_message_of_too_short_duration_gives_the_shortest(duration):
    fastest = time_within_limits(wandering(7), FOUR, LIMITS).duration
    with pytest.raises(InvalidReference, match=f"takes {fastest:.3f} s"):
        time_within_limits(wandering(7), FOUR, LIMITS, duration=duration)


@pytest.mark.parametrize("value", [0.0, -1.0, nan])
@pytest.mark.parametrize("name", ["wheel_acceleration", "speed", "yaw_rate", "acceleration"])
def test_limits_must_be_positive(name, value):
    with pytest.raises(InvalidInput, match=f"{name.replace('_', ' ')} must be positive"):
        MotionLimits(**{"wheel_acceleration": 1.0, name: value})


def test_acceleration_must_be_limited():
    with pytest.raises(
        InvalidInput, match="the acceleration is not limited; set wheel_acceleration"
    ):
        MotionLimits(wheel_speed=3.0, acceleration=1.0)


@pytest.mark.parametrize("rows", [np.full((3, 3), nan), np.eye(3)[:2]])
def test_acceleration_faces_must_have_full_rank(rows):
    with pytest.raises(InvalidInput, match="acceleration_faces"):
        MotionLimits(acceleration_faces=rows)


@pytest.mark.parametrize("heading", HEADINGS)
def test_path_without_motion_is_rejected(heading):
    with pytest.raises(InvalidReference, match=r"stands still at \(1, 2\) m"):
        time_within_limits(
            SplinePath(np.tile([1.0, 2.0, 0.3], (5, 1))), FOUR, LIMITS, heading=heading
        )


@pytest.mark.parametrize("heading", ["tangent", "fixed", "free"])
def test_turn_on_the_spot_needs_heading_path(heading):
    with pytest.raises(InvalidReference, match=r"only turns on the spot at \(2, -1\) m"):
        time_within_limits(turning(1.0), FOUR, LIMITS, heading=heading)


@pytest.mark.parametrize("heading", HEADINGS)
def test_path_with_too_many_pieces_is_rejected(heading):
    with pytest.raises(InvalidReference, match=r"250,007 pieces, .* choose timing 'uniform'"):
        time_within_limits(straight(1e4, points=250_010), FOUR, LIMITS, heading=heading)


def test_path_that_turns_too_often_is_rejected():
    with pytest.raises(InvalidReference, match=r"turns too often .* \(2.000, -1.000\) m"):
        time_within_limits(turning(1e7), FOUR, LIMITS)


@pytest.mark.long
def test_grid_path_of_200_000_cells_is_timed_in_bounded_memory():
    """A path as in a maze: straight for 2 to 6 cells, then a right angle."""
    rng = np.random.default_rng(0)
    turns = np.cumsum(rng.choice([-1, 1], 60_000)) * 0.5 * pi
    yaw = np.repeat(turns, rng.integers(2, 7, len(turns)))[:200_000]
    xy = 0.05 * np.cumsum(np.stack([np.cos(yaw), np.sin(yaw)], axis=1), axis=0)
    path = SplinePath(np.column_stack([xy, yaw]))
    with allocates_at_most(1e9):
        reference = time_within_limits(path, FOUR, LIMITS)
    assert max(reference.limit_usage.values()) <= 1.0 + 1e-9
    few = time_within_limits(SplinePath(path.control_points[:2_000]), FOUR, LIMITS)
    assert reference.duration < 1.3 * 100 * few.duration  # tolerance for coarser pieces


def test_cusp_with_tangent_heading_is_rejected():
    points = np.zeros((9, 3))
    points[:, 0] = [0, 1, 2, 3, 4, 3, 2, 1, 0]
    with pytest.raises(InvalidReference, match=r"no direction.* at \(3"):
        time_within_limits(SplinePath(points), FOUR, LIMITS, heading="tangent")
    assert time_within_limits(SplinePath(points), FOUR, LIMITS, heading="fixed").duration > 0.0


def test_robot_stops_at_corners_of_repeated_control_points():
    """Three equal control points make a corner of the spline, where the robot must stop."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    path = SplinePath(np.repeat(corners, 3, axis=0))
    limits = MotionLimits(wheel_acceleration=ALPHA)
    reference = time_within_limits(path, FOUR, limits)
    rim = 0.05 * sqrt(2.0)
    best = 2 * trapezoid(1.0, rim * 30.0, rim * ALPHA)
    assert best * (1 - 1e-6) <= reference.duration <= 1.02 * best
    assert max(worst_shares(reference, FOUR, ALPHA)) <= 1.01


def test_fixed_heading_must_be_finite():
    with pytest.raises(InvalidInput, match="finite angle"):
        time_within_limits(straight(1.0), FOUR, LIMITS, heading="fixed", yaw=nan)


def test_zones_limit_the_speed():
    """The mask is 10 m x 4 m, and slow from x = 4 m to 6 m; a limit holds inside, not outside."""
    grid = OccupancyGrid(np.zeros((40, 100), bool), 0.1, (0.0, -2.0))
    speeds = np.full((40, 100), np.inf, np.float32)
    speeds[:, 40:60] = 0.4
    zones = CostMap(grid, np.zeros((40, 100), np.float32), speeds)
    path = straight(10.0)
    free = time_within_limits(path, FOUR, LIMITS)
    slow = time_within_limits(path, FOUR, LIMITS, zones=zones)
    rows = slow.window(0.0, 4001, slow.duration / 4000)
    speed, inside = np.hypot(rows[:, 3], rows[:, 4]), (rows[:, 0] > 4.0) & (rows[:, 0] < 6.0)
    assert speed[inside].max() == pytest.approx(0.4, rel=2e-3)
    assert speed[~inside].max() > 1.0
    top, ramp = speed.max(), ALPHA / (10.0 * sqrt(2.0))  # m/s, m/s^2
    lost = 2.0 * (1 / 0.4 - 1 / top) + (top - 0.4) ** 2 / (ramp * top)
    assert slow.duration == pytest.approx(free.duration + lost, rel=2e-3)
    assert slow.limit_usage["wheel acceleration"] <= 1.0 + 1e-6
    none = time_within_limits(path, FOUR, LIMITS, zones=CostMap.of(grid))
    assert none.duration == free.duration
