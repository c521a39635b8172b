"""Planar motions of objects compared with SciPy's rotations."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from omnidrive.geometry import Pose, compose, wrap
from omnidrive.simulation.coppeliasim.object_pose import (
    planar_pose,
    relative_pose,
    transport,
    uprightness,
)

METRES = st.floats(-20.0, 20.0)
POSES = st.builds(Pose, METRES, METRES, st.floats(-10.0, 10.0))
TILTED = st.tuples(METRES, METRES, METRES, *[st.floats(-pi, pi)] * 3).map(
    lambda v: [*v[:3], *Rotation.from_euler("xyz", v[3:]).as_quat().tolist()]
)


@given(TILTED, POSES, POSES)
def test_transport_keeps_height_tilt_and_relative_position(pose, start, goal):
    new = transport(pose, start, goal)
    turn = goal.yaw - start.yaw
    c, s = cos(turn), sin(turn)
    offset = np.subtract(pose[:2], start[:2])
    assert new[:2] == pytest.approx([[c, -s], [s, c]] @ offset + goal[:2], abs=1e-12)
    assert new[2] == pose[2]
    expected = Rotation.from_rotvec([0.0, 0.0, turn]) * Rotation.from_quat(pose[3:])
    assert (expected.inv() * Rotation.from_quat(new[3:])).magnitude() == pytest.approx(
        0.0, abs=1e-7
    )
    assert uprightness(new) == pytest.approx(uprightness(pose), abs=1e-12)


@given(POSES, POSES)
def test_compose_inverts_relative_pose(frame, pose):
    assert np.array(compose(frame, relative_pose(frame, pose))) == pytest.approx(pose, abs=1e-12)


@given(TILTED)
def test_planar_pose_and_uprightness(pose):
    x_axis, _, z_axis = Rotation.from_quat(pose[3:]).as_matrix().T
    assert uprightness(pose) == pytest.approx(z_axis[2], abs=1e-12)
    if np.hypot(*x_axis[:2]) > 1e-3:
        bearing = np.arctan2(x_axis[1], x_axis[0])
        assert wrap(planar_pose(pose).yaw - bearing) == pytest.approx(0.0, abs=1e-9)
