"""Holonomic NMPC: derivatives, optimality, agreement with IPOPT, laws."""

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.control.nmpc.holonomic.limits import reduced_gradient, within_limits
from omnidrive.control.nmpc.holonomic.linear import unlimited
from omnidrive.control.nmpc.holonomic.motion import (
    arc,
    cost,
    roll_out,
    wheel_speed,
    wheel_speed_slopes,
)
from omnidrive.control.nmpc.holonomic.problem import HolonomicProblem
from omnidrive.control.nmpc.holonomic.solver import HolonomicSolver, InteriorSettings
from omnidrive.control.nmpc.solution import Exit
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.robot import Chassis

CHASSIS = Chassis.omni(
    angles=(0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi),
    arm=0.25,
    wheel_radius=0.05,
    max_wheel_speed=20.0,
)
SEEDS = st.integers(0, 2**32 - 1)


def problem(rng, stages=15, limit=20.0, speed=0.7, kick=0.3):
    """A wavy reference of about ``speed`` m/s, and a start beside it."""
    dt, phase = 0.1, rng.uniform(-pi, pi)
    t = phase + dt * np.arange(stages + 1)
    targets = np.column_stack(
        [speed * t, 0.5 * np.sin(speed * 2 * t), rng.uniform(-3, 3) + 0.5 * t]
    )
    start = targets[0] + kick * rng.normal(size=3)
    return HolonomicProblem(
        dt,
        start,
        targets,
        np.diff(targets, axis=0) / dt,
        np.tile([15.0, 15.0, 15.0], (stages + 1, 1)) * rng.uniform(0.5, 2.0, 3),
        rng.uniform(0.2, 2.0, 3),
        CHASSIS.jacobian.copy(),
        np.full(4, limit),
    )


@pytest.mark.parametrize("half", [0.0, 1e-3, 0.019999, 0.020001, 0.3, -1.2, 1.6, -2.5])
def test_the_arcs_factor_and_its_derivatives(half):
    h = 1e-5
    value, slope, bend = arc(half)
    if abs(half) <= 1.5:
        assert value == pytest.approx(half / sin(half) if half else 1.0, abs=1e-14)
    assert slope == pytest.approx((arc(half + h)[0] - arc(half - h)[0]) / (2 * h), abs=1e-8)
    assert bend == pytest.approx((arc(half + h)[1] - arc(half - h)[1]) / (2 * h), abs=1e-7)


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_a_stage_is_driven_by_the_twist_that_leads_from_its_start_to_its_end(seed):
    rng = np.random.default_rng(seed)
    p = problem(rng)
    yaw, vx, vy, rate = rng.uniform(-3, 3, 4)
    moved = Pose(p.dt * vx, p.dt * vy, yaw + p.dt * rate)
    expected = CHASSIS.wheel_speeds(twist_between(Pose(0.0, 0.0, yaw), moved, p.dt))
    found = [wheel_speed(p, i, yaw, vx, vy, rate) for i in range(4)]
    np.testing.assert_allclose(found, expected, atol=1e-10)


@given(SEEDS)
@settings(max_examples=50, deadline=None)
def test_derivatives_of_wheel_speeds(seed):
    rng = np.random.default_rng(seed)
    p, stage = problem(rng), rng.uniform(-3, 3, 4)
    slopes, bends = np.empty(4), np.empty((4, 4))
    up, down, other = np.empty(4), np.empty(4), np.empty((4, 4))
    value = wheel_speed_slopes(p, 1, tuple(stage.tolist()), slopes, bends)
    assert value == pytest.approx(wheel_speed(p, 1, *stage.tolist()), abs=1e-12)
    for a in range(4):
        step = 1e-6 * np.eye(4)[a]
        above = wheel_speed_slopes(p, 1, tuple((stage + step).tolist()), up, other)
        below = wheel_speed_slopes(p, 1, tuple((stage - step).tolist()), down, other)
        assert slopes[a] == pytest.approx((above - below) / 2e-6, rel=1e-6, abs=1e-6)
        np.testing.assert_allclose(bends[a], (up - down) / 2e-6, rtol=1e-5, atol=1e-5)


@given(SEEDS, st.integers(1, 30))
@settings(max_examples=50, deadline=None)
def test_without_limits_the_gradient_vanishes(seed, stages):
    p = problem(np.random.default_rng(seed), stages)
    found = unlimited(p)
    gradient = reduced_gradient(p, found, np.zeros((stages, 4, 4)), np.zeros((stages, 4)))
    assert np.abs(gradient).max() < 1e-9


def test_the_gradient_is_that_of_the_cost():
    rng = np.random.default_rng(3)
    p = problem(rng)
    v = rng.normal(size=(15, 3))
    gradient = reduced_gradient(p, v, np.zeros((15, 4, 4)), np.zeros((15, 4)))
    for k, i in ((0, 0), (7, 1), (14, 2)):
        step = np.zeros((15, 3))
        step[k, i] = 1e-6
        above, below = (cost(p, roll_out(p, v + s), v + s) for s in (step, -step))
        assert gradient[k, i] == pytest.approx((above - below) / 2e-6, rel=1e-6)


@given(SEEDS, st.integers(1, 30), st.floats(6.0, 20.0))
@settings(max_examples=150, deadline=None)
def test_every_plan_keeps_the_limits_and_is_optimal_if_it_says_so(seed, stages, limit):
    p = problem(np.random.default_rng(seed), stages, limit)
    found = HolonomicSolver().solve(p)
    assert found.exit in {Exit.CONVERGED, Exit.CAPPED}
    assert found.violation <= 0.0
    if found.exit is Exit.CONVERGED:
        assert found.residual < 1e-6
    assert found.check(p) == (found.residual, found.violation)
    if within_limits(p, unlimited(p)) <= 1.0:
        assert found.iterations == 0
        assert not found.multipliers.any()
    else:
        assert found.cost > cost(p, roll_out(p, unlimited(p)), unlimited(p))


@pytest.mark.parametrize("limit", [3.0, 8.0, 14.0, 20.0])
def test_it_converges_though_the_wheels_can_do_less_than_is_asked(limit):
    plans = [
        HolonomicSolver().solve(problem(np.random.default_rng(seed), 15, limit))
        for seed in range(200)
    ]
    assert sum(plan.exit is Exit.CONVERGED for plan in plans) >= 199
    assert np.median([plan.iterations for plan in plans]) <= 15
    assert sum(plan.iterations > 0 for plan in plans) > 100


@pytest.mark.long
def test_long_horizons_far_beyond_the_wheels_converge_nearly_always():
    plans = []
    for seed in range(3000):
        rng = np.random.default_rng(seed)
        stages, limit = int(rng.integers(1, 61)), float(rng.uniform(2, 20))
        plans.append(HolonomicSolver().solve(problem(rng, stages, limit)))
    assert all(plan.violation <= 0.0 for plan in plans)
    assert sum(plan.exit is Exit.CONVERGED for plan in plans) >= 2990
    assert np.percentile([plan.iterations for plan in plans], 99) < 70


@given(SEEDS, st.floats(4.0, 20.0))
@settings(max_examples=40, deadline=None)
def test_ipopt_finds_nothing_better(seed, limit):
    pytest.importorskip("casadi")
    from omnidrive.control.nmpc.holonomic.ipopt import HolonomicIpopt

    p = problem(np.random.default_rng(seed), 10, limit)
    found = HolonomicSolver().solve(p)
    theirs = HolonomicIpopt().solve(p)
    assert theirs.exit is Exit.CONVERGED
    assert theirs.residual < 1e-4
    assert found.cost <= theirs.cost * (1 + 1e-6) + 1e-9
    np.testing.assert_allclose(found.velocities, theirs.velocities, atol=1e-4)


@given(SEEDS, st.floats(-pi, pi))
@settings(max_examples=40, deadline=None)
def test_turning_the_world_turns_the_plan(seed, angle):
    p = problem(np.random.default_rng(seed), limit=10.0)
    isotropic = np.array([p.state_weights[0, 0], p.state_weights[0, 0], p.state_weights[0, 2]])
    p = p._replace(
        state_weights=np.tile(isotropic, (16, 1)),
        control_weights=p.control_weights[[0, 0, 2]].copy(),
    )
    c, s = cos(angle), sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ahead = np.array([0.0, 0.0, angle])
    turned = p._replace(
        start=turn @ p.start + ahead,
        targets=p.targets @ turn.T + ahead,
        feedforward=p.feedforward @ turn.T,
    )
    here, there = HolonomicSolver().solve(p), HolonomicSolver().solve(turned)
    np.testing.assert_allclose(there.velocities, here.velocities @ turn.T, atol=1e-5)


def test_many_at_once_are_the_same_as_one_by_one():
    rng = np.random.default_rng(5)
    weights = problem(rng)
    each = [problem(rng, limit=8.0) for _ in range(20)]
    each = [
        p._replace(state_weights=weights.state_weights, control_weights=weights.control_weights)
        for p in each
    ]
    together = each[0]._replace(
        **{f: np.array([getattr(p, f) for p in each]) for f in ("start", "targets", "feedforward")}
    )
    velocities, iterations = HolonomicSolver().solve_many(together)
    for k, p in enumerate(each):
        one = HolonomicSolver().solve(p)
        assert np.array_equal(one.velocities, velocities[k])
        assert one.iterations == iterations[k]


def test_what_is_not_finite_is_unusable():
    p = problem(np.random.default_rng(1))
    assert HolonomicSolver().solve(p._replace(start=np.array([0.0, np.nan, 0.0]))).exit is (
        Exit.UNUSABLE
    )


def test_a_cap_is_said():
    p = problem(np.random.default_rng(2), limit=3.0)
    found = HolonomicSolver(InteriorSettings(max_iterations=2)).solve(p)
    assert found.exit is Exit.CAPPED
    assert found.iterations == 2


def test_the_twist_of_a_plan_is_within_the_chassis_limits():
    p = problem(np.random.default_rng(4), limit=6.0)
    found = HolonomicSolver().solve(p)
    twist = twist_between(Pose(*p.start), Pose(*found.states[1]), p.dt)
    assert isinstance(twist, BodyTwist)
    assert np.abs(CHASSIS.wheel_speeds(twist)).max() <= 6.0 * (1 + 1e-7)
