"""Sampled references: against polynomials, by order of convergence, and invariants."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.planning import SplinePath
from omnidrive.reference import Hold, Reference, SampledReference, UniformReference
from tests.examples import examples


def cubic(t):
    """Return a cubic motion and its derivative."""
    t = np.asarray(t, dtype=float)
    poses = np.stack([1 + t - 0.2 * t**3, 0.5 * t**2 - 2, 0.1 * t**3 - 0.3 * t**2 + 3], axis=-1)
    twists = np.stack([1 - 0.6 * t**2, t, 0.3 * t**2 - 0.6 * t], axis=-1)
    return poses, twists


def wave(t):
    """Return a smooth motion from rest to rest on [0, 2 pi] and its derivative."""
    t = np.asarray(t, dtype=float)
    poses = np.stack([np.cos(t), t - np.sin(t), 2 * np.sin(t / 2) ** 4], axis=-1)
    twists = [-np.sin(t), 1 - np.cos(t), 4 * np.sin(t / 2) ** 3 * np.cos(t / 2)]
    return poses, np.stack(twists, axis=-1)


times_strategy = st.lists(st.floats(0.01, 2.0), min_size=1, max_size=12).map(
    lambda steps: np.concatenate([[0.0], np.cumsum(steps)])
)


@st.composite
def sampled(draw):
    """Draw times, poses, and twists or None."""
    times = draw(times_strategy)
    numbers = st.floats(-3.0, 3.0)
    rows = st.tuples(numbers, numbers, numbers)
    shape = {"min_size": len(times), "max_size": len(times)}
    poses = np.array(draw(st.lists(rows, **shape)))
    return times, poses, draw(st.none() | st.lists(rows, **shape).map(np.array))


def made(samples):
    times, poses, twists = samples
    if twists is None:
        return SampledReference.through(times, poses)
    return SampledReference(times, poses, twists)


@given(times=times_strategy, part=st.floats(0.0, 1.0))
def test_cubic_motion_is_reproduced_exactly(times, part):
    reference = SampledReference(times, *cubic(times))
    t = part * times[-1]
    poses, twists = cubic(t)
    size = 1.0 + times[-1] ** 3
    # the yaw may differ by whole turns where it changes by more than half a turn per step
    turn = np.round((np.array(reference.at(t).pose)[2] - poses[2]) / (2 * np.pi))
    if np.abs(np.diff(cubic(times)[0][:, 2])).max() < np.pi:
        assert turn == 0
        assert reference.at(t).pose == pytest.approx(poses, abs=1e-10 * size)
        assert reference.at(t).twist == pytest.approx(twists, abs=1e-9 * size)


@given(samples=sampled())
def test_reference_passes_through_its_samples(samples):
    reference = made(samples)
    for t, pose, twist in zip(reference.times, reference.poses, reference.twists, strict=True):
        setpoint = reference.at(t)
        assert setpoint.pose == pytest.approx(pose, abs=1e-9)
        assert setpoint.twist == pytest.approx(twist, abs=1e-9)


@given(samples=sampled(), part=st.floats(0.0, 1.0))
def test_velocity_is_the_derivative_of_the_pose(samples, part):
    reference = made(samples)
    h = 1e-6
    t = h + part * (reference.duration - 2 * h)
    ahead, behind = (np.array(reference.at(t + s).pose) for s in (h, -h))
    slope = (ahead - behind) / (2 * h)
    # the second derivative of the cubic jumps at a sample, here by less than 1e6 h in 0.01 s
    assert slope == pytest.approx(np.array(reference.at(t).twist), abs=0.5, rel=1e-3)


@given(samples=sampled())
def test_velocity_is_continuous_at_the_samples(samples):
    reference = made(samples)
    h = 1e-9
    for t in reference.times[1:-1]:
        before, after = (np.array(reference.at(t + s).twist) for s in (-h, h))
        assert before == pytest.approx(after, abs=1e-3)


@pytest.mark.parametrize("given_twists", [True, False])
def test_error_is_of_fourth_order_in_the_step(given_twists):
    t = np.linspace(0.0, 2 * np.pi, 2003)
    errors = []
    for count in (20, 40, 80):
        times = np.linspace(0.0, 2 * np.pi, count + 1)
        poses, twists = wave(times)
        reference = (
            SampledReference(times, poses, twists)
            if given_twists
            else SampledReference.through(times, poses)
        )
        window = reference.window(0.0, len(t), t[1])
        errors.append(np.abs(window[:, :3] - wave(t)[0]).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([4.0, 4.0], abs=0.3)


def test_interpolation_without_velocities_is_smooth_from_rest_to_rest():
    times = np.array([0.0, 0.3, 1.0, 1.1, 2.5])
    poses = np.array([[0, 0, 0], [1, 0, 1], [1, 2, 2], [0, 2, 2], [3, 3, 0.0]])
    reference = SampledReference.through(times, poses)
    assert reference.twists[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    h = 1e-5
    for t in times[1:-1]:
        here = np.array(reference.at(t).twist)
        left = (here - reference.at(t - h).twist) / h
        right = (np.array(reference.at(t + h).twist) - here) / h
        assert left == pytest.approx(right, rel=1e-2, abs=0.05)


def test_two_samples_without_velocities():
    reference = SampledReference.through(np.array([0.0, 2.0]), np.array([[0, 0, 0], [1, -1, 2.0]]))
    assert reference.at(1.0).pose == pytest.approx((0.5, -0.5, 1.0))
    assert reference.at(1.0).twist == pytest.approx((0.75, -0.75, 1.5))  # 3/2 of the mean velocity


@given(samples=sampled(), angle=st.floats(-3, 3), part=st.floats(0, 1))
def test_rotation_of_the_world_rotates_the_curve(samples, angle, part):
    reference = made(samples)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    shift = np.array([0, 0, angle])
    turned = SampledReference.through(reference.times, reference.poses @ turn + shift)
    plain = SampledReference.through(reference.times, reference.poses)
    t = part * reference.duration
    assert np.array(turned.at(t).pose) == pytest.approx(plain.at(t).pose @ turn + shift, abs=1e-9)


@pytest.mark.parametrize("t", [-1.0, -1e-9, 3.0001, 1e9])
def test_reference_is_at_rest_outside_its_duration(t):
    times = np.linspace(0.0, 3.0, 4)
    reference = SampledReference(times, *cubic(times))
    setpoint = reference.at(t)
    assert setpoint.twist == WorldTwist(0.0, 0.0, 0.0)
    assert setpoint.pose == reference.at(0.0 if t < 0 else 3.0).pose


@given(samples=sampled(), t=st.floats(-1, 25), n=st.integers(1, 40))
def test_window_matches_setpoints(samples, t, n):
    reference = made(samples)
    assert isinstance(reference, Reference)
    window = reference.window(t, n, 0.1)
    rows = [(*s.pose, *s.twist) for s in (reference.at(t + 0.1 * k) for k in range(n))]
    assert window == pytest.approx(np.array(rows), abs=1e-9)


def test_yaw_is_unwrapped_before_interpolation():
    poses = np.array([[0, 0, 3.0], [1, 0, -3.0], [2, 0, -2.5], [3, 0, 3.0]])
    reference = SampledReference.through(np.arange(4.0), poses)
    turn = 2 * np.pi
    assert reference.poses[:, 2] == pytest.approx([3.0, turn - 3.0, turn - 2.5, 3.0])
    assert reference.window(0.0, 301, 0.01)[:, 2].min() > 2.9


def test_half_turns_are_unwrapped_once():
    """A second unwrapping would reverse the last half turn because of rounding."""
    yaw = 100.0 + np.array([0.0, np.pi, 2 * np.pi])
    reference = SampledReference.through(np.arange(3.0), np.column_stack([0 * yaw, 0 * yaw, yaw]))
    assert reference.poses[:, 2].tolist() == np.unwrap(yaw).tolist()
    turns = np.diff(reference.window(0.0, 201, 0.01)[:, 2])
    assert (turns < 0.0).all() or (turns > 0.0).all()


def test_times_are_relative_to_the_first():
    poses, twists = cubic(np.arange(3.0))
    reference = SampledReference(np.arange(3.0) + 1.7e9, poses, twists)
    assert reference.times.tolist() == [0.0, 1.0, 2.0]
    assert reference.duration == 2.0
    assert reference.at(1.0).pose == pytest.approx(poses[1])


CONTROL = np.array([[0, 0, 0], [1, 0, 0.5], [2, 1, 1], [2, 2, 2], [3, 3, 2.0]])


@examples(20)
@given(duration=st.floats(0.5, 20), dt=st.floats(0.05, 30))
def test_sampling_another_reference(duration, dt):
    other = UniformReference(SplinePath(CONTROL), duration)
    sampled = SampledReference.of(other, dt)
    assert sampled.duration == duration
    step = np.diff(sampled.times)
    assert step == pytest.approx(step[0])
    assert step[0] == pytest.approx(dt, rel=0.5) or len(step) == 1
    rows = [(*s.pose, *s.twist) for s in map(other.at, sampled.times)]
    assert np.hstack([sampled.poses, sampled.twists]) == pytest.approx(np.array(rows), abs=1e-9)
    assert sampled.twists[-1] == pytest.approx(np.array(other.at(duration).twist))


def test_constant_reference_can_be_sampled():
    sampled = SampledReference.of(Hold(Pose(1, 2, 3), 5.0), 0.1)
    assert sampled.at(2.34) == Hold(Pose(1, 2, 3), 5.0).at(2.34)


@pytest.mark.parametrize(
    ("times", "poses", "message"),
    [
        ([0.0], [[0, 0, 0]], "needs at least two samples, got 1"),
        ([], np.zeros((0, 3)), "needs at least two samples, got 0"),
        ([0, 1, 1], np.zeros((3, 3)), "sample 2 is at 1 s, the previous one at 1 s"),
        (
            [0, 1, 0.5],
            np.zeros((3, 3)),
            "times must increase by at least 1e-06 s: sample 2 is at 0.5",
        ),
        ([0, 1e-7], np.zeros((2, 3)), "times must increase"),
        ([0, np.nan], np.zeros((2, 3)), "times must be finite numbers"),
        ([0, 1], [[0, 0, 0], [0, np.inf, 0]], "poses must be finite numbers of at most 1e"),
        ([0, 1], [[0, 0, 0], [0, 1e300, 0]], "poses must be finite numbers of at most 1e"),
    ],
)
def test_invalid_samples_are_rejected(times, poses, message):
    times, poses = np.array(times, float), np.array(poses, float)
    with pytest.raises(InvalidReference, match=message):
        SampledReference(times, poses, np.zeros(poses.shape))


def test_inconsistent_shapes_are_rejected():
    """In a separate process, because the type checks of the tests would raise first."""
    code = (
        "import numpy as np; from omnidrive.reference import SampledReference\n"
        "SampledReference(np.arange(2.0), np.zeros((3, 3)), np.zeros((3, 3)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "InvalidReference: poses have the shape (3, 3), need (2, 3)" in done.stderr


def test_invalid_twists_are_rejected():
    with pytest.raises(InvalidReference, match="twists must be finite"):
        SampledReference(np.arange(2.0), np.zeros((2, 3)), np.full((2, 3), np.nan))


@pytest.mark.parametrize(
    ("duration", "dt", "message"),
    [
        (5.0, 0.0, "must be positive and finite, got 0 s"),
        (5.0, -1.0, "must be positive"),
        (5.0, np.nan, "must be positive and finite, got nan s"),
        (5.0, np.inf, "must be positive and finite, got inf s"),
        (0.0, 0.1, "a reference with a duration of 0 s cannot be sampled"),
        (np.inf, 0.1, "a reference with a duration of inf s cannot be sampled"),
        (5.0, 1e-300, "more than 100,000; choose a step of 5e-05 s or longer"),
        (1e6, 0.1, "are 1e[+]07 steps, more than 100,000; choose a step of 10 s"),
    ],
)
def test_invalid_sampling_is_rejected(duration, dt, message):
    with pytest.raises(InvalidReference, match=message):
        SampledReference.of(Hold(Pose(0, 0, 0), duration), dt)


def spinning(rate, duration=6.0):
    """Turn on the spot at a constant rate, in rad/s."""
    return SampledReference(
        np.array([0.0, duration]),
        np.array([[0.0, 0.0, 0.0], [0.0, 0.0, rate * duration]]),
        np.array([[0.0, 0.0, rate]] * 2),
        unwrapped=True,
    )


@pytest.mark.parametrize("rate", [4.0, -7.0, 2 * np.pi])
def test_sampling_preserves_turns(rate):
    """Turns of more than half a turn between two samples are preserved as well."""
    fast = spinning(rate)
    samples = SampledReference.of(fast, 1.0)
    assert np.diff(samples.poses[:, 2]) == pytest.approx(np.full(6, rate))
    for t in np.linspace(0.0, 6.0, 25):
        assert samples.at(t).pose == pytest.approx(fast.at(t).pose, abs=1e-9)
        assert samples.at(t).twist == pytest.approx(fast.at(t).twist, abs=1e-9)


def test_yaw_is_unwrapped_unless_declared_unwrapped():
    times, poses, twists = (
        np.array([0.0, 1.0]),
        np.array([[0, 0, 3.0], [0, 0, -3.0]]),
        np.zeros((2, 3)),
    )
    short = SampledReference(times, poses, twists)
    assert short.poses[1, 2] == pytest.approx(2 * np.pi - 3.0)
    assert SampledReference(times, poses, twists, unwrapped=True).poses[1, 2] == -3.0
