"""Kernels of the pose estimator: the group SE(2) and the prediction of slip."""

from math import nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from omnidrive.estimation import PoseEstimator
from omnidrive.estimation.pose_filter.motion_model import Odometry
from omnidrive.estimation.pose_filter.se2 import (
    exponential,
    inverse_adjoint,
    logarithm,
    relative_pose,
    right_jacobian,
)
from omnidrive.estimation.pose_filter.slip_prediction import predict_slip
from omnidrive.robot import named_robot
from tests.examples import examples

DT = 0.1

MOTIONS = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-3, 3)).map(np.array)


def matrix(motion):
    """Return the exponential of a motion as a homogeneous matrix."""
    x, y, turn = motion
    return expm(np.array([[0.0, -turn, x], [turn, 0.0, y], [0.0, 0.0, 0.0]]))


@examples(60)
@given(MOTIONS, MOTIONS)
def test_kernels_match_the_matrix_group(a, b):
    group = matrix(a)
    pose = exponential(a)
    assert [*group[:2, 2], group[1, 0]] == pytest.approx([*pose[:2], np.sin(pose[2])], abs=1e-9)
    assert logarithm(pose) == pytest.approx(a, abs=1e-9)
    small = 1e-6 * b
    inverse = relative_pose(exponential(a), np.zeros(3))
    back = np.linalg.inv(group)
    assert [*back[:2, 2]] == pytest.approx(inverse[:2].tolist(), abs=1e-9)
    end = np.linalg.inv(group) @ matrix(small) @ group  # adjoint of the inverse
    expected = np.array([end[0, 2], end[1, 2], end[1, 0]])
    assert inverse_adjoint(a) @ small == pytest.approx(expected, abs=1e-10)


@examples(40)
@given(MOTIONS.map(lambda m: 0.2 * m), MOTIONS)
def test_right_jacobian_is_the_derivative_of_the_exponential(a, b):
    step = 1e-6 * b
    change = np.linalg.inv(matrix(a)) @ matrix(a + step)
    expected = np.array([change[0, 2], change[1, 2], change[1, 0]])
    size = np.abs(a).max()
    assert right_jacobian(a) @ step == pytest.approx(expected, abs=1e-11 + 1e-6 * size**3)


def test_predicted_slip_solves_the_differential_equation():
    """Comparison with an adaptive integrator, for a start from rest at constant wheel speeds."""
    estimator = PoseEstimator(named_robot("paper"))
    model = estimator._model
    speeds = np.array([0.7, 0.2, 0.6, 1.1])
    odometry = Odometry(speeds * DT, nan, DT, 1.0)
    slip, mean, last = predict_slip(np.zeros(3), odometry, model.rim_jacobian, model)

    def law(_, state):
        body = state[:3]
        slip_speeds = speeds - model.rim_jacobian @ body
        forces = np.zeros(4)
        for _ in range(30):  # fixed point: the forces transfer load
            limits = np.clip(
                model.friction_limits + model.load_transfer @ (model.rim_jacobian.T @ forces)[:2],
                0,
                model.motor_limit,
            )
            forces = np.clip(model.stiffness * slip_speeds, -limits, limits)
        x, y, turn = body
        ax, ay, turning = model.rim_jacobian.T @ forces / model.inertia
        return [ax + turn * y, ay - turn * x, turning, *body, *slip_speeds]

    exact = solve_ivp(law, (0.0, DT), np.zeros(10), rtol=1e-8, atol=1e-10).y[:, -1]
    assert slip == pytest.approx(exact[6:], abs=1e-3)
    assert mean == pytest.approx(exact[3:6] / DT, abs=0.01)
    assert last == pytest.approx(exact[:3], abs=0.01)
    assert np.abs(slip).max() > 0.01
