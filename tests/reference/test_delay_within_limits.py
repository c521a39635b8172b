"""Least delay within limits: analytic cases, laws, the exact retiming, jumps."""

from dataclasses import dataclass
from math import nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist, wrap
from omnidrive.reference import (
    Eight,
    Hold,
    MotionLimits,
    RandomSmooth,
    Setpoint,
    ShapeReference,
    Square,
    delay_within_limits,
    limit_rows,
    limit_usage,
)
from omnidrive.reference.limit_sampling import sample_within_limits
from omnidrive.reference.timing.piecewise_path import PiecewisePath, rotate_into_body
from omnidrive.reference.timing.time_parameterization import time_optimal_reference
from omnidrive.robot import named_robot
from tests.examples import examples

ROBOT = named_robot("kiwi")
LIMITS = limit_rows(ROBOT.chassis, MotionLimits.of_robot(ROBOT))


def translation_limits(speed, acceleration):
    faces = np.diag([1.0 / acceleration, 1.0 / acceleration, 1e-3])
    limits = MotionLimits(forward_speed=speed, acceleration_faces=faces)
    rows = limit_rows(ROBOT.chassis, limits)
    return tuple(each for each in rows if each.name != "wheel speed")


@dataclass
class Motion:
    """Reference of a user: a function of time, without velocities, with a wrapped heading."""

    x: object
    duration: float
    yaw: object = staticmethod(lambda t: 0.0 * t)

    def window(self, t, n, dt):
        at = np.clip(t + dt * np.arange(n), 0.0, self.duration)
        rows = np.zeros((n, 6))
        rows[:, 0], rows[:, 2] = self.x(at), wrap(self.yaw(at))
        return rows

    def at(self, t):
        return Setpoint(Pose(*self.window(t, 1, 0.0)[0, :3].tolist()), WorldTwist(0.0, 0.0, 0.0))


def exact_retiming(shape, limits, pieces=200):
    """Return the fastest motion along a shape, from rest to rest."""
    path = shape.evaluate(np.linspace(0.0, 1.0, pieces + 1))
    p, d = path.poses, path.first_derivatives / pieces
    rise = np.diff(p, axis=0)
    parts = [p[:-1], d[:-1], 3.0 * rise - 2.0 * d[:-1] - d[1:], d[:-1] + d[1:] - 2.0 * rise]
    return time_optimal_reference(PiecewisePath(np.stack(parts, axis=1), tangent=False), limits)


def test_reference_within_limits_is_unchanged():
    reference = ShapeReference(Eight(), 20.0)
    delayed = delay_within_limits(reference, LIMITS)
    assert delayed.duration == 20.0
    assert not delayed.delays.any()
    for t in (-1.0, 0.0, 3.21, 19.9, 25.0):
        assert np.array_equal(delayed.window(t, 16, 0.05), reference.window(t, 16, 0.05))
    assert delayed.at(7.3) == reference.at(7.3)


def test_motion_above_the_speed_limit_is_a_trapezoid_of_speed():
    reference = Motion(lambda t: 10.0 * (t / 5.0) ** 2 * (3.0 - 0.4 * t), 5.0)  # up to 3 m/s
    delayed = delay_within_limits(reference, translation_limits(0.5, 1.0))
    exact = 10.0 / 0.5 + 0.5 / 1.0
    assert delayed.duration == pytest.approx(exact, rel=0.005)
    assert delayed.window(10.0, 1, 0.0)[0, 3] == pytest.approx(0.5, rel=1e-3)


def test_delay_of_a_start_at_full_speed_is_made_up_for():
    """The start is a corner, rounded within 0.1 s: some of the speed is reached at once."""
    speed, acceleration = 1.0, 0.25
    delayed = delay_within_limits(Motion(lambda t: t, 30.0), translation_limits(3.0, acceleration))
    lost = speed / (2.0 * acceleration)
    assert delayed.max_delay == pytest.approx(lost, rel=0.05)
    middle = (delayed.setpoints[:, 0] > 12.0) & (delayed.setpoints[:, 0] < 22.0)
    assert not delayed.delays[middle].any()  # windows there are those of the reference
    assert delayed.setpoints[:, 3].max() > 1.3  # faster than the reference while it is late
    assert delayed.delays[-1] == pytest.approx(lost, rel=0.05)
    free = delay_within_limits(
        Motion(lambda t: t, 30.0), translation_limits(3.0, acceleration), rest=False
    )
    assert not free.delays.any()


def test_standstill_makes_up_for_delay():
    def x(t):
        return np.minimum(t, 2.0) + np.maximum(t - 4.0, 0.0)

    delayed = delay_within_limits(Motion(x, 6.0), translation_limits(0.8, 2.0))
    leaving = np.flatnonzero(delayed.setpoints[:, 0] > 2.001)[0]
    assert delayed.max_delay > 0.4
    assert delayed.delays[leaving] < 0.1
    assert delayed.step * leaving == pytest.approx(4.0, abs=0.1)


shapes = st.one_of(
    st.builds(RandomSmooth, seed=st.integers(0, 99)),
    st.builds(Eight, length=st.floats(1.0, 6.0), heading=st.sampled_from(["tangent", "fixed"])),
    st.builds(Square, side=st.floats(1.0, 4.0), ramp=st.sampled_from([0.0, 0.25])),
)


@examples(8)
@given(shape=shapes, share=st.floats(0.4, 1.2), rest=st.booleans())
def test_motion_is_on_the_path_behind_the_reference_and_within_limits(shape, share, rest):
    need = max(limit_usage(ShapeReference(shape, 10.0), LIMITS).values()) ** 0.5
    reference = ShapeReference(shape, 10.0 * need * share)
    delayed = delay_within_limits(reference, LIMITS, rest=rest)
    assert (delayed.delays >= 0.0).all()
    times = delayed.step * np.arange(len(delayed.delays))
    behind = times - delayed.delays
    assert (np.diff(behind) > -1e-9).all()
    path = np.array([reference.at(t).pose for t in behind[::20].tolist()])
    assert np.abs(delayed.setpoints[::20, :3] - path).max() < 2e-4
    inner = slice(30, -30)  # next to an end without rest, the velocity may jump
    twists = rotate_into_body(delayed.setpoints[inner, 3:], delayed.setpoints[inner, 2])
    assert np.abs(twists @ ROBOT.chassis.jacobian.T).max() < 1.03 * ROBOT.max_wheel_speed
    change = delayed.setpoints[20:, 3:] - delayed.setpoints[:-20, 3:]
    mean = rotate_into_body(change[30:-30] / (20 * delayed.step), delayed.setpoints[40:-40, 2])
    assert np.abs(mean @ LIMITS[1].rows.T).max() < 1.25


@pytest.mark.parametrize("shape", [Eight(), RandomSmooth(seed=4), Square(side=3.0)])
def test_much_too_fast_reference_becomes_the_fastest_motion(shape):
    exact = exact_retiming(shape, LIMITS)
    delayed = delay_within_limits(ShapeReference(shape, 0.4 * exact.duration), LIMITS)
    assert delayed.duration == pytest.approx(exact.duration, rel=0.03)


def test_no_motion_along_the_path_is_later_less():
    """The delay of a part that is too fast is less than that of slowing down everything."""
    reference = ShapeReference(Eight(), 8.0)
    delayed = delay_within_limits(reference, LIMITS)
    usage = limit_usage(reference, LIMITS)
    uniform = 8.0 * max(usage["wheel speed"], usage["wheel force"] ** 0.5)
    assert 8.0 < delayed.duration < 0.72 * uniform
    first = delayed.step * int(np.argmax(delayed.delays > 0.0))
    assert 0.5 < first < 2.0  # until then the reference itself, bit for bit
    assert np.array_equal(delayed.window(0.0, 5, 0.1), reference.window(0.0, 5, 0.1))


def test_fastest_motion_within_limits_needs_no_delay():
    exact = sample_within_limits(exact_retiming(Eight(), LIMITS), 0.02)
    assert delay_within_limits(exact, LIMITS).max_delay < 0.02


def test_wrapped_heading_is_no_jump():
    turning = Motion(lambda t: 0.0 * t, 8.0, lambda t: 2.0 * t)
    delayed = delay_within_limits(turning, LIMITS)
    assert delayed.max_delay < 0.2
    assert delayed.setpoints[-1, 2] == pytest.approx(16.0)


def test_delay_between_and_beyond_samples():
    delayed = delay_within_limits(ShapeReference(Eight(), 6.0), LIMITS)
    assert delayed.delay(-1.0) == 0.0
    assert delayed.delay(1e9) == delayed.delays[-1]
    assert delayed.duration == 6.0 + delayed.delays[-1] > 8.0
    i = int(np.argmax(delayed.delays))
    assert delayed.delay((i + 0.5) * delayed.step) == pytest.approx(
        delayed.delays[i : i + 2].mean(), rel=1e-9
    )
    end = delayed.window(delayed.duration + 1.0, 2, 0.1)
    assert end[:, :3] == pytest.approx(np.tile(delayed.reference.at(6.0).pose, (2, 1)))
    assert not end[:, 3:].any()


def test_window_has_the_velocity_of_its_poses():
    delayed = delay_within_limits(ShapeReference(Eight(), 7.0), LIMITS)
    rows = delayed.window(2.0, 2001, 1e-3)
    assert rows[1:-1, 3:] == pytest.approx(np.gradient(rows[:, :3], 1e-3, axis=0)[1:-1], abs=0.02)


@pytest.mark.parametrize(
    ("reference", "reason"),
    [
        (Motion(lambda t: np.where(t < 1.0, 0.0, 1.0), 3.0), "jumps at 1.00 s"),
        (Motion(lambda t: 0.0 * t, 3.0, lambda t: np.where(t < 2.0, 0.0, pi / 2)), "at 2.00 s"),
        (Motion(lambda t: nan * t, 3.0), "finite"),
        (Motion(lambda t: t, 0.0), "must be positive"),
        (Motion(lambda t: t, nan), "must be positive"),
        (Motion(lambda t: t, 6000.0), "too long"),
    ],
)
def test_reference_without_a_path_is_refused(reference, reason):
    with pytest.raises(InvalidReference, match=reason):
        delay_within_limits(reference, LIMITS)


def test_hold_needs_no_delay():
    hold = Hold(Pose(1.0, 2.0, 3.0), 5.0)
    assert delay_within_limits(hold, LIMITS).max_delay == 0.0
