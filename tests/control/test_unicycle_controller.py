"""Controller with the unicycle model."""

import copy
import inspect

import numpy as np
import pytest

from omnidrive.control import Controller, Status
from omnidrive.control.nmpc import (
    PRESETS,
    Exit,
    UnicycleController,
    UnicycleSolution,
    UnicycleSolver,
    UnicycleSolverSettings,
    tracking_problem,
    unicycle_law,
    unicycle_nmpc,
)
from omnidrive.control.nmpc.common.unwrap import unwrap_near
from omnidrive.control.nmpc.unicycle.tracking import finite_differences
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body
from omnidrive.planning import SplinePath
from omnidrive.reference import Hold, UniformReference
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, Outcome, simulate

DT = 0.1
START = Pose(1.0, 1.0, 0.0)
CORNER = Hold(Pose(2.0, 2.0, 0.25 * np.pi), 10.0)


def bend(turn=0.0):
    """Quarter circle of 4 m radius in 12 s, rotated by ``turn`` rad."""
    angle = np.linspace(0.0, 0.5 * np.pi, 32)
    x, y = 4.0 * np.sin(angle), 4.0 - 4.0 * np.cos(angle)
    c, s = np.cos(turn), np.sin(turn)
    return UniformReference(
        SplinePath(np.column_stack([c * x - s * y, s * x + c * y, angle + turn])), 12.0
    )


def drive(controller, reference, start=START):
    return simulate(
        KinematicPlant(named_robot("paper")), controller, reference, start=start, dt=DT
    ).raise_if_failed()


def test_satisfies_the_controller_protocol():
    assert isinstance(unicycle_nmpc("paper", DT), Controller)


@pytest.mark.parametrize("preset", list(PRESETS))
@pytest.mark.parametrize("horizon", [5, 15, 30])
def test_tracks_a_bend_and_converges_at_every_step(preset, horizon):
    run = drive(unicycle_nmpc(preset, DT, horizon), bend(), Pose(0.0, 0.0, 0.0))
    assert (run.status == Status.OK).all()
    gap = np.hypot(*(run.pose - run.target)[:, :2].T)
    assert gap.max() < 0.1


def test_step_reference_is_reached_and_held():
    run = drive(unicycle_nmpc("paper", DT), CORNER)
    assert (run.status == Status.OK).all()
    late = np.abs(run.pose - run.target)[run.t >= 5.0]
    assert late.max() < 1e-2


def test_published_code_has_a_steady_state_error():
    """The steady-state error that the lateral gain removes: see ``unicycle_law``."""
    run = drive(unicycle_nmpc("published-code", DT), CORNER)
    error = (run.pose - run.target)[-1]
    np.testing.assert_allclose(run.command[-1], 0.0, atol=1e-6)
    assert 0.05 < np.hypot(error[0], error[1]) < 0.15


def test_command_keeps_the_limits_of_the_controls():
    run = drive(unicycle_nmpc("paper", DT), Hold(Pose(-4.0, 3.0, 3.0), 6.0))
    assert np.hypot(run.command[:, 0], run.command[:, 1]).max() <= 1.5 + 1e-12
    assert np.abs(run.command[:, 2]).max() <= 3.14


def test_published_speed_limit_follows_the_duration():
    for duration in (20.0, 30.0):
        problem = tracking_problem(
            PRESETS["published-code"],
            0.0,
            START,
            Hold(Pose(9.0, 9.0, 0.0), duration),
            horizon=15,
            dt=DT,
        )
        np.testing.assert_allclose(problem.limits, [15.0 / duration, 0.5 * np.pi])
        assert (problem.state_weights[-1] == 0.0).all()


def test_reset_clears_all_memory():
    controller = unicycle_nmpc("paper", DT)
    first, second = drive(controller, bend()), drive(controller, bend())
    np.testing.assert_array_equal(first.pose, second.pose)
    np.testing.assert_array_equal(first.command, second.command)


@pytest.mark.parametrize("turn", [1.0, 2.5, -3.0])
def test_commands_are_equivariant_under_rotation_of_the_world(turn):
    flat = drive(unicycle_nmpc("paper", DT), bend(), Pose(0.0, 0.1, 0.2))
    turned = drive(
        unicycle_nmpc("paper", DT),
        bend(turn),
        Pose(-0.1 * np.sin(turn), 0.1 * np.cos(turn), 0.2 + turn),
    )
    np.testing.assert_allclose(turned.command, flat.command, atol=1e-5)


@pytest.mark.parametrize("turns", [-2, 1, 7])
def test_full_turns_of_the_measured_yaw_have_no_effect(turns):
    pose = Pose(0.1, 0.1, 3.1)
    reference = Hold(Pose(0.5, 0.1, -3.1), 5.0)
    single = unicycle_nmpc("paper", DT).step(0.0, State(0.0, pose), reference)
    turned = unicycle_nmpc("paper", DT).step(
        0.0, State(0.0, pose._replace(yaw=pose.yaw + 2.0 * np.pi * turns)), reference
    )
    np.testing.assert_allclose(turned.twist, single.twist, atol=1e-6)


def test_headings_are_unwrapped_near_the_measured_yaw():
    headings = np.array([3.0, 3.1, -3.1, -3.0])
    moved = unwrap_near(headings, -3.2 + 4.0 * np.pi)
    np.testing.assert_allclose(np.diff(moved), [0.1, 2.0 * np.pi - 6.2, 0.1])
    assert moved[0] == pytest.approx(3.0 + 2.0 * np.pi)


def test_feedforward_is_signed_along_the_heading():
    forward = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.5]])
    np.testing.assert_allclose(finite_differences(forward, 0.1), [[5.0, 5.0]])
    back = np.array([[0.0, 0.0, np.pi], [0.5, 0.0, np.pi]])
    np.testing.assert_allclose(finite_differences(back, 0.1), [[-5.0, 0.0]])


def test_law_moves_along_the_first_predicted_heading():
    pose = Pose(1.0, 2.0, 0.3)
    problem = tracking_problem(PRESETS["paper"], 0.0, pose, CORNER, horizon=15, dt=DT)
    controls = np.tile([0.5, 2.0], (15, 1))
    plan = UnicycleSolution.of(problem, controls, 0, Exit.CAPPED)
    expected = to_body(WorldTwist(0.5 * np.cos(0.5), 0.5 * np.sin(0.5), 2.0), 0.3)
    np.testing.assert_allclose(unicycle_law(problem, plan, 0.0), expected, atol=1e-12)
    literal, corrected = unicycle_law(problem, plan, 0.0), unicycle_law(problem, plan, 1.0)
    assert corrected != literal
    assert np.hypot(*corrected[:2]) <= 1.5


def capped(cap):
    solver = UnicycleSolver(UnicycleSolverSettings(max_iterations=cap))
    return UnicycleController(DT, 15, PRESETS["paper"], solver)


def test_maximum_of_iterations_yields_a_fallback_command():
    run = drive(capped(1), CORNER)
    assert run.outcome is Outcome.FINISHED
    assert run.status[0] == Status.FALLBACK
    assert np.abs(run.pose - run.target)[-1].max() < 1e-2


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", ["x", "y", "yaw"])
def test_invalid_measurement_fails_without_affecting_later_steps(bad, part):
    controller = unicycle_nmpc("paper", DT)
    controller.reset(State(0.0, START))
    controller.step(0.0, State(0.0, START), CORNER)
    other = copy.copy(controller)
    command = controller.step(DT, State(DT, START._replace(**{part: bad})), CORNER)
    assert command[:2] == (BodyTwist(0.0, 0.0, 0.0), Status.FAILED)
    later = 2 * DT, State(2 * DT, START), CORNER
    assert controller.step(*later) == other.step(*later)


@pytest.mark.parametrize("far", [1e3, 1e9, 1e200])
def test_far_target_yields_a_finite_command(far):
    command = unicycle_nmpc("paper", DT).step(
        0.0, State(0.0, START), Hold(Pose(far, -far, 0.0), 10.0)
    )
    assert np.isfinite(command.twist).all()
    assert np.hypot(*command.twist[:2]) <= 1.5 + 1e-12


def test_nan_reference_fails():
    command = unicycle_nmpc("paper", DT).step(
        0.0, State(0.0, START), Hold(Pose(np.nan, 0.0, 0.0), 1.0)
    )
    assert command.status is Status.FAILED


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dt": 0.0}, "sample time"),
        ({"dt": float("nan")}, "sample time"),
        ({"horizon": 0}, "horizon"),
        ({"preset": PRESETS["paper"]._replace(speed_weight=-1.0)}, "speed_weight is -1"),
    ],
)
def test_invalid_settings_are_rejected(arguments, message):
    settings = {"preset": "paper", "dt": DT} | arguments
    with pytest.raises(InvalidInput, match=message):
        unicycle_nmpc(**settings)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"preset": "papre"}, "no preset 'papre'; there are paper, published-code"),
        ({"solver": "acados"}, "no solver 'acados'; there are sqp, rti, casadi"),
    ],
)
def test_unknown_names_are_rejected(arguments, message):
    unchecked = inspect.unwrap(unicycle_nmpc)  # without the run-time type checks of the tests
    with pytest.raises(InvalidInput, match=message):
        unchecked(**({"preset": "paper", "dt": DT} | arguments))


def test_controllers_with_both_solvers_agree():
    pytest.importorskip("casadi")
    ours = drive(unicycle_nmpc("paper", DT), bend())
    theirs = drive(unicycle_nmpc("paper", DT, solver="casadi"), bend())
    np.testing.assert_allclose(ours.pose, theirs.pose, atol=1e-5)
