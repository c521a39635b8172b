"""Named shapes: exact derivatives, rest at the ends, geometry, limits of a robot."""

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from omnidrive.errors import InvalidInput, InvalidReference
from omnidrive.geometry import Pose
from omnidrive.reference import (
    Circle,
    Eight,
    MotionLimits,
    RaisedCosine,
    RandomSmooth,
    Reference,
    RetimedReference,
    SampledReference,
    ShapeReference,
    Slalom,
    Square,
    limit_rows,
    limit_usage,
    shortest_duration_within,
)
from omnidrive.reference.components import (
    ReferenceContext,
    circle,
    eight,
    raised_cosine,
    random_smooth,
    slalom,
    square,
)
from omnidrive.robot import ROBOTS, named_robot
from tests.examples import examples

START = Pose(1.0, -2.0, 0.7)
SHAPES = {
    "circle": Circle(radius=1.5),
    "circle, clockwise, fixed heading": Circle(laps=2, clockwise=True, heading="fixed"),
    "eight": Eight(length=3.0, width=1.0, laps=2),
    "square": Square(),
    "square, clockwise, full rounding": Square(rounding=1.0, laps=2, clockwise=True),
    "raised cosine": RaisedCosine(amplitude=-2.0),
    "straight line": RaisedCosine(amplitude=0.0),
    "slalom": Slalom(),
    "slalom on the axis": Slalom(gates=3, heading="fixed"),
    "random": RandomSmooth(),
    "uniform circle": Circle(ramp=0.0),
    "no constant speed": Eight(ramp=0.5),
}
COMPONENTS = {
    circle: Circle, eight: Eight, square: Square, raised_cosine: RaisedCosine, slalom: Slalom,
    random_smooth: RandomSmooth,
}  # fmt: skip

shapes = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES.keys())


@shapes
def test_twists_and_accelerations_are_derivatives(shape):
    reference = ShapeReference(shape, 8.0, START)
    times, h = np.linspace(0.01, 7.99, 3001), 1e-5
    motion = reference.motion(times)
    before, after = reference.motion(times - h), reference.motion(times + h)
    twists = (after.poses - before.poses) / (2 * h)
    accelerations = (after.twists - before.twists) / (2 * h)
    np.testing.assert_allclose(motion.twists, twists, atol=1e-6)
    scale = np.abs(motion.accelerations).max()
    far = np.abs(motion.accelerations - accelerations) > 1e-4 * scale
    # the yaw acceleration of a slalom jumps between clothoids
    assert far.sum() <= (20 if isinstance(shape, Slalom) else 0)


@shapes
def test_starts_at_start_pose_and_rests_at_both_ends(shape):
    reference = ShapeReference(shape, 8.0, START)
    first, last = reference.at(0.0), reference.at(8.0)
    np.testing.assert_allclose(first.pose[:2], START[:2], atol=1e-12)
    if shape.ramp > 0.0:
        assert not any(first.twist)
        assert not any(last.twist)
    assert reference.at(-1.0) == (first.pose, (0.0, 0.0, 0.0))
    assert reference.at(9.0) == (last.pose, (0.0, 0.0, 0.0))


@shapes
def test_window_equals_single_setpoints(shape):
    reference = ShapeReference(shape, 8.0, START)
    assert isinstance(reference, Reference)
    rows = reference.window(-0.3, 20, 0.45)
    single = [reference.at(-0.3 + 0.45 * k) for k in range(20)]
    np.testing.assert_allclose(rows, [(*p, *v) for p, v in single], atol=1e-12)


@shapes
def test_heading_is_continuous_and_tangent_or_fixed(shape):
    reference = ShapeReference(shape, 8.0, START)
    motion = reference.motion(np.linspace(0.0, 8.0, 4001))
    assert np.abs(np.diff(motion.poses[:, 2])).max() < 0.05
    if isinstance(shape, RandomSmooth):
        return
    if shape.heading == "fixed":
        assert (motion.poses[:, 2] == START.yaw).all()
        return
    speeds = np.hypot(*motion.twists[:, :2].T)
    ahead = np.column_stack([np.cos(motion.poses[:, 2]), np.sin(motion.poses[:, 2])])
    np.testing.assert_allclose(motion.twists[:, :2], speeds[:, None] * ahead, atol=1e-9)


def test_start_turns_and_moves_the_motion():
    here = ShapeReference(Eight(), 5.0)
    there = ShapeReference(Eight(), 5.0, START)
    x, y, yaw = here.at(1.3).pose
    c, s = cos(START.yaw), sin(START.yaw)
    moved = (START.x + c * x - s * y, START.y + s * x + c * y, START.yaw + yaw)
    np.testing.assert_allclose(there.at(1.3).pose, moved, atol=1e-12)


@examples(20)
@given(
    radius=st.floats(0.1, 50.0),
    laps=st.integers(1, 5),
    clockwise=st.booleans(),
    share=st.floats(0.0, 1.0),
)
def test_circle_keeps_its_radius(radius, laps, clockwise, share):
    reference = ShapeReference(Circle(radius=radius, laps=laps, clockwise=clockwise), 6.0)
    pose, _ = reference.at(6.0 * share)
    side = -1.0 if clockwise else 1.0
    assert hypot(pose.x, pose.y - side * radius) == pytest.approx(radius)
    assert reference.at(6.0).pose.yaw == pytest.approx(side * 2.0 * pi * laps)


def test_eight_satisfies_the_equation_of_gerono():
    """x^4 = a^2 (x^2 - (y a / b)^2) with the half axes a and b."""
    x, y, _ = ShapeReference(Eight(length=4.0, width=1.0), 5.0).window(0.0, 501, 0.01)[:, :3].T
    np.testing.assert_allclose(x**4, 4.0 * (x**2 - (y * 2.0) ** 2), atol=1e-9)
    assert np.ptp(x) == pytest.approx(4.0, abs=1e-3)
    assert np.ptp(y) == pytest.approx(1.0, abs=1e-3)


def test_square_passes_its_corners_at_the_documented_distance():
    shape = Square(side=2.0, rounding=0.4)
    points = ShapeReference(shape, 10.0).window(0.0, 100_001, 1e-4)[:, :2]
    for corner in ((2.0, 0.0), (2.0, 2.0), (0.0, 2.0)):
        nearest = np.hypot(*(points - corner).T).min()
        assert nearest == pytest.approx(0.4 * 5.0 / 32.0 * 2.0**0.5, rel=1e-3)
    np.testing.assert_allclose(points[-1], (0.0, 0.0), atol=1e-12)
    on_edge = points[(points[:, 0] > 0.41) & (points[:, 0] < 1.59) & (points[:, 1] < 1.0)]
    assert (on_edge[:, 1] == 0.0).all()
    rows = ShapeReference(shape, 10.0).motion(np.linspace(3.0, 7.0, 4001)).twists
    speeds = np.hypot(rows[:, 0], rows[:, 1])
    assert speeds.min() / speeds.max() == pytest.approx(0.5**0.5, abs=1e-3)


def test_raised_cosine_offset():
    x, y, _ = ShapeReference(RaisedCosine(), 5.0).window(0.0, 51, 0.1)[:, :3].T
    np.testing.assert_allclose(y, 0.5 * (1.0 - np.cos(2.0 * pi * 2 * x / 6.0)), atol=1e-12)


def test_slalom_is_the_integral_of_its_triangular_curvature():
    shape = Slalom(gates=2, angle=0.9, curvature=2.0, ramp=0.0)
    reference = ShapeReference(shape, 1.0)
    s = np.linspace(0.0, 1.0, 20_001)
    motion = reference.motion(s)
    length = float(np.hypot(*motion.twists[0, :2]))  # constant speed
    np.testing.assert_allclose(np.hypot(*motion.twists[:, :2].T), length, rtol=1e-12)
    curvature = motion.twists[:, 2] / length
    assert np.abs(curvature).max() == pytest.approx(2.0, rel=1e-3)
    assert np.ptp(motion.poses[:, 2]) == pytest.approx(1.8, rel=1e-6)
    slopes = np.abs(np.diff(curvature)) * 20_000 / length
    assert np.median(slopes) == pytest.approx(2.0**2 / (2.0 * 0.9), rel=1e-6)
    heading = shape.directions
    for end in (0.3, 0.62, 1.0):
        x, _ = quad(lambda v: cos(heading(np.array([v]))[0]), 0.0, end, limit=200)
        y, _ = quad(lambda v: sin(heading(np.array([v]))[0]), 0.0, end, limit=200)
        np.testing.assert_allclose(reference.at(end).pose[:2], (length * x, length * y), atol=1e-6)


@pytest.mark.parametrize("gates", [1, 3, 7])
def test_slalom_with_an_odd_number_of_gates_ends_on_its_axis(gates):
    end = ShapeReference(Slalom(gates=gates), 5.0).at(5.0).pose
    assert end.y == pytest.approx(0.0, abs=1e-9)
    assert end.yaw == pytest.approx(0.0, abs=1e-9)


def test_random_motion_depends_on_its_seed_only_and_stays_within_its_extent():
    def poses(seed):
        return ShapeReference(RandomSmooth(seed=seed), 9.0).window(0.0, 901, 0.01)[:, :3]

    assert (poses(3) == poses(3)).all()
    assert np.abs(poses(3) - poses(4)).max() > 0.1
    for seed in range(20):
        spans = np.ptp(poses(seed), axis=0)
        assert (spans <= [4.0, 4.0, 3.0]).all()
        assert spans.min() > 0.5
    np.testing.assert_allclose(poses(3)[-1], poses(3)[0], atol=1e-9)


@pytest.mark.parametrize("factory", COMPONENTS, ids=lambda each: each.__name__)
@pytest.mark.parametrize("name", ROBOTS)
def test_component_uses_the_whole_of_one_limit_of_the_robot(factory, name):
    robot = named_robot(name)
    made = factory(ReferenceContext(robot, START), COMPONENTS[factory]())
    assert made.start == START
    limits = limit_rows(robot.chassis, MotionLimits.of_robot(robot))
    assert max(limit_usage(made, limits).values()) == pytest.approx(1.0, abs=1e-3)
    wheels = wheel_speeds(made, robot)
    assert np.abs(wheels).max() <= robot.max_wheel_speed * (1 + 1e-4)


def wheel_speeds(reference, robot):
    rows = reference.window(0.0, 5001, reference.duration / 5000)
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    vx, vy = c * rows[:, 3] + s * rows[:, 4], c * rows[:, 4] - s * rows[:, 3]
    return np.column_stack([vx, vy, rows[:, 5]]) @ robot.chassis.jacobian.T


@shapes
def test_limit_usage_of_a_shape_is_that_of_its_samples(shape):
    """The exact accelerations agree with those of a dense interpolation."""
    robot = named_robot("small")
    limits = limit_rows(robot.chassis, MotionLimits.of_robot(robot))
    reference = ShapeReference(shape, 8.0, START)
    exact = limit_usage(reference, limits)
    sampled = limit_usage(SampledReference.of(reference, 1e-3), limits)
    tolerance = 0.2 if isinstance(shape, Slalom) else 1e-3  # jumps overshoot
    assert sampled == pytest.approx(exact, rel=tolerance)


def test_shortest_duration_reaches_a_limit_of_any_reference():
    robot = named_robot("paper")
    limits = limit_rows(robot.chassis, MotionLimits.of_robot(robot))
    slow = RetimedReference(ShapeReference(Eight(), 3.0, START), 60.0)
    duration = shortest_duration_within(slow, limits)
    made = ShapeReference(Eight(), duration, START)
    assert max(limit_usage(made, limits).values()) == pytest.approx(1.0, rel=1e-6)


def test_retimed_reference_scales_time():
    reference = ShapeReference(Slalom(), 4.0, START)
    slower = RetimedReference(reference, 10.0)
    equal = ShapeReference(Slalom(), 10.0, START)
    np.testing.assert_allclose(slower.window(-1.0, 60, 0.2), equal.window(-1.0, 60, 0.2), atol=1e-9)
    assert slower.at(10.0).pose == reference.at(4.0).pose


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_impossible_duration_is_rejected(duration):
    with pytest.raises(InvalidReference, match="duration must be positive"):
        ShapeReference(Circle(), duration)
    with pytest.raises(InvalidReference, match="duration must be positive"):
        RetimedReference(ShapeReference(Circle(), 1.0), duration)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Circle(radius=0.0), "radius is 0 m, need 0.01 to 1000 m"),
        (lambda: Circle(radius=np.nan), "radius is nan m"),
        (lambda: Circle(ramp=0.6), "ramp is 0.6, need 0 to 0.5"),
        (lambda: Circle(heading="tangnet"), "no heading 'tangnet'.*did you mean 'tangent'"),
        (lambda: Square(rounding=1.1), "rounding is 1.1 m, need at most half the side, 1 m"),
        (lambda: Slalom(angle=2.0), "angle is 2 rad, need 0.01 to 1.5 rad"),
        (lambda: ShapeReference(Circle(), 1.0, Pose(0.0, np.nan, 0.0)), "start must be finite"),
    ],
)
def test_invalid_parameters_are_rejected(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()
