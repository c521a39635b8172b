"""Linear MPC: error model, condensed problem and its solutions by other libraries, wheel limits."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.optimize import lsq_linear, minimize

from omnidrive.control import Status
from omnidrive.control.compiled_law import UNKNOWN_TWIST, UNKNOWN_VARIANCES, SampleState
from omnidrive.control.laws import linear_mpc
from omnidrive.control.laws.linear_mpc import LinearMpcController, LinearMpcParameters, minimise
from omnidrive.control.laws.lqr import lqr_gain
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, move, to_body, twist_between, wrap
from omnidrive.reference import Hold
from omnidrive.robot import Chassis, named_robot
from omnidrive.testing.laws import Circle

ROBOTS = ("paper", "small", "kiwi", "mecanum")
DT = 0.1


def condensed(law, pose, reference):
    """Parameters, feedforward, H and g of the first sample of a controller."""
    data, n = law.compiled_law().data, 3 * law.parameters.horizon
    rows, feedforward = reference.window(0.0, n // 3 + 1, law.dt), np.zeros((n // 3, 3))
    hessian, gradient = np.zeros((n, n)), np.zeros(n)
    linear_mpc.condense(data, pose, np.array(rows), feedforward, hessian, gradient)
    return data, feedforward.ravel(), hessian, gradient


def minimum(data, feedforward, hessian, gradient):
    """Twists, iterations and residual of the solver."""
    twists = np.zeros(len(gradient))
    found = linear_mpc.minimise(hessian, gradient, data.limits, feedforward, twists)
    return twists, *found


def cost(law, pose, reference, twists):
    """The cost of body twists, with exact motion."""
    p, dt, total = law.parameters, law.dt, 0.0
    turn = wrap(pose.yaw - reference.at(0.0).pose.yaw)
    rows = reference.window(0.0, p.horizon + 1, dt)[:, :3] + (0.0, 0.0, turn)
    position, heading = p.position**-2, p.heading**-2
    for k, twist in enumerate(twists.reshape(-1, 3)):
        pose = move(pose, BodyTwist(*twist), dt)
        x, y, yaw = pose - rows[k + 1]
        if k + 1 == p.horizon:
            position = cost_of_an_integrator(p.position, p.speed, dt)
            heading = cost_of_an_integrator(p.heading, p.yaw_rate, dt)
        total += position * (x * x + y * y) + heading * wrap(yaw + turn) ** 2
        nominal = np.array(twist_between(Pose(*rows[k]), Pose(*rows[k + 1]), dt))
        v = (twist - nominal) / (p.speed, p.speed, p.yaw_rate)
        total += v @ v
    return 0.5 * total


def cost_of_an_integrator(error, correction, dt):
    """By a solver of the discrete algebraic Riccati equation."""
    one = np.eye(1)
    return solve_discrete_are(one, dt * one, error**-2 * one, correction**-2 * one)[0, 0]


@pytest.mark.parametrize("robot", ROBOTS)
def test_condensed_cost_is_that_of_the_exact_motion_to_second_order(robot):
    law = LinearMpcController(DT, named_robot(robot).chassis, LinearMpcParameters(horizon=6))
    circle = Circle(0.5, 9.0)
    for size in (1e-3, 1e-4):
        pose = Pose(*np.add(circle.at(0.0).pose, np.array([1.0, -2.0, 3.0]) * size))
        _, feedforward, hessian, gradient = condensed(law, pose, circle)
        d = size * np.cos(np.arange(18.0))
        change = cost(law, pose, circle, feedforward + d) - cost(law, pose, circle, feedforward)
        assert 0.5 * d @ hessian @ d + gradient @ d == pytest.approx(change, rel=40 * size)


@pytest.mark.parametrize("horizon", [1, 10, 30])
def test_solution_within_the_limits_is_that_of_numpy(horizon):
    law = LinearMpcController(
        DT, named_robot("small").chassis, LinearMpcParameters(horizon=horizon)
    )
    circle = Circle(1.0, 20.0)
    pose = move(circle.at(0.0).pose, BodyTwist(0.02, -0.03, 0.1), 1.0)
    data, feedforward, hessian, gradient = condensed(law, pose, circle)
    assert hessian == pytest.approx(hessian.T, rel=1e-12)
    expected = feedforward - np.linalg.solve(hessian, gradient)
    twists, iterations, residual = minimum(data, feedforward, hessian, gradient)
    assert twists == pytest.approx(expected, abs=1e-8)
    assert (iterations, residual) == (0, 0.0)
    law.reset(State(0.0, pose))
    command = law.step(0.0, State(0.0, pose), circle)
    assert command.twist == pytest.approx(expected[:3], abs=1e-8)
    assert command.status is Status.OK


@pytest.mark.parametrize("size", [1.0, 3.0, 10.0])
@pytest.mark.parametrize("robot", ROBOTS)
def test_solution_at_the_limits_is_that_of_scipy(robot, size):
    """By SLSQP with the limits of all wheels and stages; of the cost, and of the twists."""
    law = LinearMpcController(DT, named_robot(robot).chassis, LinearMpcParameters(horizon=5))
    circle = Circle(1.0, 12.0)
    pose = Pose(*np.add(circle.at(0.0).pose, size * np.array([1.0, -0.7, 0.1])))
    data, feedforward, hessian, gradient = condensed(law, pose, circle)
    twists, iterations, residual = minimum(data, feedforward, hessian, gradient)
    rows = np.kron(np.eye(5), data.limits)
    assert (rows @ twists).max() <= 1.0 + 1e-9
    assert (rows @ twists).max() == pytest.approx(1.0, abs=1e-6)
    assert 0 < iterations < 30
    assert residual < 1e-11

    scale = np.abs(gradient).max()
    h, g = hessian / scale, gradient / scale

    def value(u):
        return 0.5 * (u - feedforward) @ h @ (u - feedforward) + g @ (u - feedforward)

    other = minimize(
        value,
        np.zeros(15),
        jac=lambda u: h @ (u - feedforward) + g,
        constraints={"type": "ineq", "fun": lambda u: 1.0 - rows @ u, "jac": lambda _: -rows},
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    assert value(twists) == pytest.approx(other.fun, rel=1e-8)
    assert twists == pytest.approx(other.x, abs=1e-5)


def test_limits_of_each_component_are_bounds_of_least_squares():
    """Three wheels that drive one component each."""
    chassis = Chassis(np.diag([1.0, 1.0, 1.0]), 0.7)
    law = LinearMpcController(DT, chassis)
    pose = Pose(0.9, -0.5, 0.3)
    data, feedforward, hessian, gradient = condensed(law, pose, Hold(Pose(0.0, 0.0, 0.0), 9.0))
    root = np.linalg.cholesky(hessian).T
    expected = lsq_linear(root, -np.linalg.solve(root.T, gradient), (-0.7, 0.7), tol=1e-14).x
    assert minimum(data, feedforward, hessian, gradient)[0] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("horizon", [1, 10])
@pytest.mark.parametrize("dt", [0.01, 0.1])
def test_without_active_limits_it_is_the_linear_quadratic_regulator(horizon, dt):
    parameters = LinearMpcParameters(horizon=horizon)
    law = LinearMpcController(dt, named_robot("small").chassis, parameters)
    pose, hold = Pose(0.01, -0.02, 0.05), Hold(Pose(0.0, 0.0, 0.05), 9.0)
    twist = law.step(0.0, State(0.0, pose), hold).twist
    gain = lqr_gain(0.0, dt, parameters.position, parameters.speed)[0]
    error = to_body(WorldTwist(0.01, -0.02, 0.0), 0.05)
    assert twist == pytest.approx((-gain * error.vx, -gain * error.vy, 0.0), abs=1e-12)


def test_no_limit_and_distant_targets():
    free = LinearMpcController(DT, Chassis(named_robot("small").chassis.jacobian, np.inf))
    hold = Hold(Pose(1000.0, 0.0, 0.0), 9.0)
    command = free.step(0.0, State(0.0, Pose(0.0, 0.0, 0.0)), hold)
    assert command.twist.vx > 1000.0
    chassis = named_robot("small").chassis
    command = LinearMpcController(DT, chassis).step(0.0, State(0.0, Pose(0.0, 0.0, 0.0)), hold)
    assert command.status is Status.OK
    assert np.abs(chassis.wheel_speeds(command.twist)).max() <= chassis.max_wheel_speed
    assert command.twist.vx == pytest.approx(
        max(chassis.saturate(BodyTwist(99.0, 0.0, 0.0))), rel=1e-6
    )


def test_unfinished_solution_is_a_fallback_within_the_limits(monkeypatch):
    """In Python, whose global number of iterations can be changed."""
    chassis = named_robot("small").chassis
    law = LinearMpcController(DT, chassis)
    data, pose, hold = law.compiled_law().data, Pose(9.0, 5.0, 1.0), Hold(Pose(0.0, 0.0, 0.0), 9.0)
    found = {}
    for iterations in (3, 50):
        monkeypatch.setattr(linear_mpc, "_MAX_ITERATIONS", iterations)
        monkeypatch.setattr(linear_mpc, "minimise", minimise.py_func)
        command, details = np.zeros(3), np.zeros(2)
        now = SampleState(0.0, pose, UNKNOWN_TWIST, UNKNOWN_VARIANCES, 0.0, 0.0, 0)
        arguments = (data, np.zeros(0), now, hold.window(0.0, 11, DT), command, details)
        found[iterations] = (Status(linear_mpc.linear_mpc_law.py_func(*arguments)), *details)
        assert np.abs(chassis.wheel_speeds(BodyTwist(*command))).max() <= chassis.max_wheel_speed
    assert found[3][:2] == (Status.FALLBACK, 3.0)
    assert found[3][2] > 1e-6
    assert found[50][0] is Status.OK
    assert found[50][2] < 1e-11
