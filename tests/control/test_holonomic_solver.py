"""Solver of holonomic problems: derivatives, optimality, agreement with IPOPT, invariants."""

from inspect import unwrap
from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control.nmpc.common.exit import CONVERGED, Exit
from omnidrive.control.nmpc.holonomic import (
    HolonomicProblem,
    HolonomicSolver,
    HolonomicSolverSettings,
    KeepOutZone,
    rate_limits,
    speed_limits,
    stack_keep_outs,
    stack_limits,
)
from omnidrive.control.nmpc.holonomic.active_set import solve_active_set
from omnidrive.control.nmpc.holonomic.interior_point import initialize, iterate
from omnidrive.control.nmpc.holonomic.keep_out_cost import keep_out_cost, signed_distance
from omnidrive.control.nmpc.holonomic.law import law_memory
from omnidrive.control.nmpc.holonomic.lqr import unconstrained_velocities
from omnidrive.control.nmpc.holonomic.motion import (
    earlier_twist,
    limit_value,
    max_limit_ratio,
    roll_out,
    stage_twists,
    twist_derivatives,
)
from omnidrive.control.nmpc.holonomic.other_side import replaces
from omnidrive.control.nmpc.holonomic.solution import HolonomicSolution
from omnidrive.control.nmpc.holonomic.stage_point import (
    allocate_point,
    cost,
    evaluate,
    reduced_gradient,
)
from omnidrive.control.nmpc.holonomic.step import solve_problem
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, twist_between
from omnidrive.geometry.arc import arc_factor, arc_twist, arc_velocity
from omnidrive.robot import Chassis
from tests.examples import examples

CHASSIS = Chassis.omni(
    angles=(0.25 * pi, 0.75 * pi, 1.25 * pi, 1.75 * pi),
    ring_radius=0.25,
    wheel_radius=0.05,
    max_wheel_speed=20.0,
)
SEEDS = st.integers(0, 2**32 - 1)


SQUARE = np.array([[0.2, -0.2], [0.2, 0.2], [-0.2, 0.2], [-0.2, -0.2]])


def problem(rng, stages=15, limit=20.0, offset=0.3, *, rate=None, lag=0.0, zones=0, inertial=False):
    """Return the problem of a wavy reference of about 0.7 m/s, and a start beside it.

    With a limit ``rate`` of the wheels' acceleration in rad/s^2, or a lag in s, the robot moves
    initially; ``zones`` is the number of keep-out zones near the reference: discs, squares and
    moving discs.
    """
    dt, phase = 0.1, rng.uniform(-pi, pi)
    t = phase + dt * np.arange(stages + 1)
    targets = np.column_stack([0.7 * t, 0.5 * np.sin(1.4 * t), rng.uniform(-3, 3) + 0.5 * t])
    start = targets[0] + offset * rng.normal(size=3)
    state_weights = np.tile([15.0, 15.0, 15.0], (stages + 1, 1)) * rng.uniform(0.5, 2.0, 3)
    control_weights = rng.uniform(0.2, 2.0, 3)
    limits = speed_limits(CHASSIS.jacobian, limit, dt, (lag, lag))
    if rate is not None:
        limits = stack_limits(limits, rate_limits(CHASSIS.jacobian, rate, dt))
    limits = limits._replace(inertial=inertial)
    previous = np.zeros(3)
    if rate is not None or lag:
        previous = rng.normal(size=3) * [0.4, 0.4, 0.8]
        previous *= min(1.0, limit / np.abs(CHASSIS.jacobian @ previous).max())
    return HolonomicProblem(
        dt,
        start,
        previous,
        targets,
        np.diff(targets, axis=0) / dt,
        state_weights,
        control_weights,
        limits,
        stack_keep_outs([zone(rng, k, targets) for k in range(zones)], stages + 1),
    )


def zone(rng, k, targets):
    """Return a zone near the reference: a disc, a rounded square, or a disc that crosses it."""
    centre = targets[rng.integers(len(targets)), :2] + 0.3 * rng.normal(size=2)
    moves = np.linspace(0.0, 0.5, len(targets))[:, None] * rng.normal(size=2)
    return (
        KeepOutZone(centre, rng.uniform(0.1, 0.4)),
        KeepOutZone(centre, rng.uniform(0.05, 0.2), SQUARE),
        KeepOutZone(centre + moves, rng.uniform(0.1, 0.4)),
    )[k % 3]


def gradient_of(p, velocities):
    """Return the derivative of J by the velocities."""
    point = allocate_point(velocities, np.empty((len(velocities), 0)))
    evaluate(p, point)
    return reduced_gradient(p.dt, point)


@pytest.mark.parametrize("half", [0.0, 1e-3, 0.019999, 0.020001, 0.3, -1.2, 1.6, -2.5])
def test_arc_factor_and_its_derivatives(half):
    h = 1e-5
    value, first, second = arc_factor(half)
    if abs(half) <= 1.5:
        assert value == pytest.approx(half / sin(half) if half else 1.0, abs=1e-14)
    assert first == pytest.approx(
        (arc_factor(half + h)[0] - arc_factor(half - h)[0]) / (2 * h), abs=1e-8
    )
    assert second == pytest.approx(
        (arc_factor(half + h)[1] - arc_factor(half - h)[1]) / (2 * h), abs=1e-7
    )


@given(SEEDS)
@examples(50)
def test_arc_twist_connects_start_and_end_of_a_stage(seed):
    yaw, vx, vy, rate = np.random.default_rng(seed).uniform(-3, 3, 4).tolist()
    moved = Pose(0.1 * vx, 0.1 * vy, yaw + 0.1 * rate)
    ahead, left = arc_twist(0.1, yaw, vx, vy, rate)
    expected = twist_between(Pose(0.0, 0.0, yaw), moved, 0.1)
    np.testing.assert_allclose([ahead, left, rate], expected, atol=1e-12)
    np.testing.assert_allclose(arc_velocity(0.1, yaw, ahead, left, rate), [vx, vy], atol=1e-12)


@given(SEEDS)
@examples(50)
def test_derivatives_of_stage_twists(seed):
    rng = np.random.default_rng(seed)
    stage, multipliers = rng.uniform(-3, 3, 4), tuple(rng.normal(size=2).tolist())

    def derivatives(stage):
        jacobian, hessian = np.empty((1, 2, 4)), np.empty((1, 7, 7))
        value = twist_derivatives(0.1, tuple(stage.tolist()), multipliers, jacobian, hessian, 0)
        return np.array(value), jacobian[0], hessian[0]

    value, jacobian, hessian = derivatives(stage)
    np.testing.assert_allclose(value, arc_twist(0.1, *stage.tolist()), atol=1e-12)
    for a in range(4):
        step = 1e-6 * np.eye(4)[a]
        above, up, _ = derivatives(stage + step)
        below, down, _ = derivatives(stage - step)
        np.testing.assert_allclose(jacobian[:, a], (above - below) / 2e-6, rtol=1e-6, atol=1e-6)
        expected = np.array(multipliers) @ (up - down) / 2e-6
        np.testing.assert_allclose(hessian[a, : a + 1], expected[: a + 1], rtol=1e-5, atol=1e-5)


@given(SEEDS, st.integers(1, 6), st.booleans())
@examples(30)
def test_reduced_gradient_matches_finite_differences(seed, stages, inertial):
    """Of the Lagrangian by every velocity, with the states as functions of the velocities."""
    rng = np.random.default_rng(seed)
    p = problem(rng, stages, rate=50.0, lag=0.05, zones=3, inertial=inertial)
    v, multipliers = rng.normal(size=(stages, 3)), rng.normal(size=(stages, 8))

    def lagrangian(v):
        twists = stage_twists(p, v)
        earlier = [earlier_twist(p, twists, k) for k in range(stages)]
        values = [
            [limit_value(p, i, twists, k, earlier[k]) for i in range(8)] for k in range(stages)
        ]
        return cost(p, roll_out(p, v), v) + (multipliers * values / p.limits.bounds).sum()

    point = allocate_point(v, np.tile(p.limits.bounds, (stages, 1)))
    point.multipliers[:] = multipliers
    evaluate(p, point)
    gradient = reduced_gradient(p.dt, point)
    for k in range(stages):
        for i in range(3):
            step = np.zeros((stages, 3))
            step[k, i] = 1e-6
            first = (lagrangian(v + step) - lagrangian(v - step)) / 2e-6
            assert gradient[k, i] == pytest.approx(first, rel=1e-5, abs=1e-4)


@given(SEEDS)
@examples(20)
def test_hessian_of_inertial_limits_matches_differences_of_gradients(seed):
    """That of the limits alone, by the velocities of all stages; yaw_k follows from them."""
    rng, stages = np.random.default_rng(seed), 4
    p = problem(rng, stages, rate=50.0, lag=0.05, inertial=True)
    v, multipliers = rng.normal(size=(stages, 3)), rng.normal(size=(stages, 8))

    def point_at(v):
        point = allocate_point(v.reshape(stages, 3), np.tile(p.limits.bounds, (stages, 1)))
        point.multipliers[:] = multipliers
        evaluate(p, point)
        point.gradient_state[:], point.gradient_velocity[:] = 0.0, 0.0
        return point

    point, total = point_at(v.copy()), np.zeros((3 * stages, 3 * stages))
    for k in range(stages):
        parts = np.zeros((7, 3 * stages))  # yaw_k, v_k and v_{k-1} by all velocities
        parts[0, 2 : 3 * k : 3] = p.dt
        parts[1:4, 3 * k : 3 * k + 3] = np.eye(3)
        if k > 0:
            parts[4:7, 3 * k - 3 : 3 * k] = np.eye(3)
        lower = np.tril(point.hessian[k])
        total += parts.T @ (lower + np.tril(lower, -1).T) @ parts
    for i, step in enumerate(1e-5 * np.eye(3 * stages)):
        above, below = (
            reduced_gradient(p.dt, point_at(v.ravel() + sign * step)) for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(total[i], (above - below).ravel() / 2e-5, atol=1e-5)


def test_a_turning_robot_keeps_its_velocity_without_force():
    """With inertial limits, those of the velocity's change in W; a twist constant in B needs it."""
    p = problem(np.random.default_rng(0), 10, rate=1.0, inertial=True)
    straight = np.tile([1.0, 0.5, 2.0], (10, 1))
    twists = stage_twists(p, straight)
    constant = np.tile(twists[0], (10, 1))
    for k in range(1, 10):
        values = [limit_value(p, i, twists, k, earlier_twist(p, twists, k)) for i in range(4, 8)]
        np.testing.assert_allclose(values, 0.0, atol=1e-12)
        before = earlier_twist(p, constant, k)
        values = [limit_value(p, i, constant, k, before) for i in range(4, 8)]
        assert np.abs(values).max() > 1.0


@given(SEEDS, st.integers(1, 30))
@examples(50)
def test_gradient_vanishes_at_the_unconstrained_optimum(seed, stages):
    p = problem(np.random.default_rng(seed), stages)
    assert np.abs(gradient_of(p, unconstrained_velocities(p))).max() < 1e-9


@given(SEEDS, st.integers(1, 30), st.floats(6.0, 20.0))
@examples(150)
def test_plans_are_feasible_and_converged_ones_optimal(seed, stages, limit):
    p = problem(np.random.default_rng(seed), stages, limit)
    found = HolonomicSolver().solve(p)
    assert found.exit in {Exit.CONVERGED, Exit.CAPPED}
    assert found.violation <= 0.0
    if found.exit is Exit.CONVERGED:
        assert found.residual < 1e-6
    assert found.check(p) == (found.residual, found.violation)
    if max_limit_ratio(p, stage_twists(p, unconstrained_velocities(p))) <= 1.0:
        assert found.iterations == 0
        assert not found.multipliers.any()
    else:
        assert found.cost > cost(
            p, roll_out(p, unconstrained_velocities(p)), unconstrained_velocities(p)
        )


@pytest.mark.parametrize("limit", [3.0, 8.0, 14.0, 20.0])
def test_converges_with_active_wheel_speed_limits(limit):
    plans = [
        HolonomicSolver().solve(problem(np.random.default_rng(seed), 15, limit))
        for seed in range(200)
    ]
    assert sum(plan.exit is Exit.CONVERGED for plan in plans) >= 199
    assert np.median([plan.iterations for plan in plans]) <= 15
    assert sum(plan.iterations > 0 for plan in plans) > 100


@pytest.mark.long
def test_converges_with_long_horizons_and_infeasible_references():
    plans = []
    for seed in range(3000):
        rng = np.random.default_rng(seed)
        stages, limit = int(rng.integers(1, 61)), float(rng.uniform(2, 20))
        plans.append(HolonomicSolver().solve(problem(rng, stages, limit)))
    assert all(plan.violation <= 0.0 for plan in plans)
    assert sum(plan.exit is Exit.CONVERGED for plan in plans) >= 2990
    assert np.percentile([plan.iterations for plan in plans], 99) < 70


@pytest.mark.parametrize("rate", [20.0, 60.0])
@pytest.mark.parametrize("lag", [0.0, 0.1])
@pytest.mark.parametrize("zones", [0, 3])
def test_converges_with_rate_limits_lag_and_keep_out_zones(rate, lag, zones):
    given = {"rate": rate, "lag": lag, "zones": zones}
    problems = [problem(np.random.default_rng(seed), 20, 12.0, **given) for seed in range(100)]
    plans = [HolonomicSolver().solve(p) for p in problems]
    assert sum(plan.exit is Exit.CONVERGED for plan in plans) >= 97
    assert max(plan.violation for plan in plans) < 1e-9
    for p, plan in zip(problems, plans, strict=True):
        if plan.exit is Exit.CONVERGED:
            assert plan.residual < 1e-6
            twists = np.vstack([p.previous, stage_twists(p, plan.velocities)])
            commanded = twists[1:] + lag / p.dt * np.diff(twists, axis=0)
            assert np.abs(commanded @ CHASSIS.jacobian.T).max() <= 12.0 * (1 + 1e-9)
            wheels = np.diff(twists @ CHASSIS.jacobian.T, axis=0) / p.dt
            assert np.abs(wheels).max() <= rate * (1 + 1e-9)


@pytest.mark.parametrize(
    ("limit", "options", "share"),
    [
        (20.0, {}, 0.9),
        (10.0, {}, 0.5),
        (20.0, {"rate": 60.0}, 0.1),
        (20.0, {"rate": 60.0, "inertial": True}, 0.1),
        (20.0, {"zones": 3}, 0.1),
    ],
)
def test_active_set_method_agrees_with_the_interior_point_method(limit, options, share):
    found = []
    for seed in range(100):
        p = problem(np.random.default_rng(seed), 15, limit, **options)
        point, iterations = solve_active_set(p, unconstrained_velocities(p), 1e-8, 200)
        found.append(iterations >= 0)
        if iterations >= 0:
            plan = HolonomicSolution.of(
                p, point.velocities, point.multipliers, iterations, Exit.CONVERGED
            )
            assert plan.residual <= 1e-8
            assert plan.violation <= 0.0
            ip = initialize(p, unconstrained_velocities(p), 1e-8)
            assert iterate(p, ip, 1e-8, 200) == CONVERGED
            if "zones" not in options:
                np.testing.assert_allclose(point.velocities, ip.point.velocities, atol=1e-5)
            else:  # several local optima may exist
                other = ip.point.velocities
                assert plan.cost <= 1.01 * cost(p, roll_out(p, other), other)
    assert np.mean(found) > share


IPOPTS = [
    {},
    {"rate": 50.0},
    {"rate": 50.0, "lag": 0.05},
    {"rate": 50.0, "zones": 3},
    {"rate": 50.0, "inertial": True},
]


@pytest.mark.parametrize("options", IPOPTS)
@given(SEEDS, st.floats(4.0, 20.0))
@examples(25)
def test_ipopt_does_not_find_a_lower_cost(options, seed, limit):
    """Keep-out zones may cause several local optima: then IPOPT's is checked for optimality."""
    pytest.importorskip("casadi")
    from omnidrive.control.nmpc.holonomic import HolonomicIpopt

    p = problem(np.random.default_rng(seed), 10, limit, **options)
    found = HolonomicSolver().solve(p)
    ipopt = HolonomicIpopt().solve(p)
    assert ipopt.exit is Exit.CONVERGED
    if "zones" in options and not np.allclose(found.velocities, ipopt.velocities, atol=1e-3):
        assert ipopt.residual < 1e-2
        return
    assert ipopt.residual < (1e-2 if "zones" in options else 1e-4)
    assert found.cost <= ipopt.cost * (1 + 1e-6) + 1e-9
    np.testing.assert_allclose(found.velocities, ipopt.velocities, atol=1e-4)


@pytest.mark.parametrize("factor", [1.0, 1.5, 3.0])
def test_robot_above_its_speed_limit_brakes_at_the_rate_limit(factor):
    """The speed limit is infeasible initially: the violation is as small as possible."""
    rates = rate_limits(CHASSIS.jacobian, 40.0, 0.1)
    p = problem(np.random.default_rng(3), 20)
    fast = np.array([0.6, 0.2, 0.5])
    fast *= factor * 10.0 / np.abs(CHASSIS.jacobian @ fast).max()
    p = p._replace(
        previous=fast, limits=stack_limits(speed_limits(CHASSIS.jacobian, 10.0, 0.1), rates)
    )
    found = HolonomicSolver().solve(p)
    assert found.exit is Exit.CONVERGED
    wheels = np.abs(np.vstack([fast, stage_twists(p, found.velocities)]) @ CHASSIS.jacobian.T)
    needed = np.maximum(10.0 * factor - 4.0 * np.arange(21), 10.0)  # braking at 40 rad/s^2
    assert (wheels.max(axis=1) <= 1.03 * needed).all()
    assert found.violation == pytest.approx(max(factor - 1.4, 0.0), abs=0.03 * factor)


@pytest.mark.parametrize("corners", [None, SQUARE])
@pytest.mark.parametrize("weight", [1e3, 1e5])
def test_plan_leaves_and_avoids_keep_out_zones(corners, weight):
    p = problem(np.random.default_rng(2), 30, offset=0.0)
    inside = KeepOutZone(p.start[:2] + np.array([0.05, 0.02]), 0.3, corners, weight)
    across = KeepOutZone(p.targets[20, :2] + np.array([0.03, 0.05]), 0.25, corners, weight)
    p = p._replace(keep_outs=stack_keep_outs([inside, across], 31))
    found = HolonomicSolver().solve(p)
    assert found.exit is Exit.CONVERGED
    distance = np.array(
        [
            [
                signed_distance(p.keep_outs, j, k, *found.states[k, :2].tolist())[0]
                for k in range(31)
            ]
            for j in range(2)
        ]
    )
    allowed = 30.0 / weight**0.75
    assert distance[0, 0] < 0.3
    assert distance[0, 6:].min() > 0.3 - allowed
    assert distance[1].min() > 0.25 - allowed


@pytest.mark.parametrize(
    ("seed", "first", "best"),
    [
        (12, 36.1463, 30.2471),
        (22, 374.051, 254.151),
        (74, 35.2073, 21.5734),
        (98, 36.5125, 6.97619),
    ],
)
def test_zone_is_passed_on_the_better_side(seed, first, best):
    """The costs are those of IPOPT from starts on either side."""
    p = problem(np.random.default_rng(seed), 15, 12.0, rate=50.0, zones=1)
    point, iterations = solve_active_set(p, unconstrained_velocities(p), 1e-8, 200)
    velocities = point.velocities
    if iterations < 0:
        ip = initialize(p, unconstrained_velocities(p), 1e-8)
        assert iterate(p, ip, 1e-8, 200) == CONVERGED
        velocities = ip.point.velocities
    assert cost(p, roll_out(p, velocities), velocities) == pytest.approx(first, rel=1e-5)
    found = HolonomicSolver().solve(p)
    assert found.exit is Exit.CONVERGED
    assert found.cost == pytest.approx(best, rel=1e-5)
    assert found.residual < 1e-6
    assert np.array_equal(found.velocities, HolonomicSolver(deadline=60.0).solve(p).velocities)
    assert np.array_equal(found.velocities, HolonomicSolver().solve(p, found.velocities).velocities)


@pytest.mark.parametrize(
    ("excess", "latest", "replaced"),
    [
        (-0.01, None, True),
        (0.01, None, False),
        (-0.01, "first", False),
        (-0.06, "first", True),
        (0.01, "other", True),
        (0.06, "other", False),
    ],
)
def test_plan_near_the_latest_one_is_kept_up_to_a_small_difference_of_costs(
    excess, latest, replaced
):
    p = problem(np.random.default_rng(1))
    first, other = np.zeros((15, 3)), np.ones((15, 3))
    plans = {None: first[:0], "first": first[1:] + 0.1, "other": other[1:] - 0.1}
    assert replaces(p, first, 10.0, other, 10.0 * (1.0 + excess), plans[latest]) is replaced


@pytest.mark.parametrize(
    ("seed", "first", "best"),
    [(7, 2028.38, 1507.26), (36, 2150.37, 1509.79), (56, 1305.50, 948.246)],
)
def test_heading_turns_in_the_better_direction(seed, first, best):
    """The target is 3 rad to the left and turns left; the costs are IPOPT's for both turns."""
    p = problem(np.random.default_rng(seed), 15, 12.0, rate=50.0)
    p.start[2] = p.targets[0, 2] - 3.0
    assert HolonomicSolver().solve(p).cost == pytest.approx(first, rel=1e-5)
    plan = law_memory(15, 8, 0).plan
    assert solve_problem(p, plan, plan.velocities[:0], *HolonomicSolverSettings())
    assert float(plan.figures["cost"][0]) == pytest.approx(best, rel=1e-5)
    assert plan.states[-1, 2] < p.start[2] - 1.0  # it turns right


def test_heading_error_of_a_right_angle_has_one_turn():
    p = problem(np.random.default_rng(7), 15, 12.0, rate=50.0)
    p.start[2] = p.targets[0, 2] - 1.5
    plan = law_memory(15, 8, 0).plan
    assert solve_problem(p, plan, plan.velocities[:0], *HolonomicSolverSettings())
    assert np.array_equal(plan.velocities, HolonomicSolver().solve(p).velocities)


@given(SEEDS)
@examples(50)
def test_signed_distance_and_its_derivatives(seed):
    rng = np.random.default_rng(seed)
    corners = [None, SQUARE, SQUARE[:2]][seed % 3]
    zones = stack_keep_outs([KeepOutZone(np.array([0.3, -0.2]), 0.2, corners)], 1)
    x, y = rng.normal(size=2)
    distance, nx, ny, curvature = signed_distance(zones, 0, 0, x, y)
    if corners is None:
        assert distance == pytest.approx(np.hypot(x - 0.3, y + 0.2))
    if distance > 1e-3:
        assert np.hypot(nx, ny) == pytest.approx(1.0)
        for dx, dy in ((1e-6, 0.0), (0.0, 1e-6)):
            above, ax, ay, _ = signed_distance(zones, 0, 0, x + dx, y + dy)
            below, bx, by, _ = signed_distance(zones, 0, 0, x - dx, y - dy)
            assert (above - below) / 2e-6 == pytest.approx((nx * dx + ny * dy) * 1e6, abs=1e-5)
            expected = [
                curvature * (dx - nx * (nx * dx + ny * dy)) * 1e6,
                curvature * (dy - ny * (nx * dx + ny * dy)) * 1e6,
            ]
            np.testing.assert_allclose([(ax - bx) / 2e-6, (ay - by) / 2e-6], expected, atol=1e-3)


def test_signed_distance_is_negative_inside_a_polygon():
    zones = stack_keep_outs([KeepOutZone(np.zeros(2), 0.1, SQUARE)], 1)
    assert signed_distance(zones, 0, 0, 0.15, 0.0)[:3] == pytest.approx((-0.05, 1.0, 0.0))
    assert keep_out_cost(zones, np.array([[0.15, 0.0, 0.0]])) == pytest.approx(1e4 * 0.15**2)


@given(SEEDS, st.floats(-pi, pi))
@examples(40)
def test_plan_is_equivariant_under_rotation_of_the_world(seed, angle):
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


def test_solve_many_equals_single_solves():
    rng = np.random.default_rng(5)
    weights = problem(rng)
    each = [problem(rng, limit=8.0, rate=50.0) for _ in range(20)]
    each = [
        p._replace(state_weights=weights.state_weights, control_weights=weights.control_weights)
        for p in each
    ]
    fields = ("start", "previous", "targets", "feedforward")
    together = each[0]._replace(**{f: np.array([getattr(p, f) for p in each]) for f in fields})
    velocities, iterations = HolonomicSolver().solve_many(together)
    for k, p in enumerate(each):
        one = HolonomicSolver().solve(p)
        assert np.array_equal(one.velocities, velocities[k])
        assert one.iterations == iterations[k]


def test_solve_many_reports_problems_that_did_not_converge():
    p = problem(np.random.default_rng(5), limit=8.0)
    fields = ("start", "previous", "targets", "feedforward")
    two = p._replace(**{f: np.array([getattr(p, f)] * 2) for f in fields})
    two.start[1, 0] = np.nan
    _, iterations = HolonomicSolver().solve_many(two)
    assert iterations[0] > 0 > iterations[1]
    _, iterations = HolonomicSolver(HolonomicSolverSettings(max_iterations=1)).solve_many(two)
    assert iterations[0] == -2


@pytest.mark.parametrize("field", ["start", "previous", "targets", "feedforward"])
@pytest.mark.parametrize("deadline", [None, 1.0])
def test_problem_that_is_not_finite_is_unusable(field, deadline):
    p = problem(np.random.default_rng(1), rate=50.0)
    bad = getattr(p, field).copy()
    bad.flat[1] = np.nan
    assert HolonomicSolver(deadline=deadline).solve(p._replace(**{field: bad})).exit is (
        Exit.UNUSABLE
    )


def test_maximum_of_iterations_is_reported():
    p = problem(np.random.default_rng(2), limit=3.0)
    found = HolonomicSolver(HolonomicSolverSettings(max_iterations=2)).solve(p)
    assert found.exit is Exit.CAPPED
    assert found.iterations == 2


def test_first_twist_of_a_plan_keeps_the_chassis_limits():
    p = problem(np.random.default_rng(4), limit=6.0)
    found = HolonomicSolver().solve(p)
    twist = twist_between(Pose(*p.start), Pose(*found.states[1]), p.dt)
    assert isinstance(twist, BodyTwist)
    assert np.abs(CHASSIS.wheel_speeds(twist)).max() <= 6.0 * (1 + 1e-7)


def test_deadline_yields_a_feasible_plan():
    p = problem(np.random.default_rng(2), 40, 3.0, rate=30.0, zones=3)
    late = HolonomicSolver(deadline=0.0).solve(p)
    assert late.exit is Exit.LATE
    assert late.iterations == 0
    assert late.violation < 1e-9
    in_time = HolonomicSolver(deadline=60.0).solve(p)
    assert in_time.exit is Exit.CONVERGED
    assert np.array_equal(in_time.velocities, HolonomicSolver().solve(p).velocities)
    assert in_time.cost < late.cost
    with pytest.raises(InvalidInput, match="deadline must not be negative"):
        HolonomicSolver(deadline=-1.0)


def test_solution_is_deterministic():
    p = problem(np.random.default_rng(2), 30, 6.0, rate=50.0, lag=0.05, zones=3)
    one, other = HolonomicSolver().solve(p), HolonomicSolver().solve(p)
    assert np.array_equal(one.velocities, other.velocities)
    assert np.array_equal(one.multipliers, other.multipliers)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: unwrap(speed_limits)(np.ones((4, 2)), 1.0, 0.1), r"three columns, got \(4, 2\)"),
        (lambda: unwrap(speed_limits)(np.eye(3), np.ones(2), 0.1), "3 rows need one bound or 3"),
        (lambda: rate_limits(np.eye(3), 0.0, 0.1), "bounds must be positive and finite, got 0"),
        (lambda: speed_limits(np.eye(3), 1.0, 0.1, (0.0, -1.0)), "lag must not be negative"),
        (lambda: KeepOutZone(np.array([np.nan, 0.0]), 0.1), "finite points"),
        (
            lambda: KeepOutZone(np.zeros(2), 0.0),
            "radius of a keep-out zone must be positive, got 0",
        ),
        (
            lambda: KeepOutZone(np.zeros(2), 0.1, weight=-1.0),
            "weight of a keep-out zone must be positive",
        ),
        (lambda: KeepOutZone(np.zeros(2), 0.1, SQUARE[::-1]), "counter-clockwise"),
        (
            lambda: stack_keep_outs([KeepOutZone(np.zeros((3, 2)), 0.1)], 16),
            "3 centres, but the plan has 16",
        ),
    ],
)  # fmt: skip
def test_invalid_limits_and_keep_out_zones_are_rejected(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()
