"""Kernels compared with finite differences, and solvers with each other."""

import sys

import numpy as np
import pytest

from omnidrive.control.nmpc import (
    PRESETS,
    Exit,
    IpoptSettings,
    UnicycleIpopt,
    UnicycleProblem,
    UnicycleSolver,
    UnicycleSolverSettings,
    tracking_problem,
)
from omnidrive.control.nmpc.unicycle.motion import clip_controls, roll_out
from omnidrive.control.nmpc.unicycle.riccati import newton_step
from omnidrive.control.nmpc.unicycle.stage_point import cost, evaluate
from omnidrive.errors import MissingExtra
from omnidrive.geometry import Pose
from omnidrive.planning import SplinePath
from omnidrive.reference import Hold, UniformReference

HOLD = Hold(Pose(0.0, 0.0, 0.0), 10.0)


def paper_like(duration):
    """A diagonal, a bend and a straight, 9 m; the first heading is 0, as in the paper."""
    steps = np.array([[0.2, 0.2]] * 12 + [[0.0, 0.2]] * 10 + [[0.2, 0.0]] * 15 + [[0.2, 0.2]] * 6)
    positions = np.cumsum(np.vstack([[1.0, 1.0], steps]), axis=0)
    yaw = np.concatenate([[0.0], np.arctan2(steps[:, 1], steps[:, 0])])
    return UniformReference(SplinePath(np.column_stack([positions, yaw])), duration)


def problem_at(t, offset=(0.0, 0.0, 0.0), preset="paper", duration=20.0, horizon=15):
    reference = paper_like(duration)
    pose = Pose(*(np.array(reference.at(t).pose) + offset).tolist())
    return tracking_problem(PRESETS[preset], t, pose, reference, horizon=horizon, dt=0.1)


def problems():
    rng = np.random.default_rng(7)
    spread = np.array([0.2, 0.2, 0.4])
    for preset in PRESETS:
        for t in np.linspace(0.0, 19.0, 13):
            yield problem_at(float(t), preset=preset)
            yield problem_at(float(t), spread * rng.normal(size=3), preset)


def beside(gap, stages=15):
    return tracking_problem(
        PRESETS["paper"], 0.0, Pose(0.0, gap, 0.0), HOLD, horizon=stages, dt=0.1
    )


def gradient_of(problem: UnicycleProblem, controls):
    point, _ = evaluate(problem, controls)
    return point.gradient


def cost_of(problem: UnicycleProblem, controls):
    return cost(problem, roll_out(problem, controls), controls)


def numeric_jacobian(function, controls, step):
    columns = []
    for i in range(controls.size):
        change = np.zeros(controls.size)
        change[i] = step
        forward = function(controls + change.reshape(controls.shape))
        backward = function(controls - change.reshape(controls.shape))
        columns.append((np.ravel(forward) - np.ravel(backward)) / (2.0 * step))
    return np.array(columns)


def test_gradient_matches_finite_differences():
    rng = np.random.default_rng(0)
    for problem in [problem_at(3.0, (0.1, -0.2, 0.3)), problem_at(8.0, preset="published-code")]:
        controls = rng.normal(size=(15, 2))
        numeric = numeric_jacobian(lambda u, p=problem: cost_of(p, u), controls, 1e-5)
        gradient = gradient_of(problem, controls)
        np.testing.assert_allclose(gradient.ravel(), numeric.ravel(), rtol=1e-6, atol=1e-6)


def test_newton_step_solves_the_exact_newton_system():
    problem = problem_at(3.0, (0.02, -0.05, 0.1))
    point, _ = evaluate(problem, 0.9 * problem.feedforward)
    hessian = numeric_jacobian(lambda u: gradient_of(problem, u), point.controls, 1e-5)
    assert np.linalg.eigvalsh(hessian)[0] > 0.0
    definite, step = newton_step(problem, point, 1.0)
    assert definite
    expected = np.linalg.solve(hessian, -point.gradient.ravel())
    np.testing.assert_allclose(step.ravel(), expected, rtol=1e-5, atol=1e-7)


def test_newton_step_fixes_controls_at_active_limits():
    problem = problem_at(0.0, (-0.5, -0.5, 0.0))
    point, _ = evaluate(problem, np.tile(problem.limits, (15, 1)))
    assert not point.free.all()
    _, step = newton_step(problem, point, 0.0)
    assert (step[~point.free] == 0.0).all()


def test_indefinite_model_yields_negative_curvature():
    problem = beside(0.8)
    point, _ = evaluate(problem, np.zeros((15, 2)))
    assert np.abs(point.gradient).max() == 0.0  # the saddle
    definite, direction = newton_step(problem, point, 1.0)
    assert not definite
    hessian = numeric_jacobian(lambda u: gradient_of(problem, u), point.controls, 1e-5)
    assert direction.ravel() @ hessian @ direction.ravel() < 0.0


@pytest.mark.parametrize("horizon", [1, 5, 30])
def test_residual_is_small_and_limits_hold_at_any_horizon(horizon):
    for t in (0.0, 4.0, 17.5):
        problem = problem_at(t, (0.2, -0.1, 0.4), horizon=horizon)
        solution = UnicycleSolver().solve(problem, problem.feedforward)
        assert solution.exit is Exit.CONVERGED
        assert solution.residual <= 1e-7
        assert (np.abs(solution.controls) <= problem.limits).all()


def test_solution_is_consistent_with_its_controls():
    problem = problem_at(5.0, (0.1, 0.1, 0.1))
    solution = UnicycleSolver().solve(problem, problem.feedforward)
    np.testing.assert_array_equal(solution.states[0], problem.start)
    assert solution.cost == cost_of(problem, solution.controls)
    moved = solution.controls - gradient_of(problem, solution.controls)
    limits = np.array(problem.limits)
    projected = np.clip(moved, -limits, limits)
    assert solution.residual == np.abs(solution.controls - projected).max()


def test_agrees_with_ipopt():
    pytest.importorskip("casadi")
    sqp, ipopt = UnicycleSolver(), UnicycleIpopt()
    for problem in problems():
        a = sqp.solve(problem, problem.feedforward)
        b = ipopt.solve(problem, problem.feedforward)
        assert a.exit is b.exit is Exit.CONVERGED
        assert a.residual <= 1e-7
        assert (np.abs(a.controls) <= problem.limits).all()
        assert (np.abs(b.controls) <= problem.limits).all()
        assert a.cost == pytest.approx(b.cost, rel=1e-6, abs=1e-9)
        np.testing.assert_allclose(a.controls[0], b.controls[0], atol=1e-4)


def test_warm_and_cold_starts_agree():
    solver = UnicycleSolver()
    for problem in problems():
        cold = solver.solve(problem, problem.feedforward)
        warm = solver.solve(problem, cold.controls + 0.05)
        restarted = solver.solve(problem, cold.controls)
        assert warm.cost == pytest.approx(cold.cost, rel=1e-9, abs=1e-12)
        np.testing.assert_allclose(warm.controls, cold.controls, atol=1e-6)
        assert restarted.iterations == 0


def test_solver_leaves_the_saddle_beside_the_target():
    """Rest is stationary; far from the target it is not a minimum."""
    problem = beside(0.8)
    cost_at_rest = cost_of(problem, np.zeros((15, 2)))
    solution = UnicycleSolver().solve(problem, np.zeros((15, 2)))
    assert solution.exit is Exit.CONVERGED
    assert solution.cost < 0.95 * cost_at_rest


def test_rest_near_the_target_is_optimal():
    """Near the target rest is the optimum: no solution from 50 random guesses is better."""
    problem = beside(0.5)
    cost_at_rest = cost_of(problem, np.zeros((15, 2)))
    rng = np.random.default_rng(1)
    for _ in range(50):
        guess = rng.uniform(-1.0, 1.0, (15, 2)) * problem.limits
        assert UnicycleSolver().solve(problem, guess).cost >= cost_at_rest * (1.0 - 1e-9)


def test_maximum_of_iterations_returns_decreasing_costs():
    problem = problem_at(0.0, (-0.5, 0.5, 2.0))
    guess = clip_controls(problem, problem.feedforward)
    costs = [cost_of(problem, guess)]
    for cap in (1, 2, 3):
        solution = UnicycleSolver(UnicycleSolverSettings(max_iterations=cap)).solve(problem, guess)
        assert solution.exit is Exit.CAPPED
        assert solution.iterations == cap
        costs.append(solution.cost)
    assert costs == sorted(costs, reverse=True)
    assert costs[0] > costs[-1]


def test_ipopt_result_is_no_worse_than_its_guess():
    pytest.importorskip("casadi")
    problem = problem_at(0.0, (-0.5, 0.5, 2.0))
    guess = clip_controls(problem, problem.feedforward)
    solver = UnicycleIpopt(IpoptSettings(max_iterations=1))
    solution = solver.solve(problem, guess)
    assert solution.exit is Exit.CAPPED
    assert solution.cost <= cost_of(problem, guess)


def test_missing_casadi_names_the_installation_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(MissingExtra, match=r"pip install casadi"):
        UnicycleIpopt()
