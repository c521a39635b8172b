"""Properties of planar rigid-body motion."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from omnidrive.geometry import (
    BodyTwist,
    Pose,
    WorldTwist,
    move,
    to_body,
    to_world,
    twist_between,
    wrap,
)

speed = st.floats(-3, 3)
angle = st.floats(-20, 20)
length = st.floats(-10, 10)


@given(a=angle)
def test_wrap_is_idempotent_and_preserves_the_direction(a):
    assert -pi <= wrap(a) < pi
    assert wrap(wrap(a)) == pytest.approx(wrap(a))
    assert (cos(wrap(a)), sin(wrap(a))) == pytest.approx((cos(a), sin(a)), abs=1e-12)


@given(vx=speed, vy=speed, w=speed, yaw=angle)
def test_frames_round_trip(vx, vy, w, yaw):
    twist = WorldTwist(vx, vy, w)
    assert to_world(to_body(twist, yaw), yaw) == pytest.approx(twist, abs=1e-12)


@given(x=length, y=length, yaw=angle, vx=speed, vy=speed, w=speed, dt=st.floats(1e-3, 2.0))
def test_move_is_the_matrix_exponential(x, y, yaw, vx, vy, w, dt):
    def matrix(pose):
        c, s = cos(pose.yaw), sin(pose.yaw)
        return np.array([[c, -s, pose.x], [s, c, pose.y], [0, 0, 1]])

    generator = np.array([[0, -w, vx], [w, 0, vy], [0, 0, 0]])
    start = Pose(x, y, yaw)
    expected = matrix(start) @ expm(generator * dt)
    assert matrix(move(start, BodyTwist(vx, vy, w), dt)) == pytest.approx(expected, abs=1e-9)


@given(x=length, y=length, yaw=angle, vx=speed, vy=speed, w=speed, dt=st.floats(1e-3, 1.0))
def test_twist_between_inverts_move(x, y, yaw, vx, vy, w, dt):
    start, twist = Pose(x, y, yaw), BodyTwist(vx, vy, w)
    found = twist_between(start, move(start, twist, dt), dt)
    assert found == pytest.approx(twist, abs=1e-8)


@given(turn=st.sampled_from([0.0, 1e-9, 9.9e-5, 1.01e-4, -2e-4, 1e-3]))
def test_small_turns_are_accurate(turn):
    twist = BodyTwist(1.0, -2.0, turn)
    halves = move(move(Pose(0, 0, 0), twist, 0.5), twist, 0.5)
    assert move(Pose(0, 0, 0), twist, 1.0) == pytest.approx(halves, abs=4e-15)
