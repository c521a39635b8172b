"""Kernels of the pose estimator: the group SE(2) and the prediction of slip."""

from math import nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from omnidrive.estimation import PoseEstimator
from omnidrive.estimation.pose_filter.matrices import congruence, correct_covariance
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


def random_covariance(size, rng):
    root = rng.normal(size=(size, size))
    return root @ root.T


def test_congruence_with_a_sparse_matrix_is_the_dense_product():
    rng = np.random.default_rng(0)
    p, a = random_covariance(21, rng), rng.normal(size=(18, 21))
    a[rng.random(a.shape) < 0.8] = 0.0
    result = congruence(a, p)
    np.testing.assert_allclose(result, a @ p @ a.T, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(result, result.T)


def test_correction_of_a_covariance_has_josephs_form_for_any_gain():
    rng = np.random.default_rng(1)
    p, observation, gain = random_covariance(21, rng), np.zeros(21), rng.normal(size=21)
    observation[[2, 5, 18, 19, 20]] = rng.normal(size=5)
    factor = np.eye(21) - np.outer(gain, observation)
    expected = factor @ p @ factor.T + 0.3 * np.outer(gain, gain)
    correct_covariance(p, observation, gain, 0.3)
    np.testing.assert_allclose(p, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(p, p.T)


def test_predicted_slip_solves_the_differential_equation():
    """Comparison with an adaptive integrator, for a start from rest to constant set points."""
    estimator = PoseEstimator(named_robot("paper"))
    model = estimator._model
    ratio = DT / model.following_time
    speeds = np.array([0.7, 0.2, 0.6, 1.1])
    set_points = speeds / (1.0 - (1.0 - np.exp(-ratio)) / ratio)
    odometry = Odometry(speeds * DT, nan, DT, 1.0)
    slip, mean, last = predict_slip(np.zeros(3), odometry, model.rim_jacobian, model)

    def law(_, state):
        body = state[:3]
        lags = set_points - model.rim_jacobian @ body
        forces = np.zeros(4)
        for _ in range(30):  # fixed point: the forces transfer load
            limits = np.clip(
                model.friction_limits + model.load_transfer @ (model.rim_jacobian.T @ forces)[:2],
                0,
                model.motor_limit,
            )
            forces = np.clip(model.stiffness * lags, -limits, limits)
        x, y, turn = body
        ax, ay, turning = model.rim_jacobian.T @ forces / model.inertia
        return [ax + turn * y, ay - turn * x, turning, *body, *(lags - forces / model.stiffness)]

    exact = solve_ivp(law, (0.0, DT), np.zeros(10), rtol=1e-8, atol=1e-10).y[:, -1]
    assert slip == pytest.approx(exact[6:], abs=1e-3)
    assert mean == pytest.approx(exact[3:6] / DT, abs=0.01)
    assert last == pytest.approx(exact[:3], abs=0.01)
    assert np.abs(slip).max() > 0.01


@pytest.mark.parametrize("name", ["paper", "small", "kiwi", "mecanum"])
def test_wheels_below_the_friction_limit_do_not_slip(name):
    """Set points that change by half of what the friction transmits."""
    model = PoseEstimator(named_robot(name))._model
    change = 0.5 * model.friction_limits.min() / model.stiffness
    odometry = Odometry(model.rim_jacobian @ (0.5 * change, 0.0, 0.0) * DT, nan, DT, 1.0)
    slip, mean, last = predict_slip(np.zeros(3), odometry, model.rim_jacobian, model)
    assert not slip.any()
    assert mean[0] == pytest.approx(0.5 * change, rel=0.05)
    assert last[0] > mean[0]
