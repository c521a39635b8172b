"""The holonomic controller: what it does when it cannot do what it should."""

from inspect import unwrap

import numpy as np
import pytest

from omnidrive.control import HolonomicParameters, Status, holonomic_nmpc
from omnidrive.control.nmpc.holonomic import HolonomicSolver, InteriorSettings, Rung
from omnidrive.control.nmpc.holonomic.controller import FOLLOWED, RAMP
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from tests.laws.motions import Circle

DT = 0.1
CHASSIS = named_robot("small").chassis
NOWHERE = Pose(np.nan, 0.0, 0.0)


def started(horizon=15):
    controller = holonomic_nmpc(CHASSIS, DT, horizon)
    start = Circle().at(0.0).pose
    controller.reset(start)
    return controller, controller.step(0.0, start, Circle())


def rung(command):
    return Rung(int(command.details[0]))


def test_a_robot_on_the_reference_stays_on_it():
    controller, command = started()
    assert command.status is Status.OK
    assert rung(command) is Rung.CONVERGED
    after = move(Circle().at(0.0).pose, command.twist, DT)
    assert np.allclose(after, Circle().at(DT).pose, atol=1e-9)
    assert controller.solution.residual < 1e-6


def test_a_lost_measurement_is_bridged_by_the_old_plan_then_by_a_ramp_then_refused():
    controller, _ = started()
    planned = controller.solution
    commands = [controller.step(DT * k, NOWHERE, Circle()) for k in range(1, FOLLOWED + RAMP + 2)]
    rungs = [rung(each) for each in commands]
    assert rungs == [Rung.OLD_PLAN] * FOLLOWED + [Rung.RAMP] * RAMP + [Rung.STOP]
    speeds = [np.hypot(each.twist.vx, each.twist.vy) for each in commands]
    assert np.all(np.diff(speeds[FOLLOWED - 1 :]) < 0.0)
    assert commands[-1].status is Status.FAILED
    assert commands[-1].twist == BodyTwist(0.0, 0.0, 0.0)
    assert [each.status for each in commands[:-1]] == [Status.FALLBACK] * (FOLLOWED + RAMP)
    first = move(Pose(*planned.states[1]), commands[0].twist, DT)
    assert np.allclose(first, planned.states[2], atol=1e-9)


def test_one_bad_measurement_spoils_no_later_step():
    controller, _ = started()
    controller.step(DT, NOWHERE, Circle())
    pose = Circle().at(2 * DT).pose
    fresh = holonomic_nmpc(CHASSIS, DT)
    assert controller.step(2 * DT, pose, Circle()) == fresh.step(2 * DT, pose, Circle())


def test_a_horizon_too_short_to_bridge_stops():
    controller, _ = started(horizon=1)
    assert rung(controller.step(DT, NOWHERE, Circle())) is Rung.STOP


def test_a_capped_plan_keeps_the_limits_and_says_so():
    controller, _ = started()
    controller.solver = HolonomicSolver(InteriorSettings(max_iterations=2))
    command = controller.step(0.0, Pose(40.0, -30.0, 2.0), Circle())
    assert rung(command) is Rung.FEASIBLE
    assert command.status is Status.FALLBACK
    assert np.abs(CHASSIS.wheel_speeds(command.twist)).max() <= CHASSIS.max_wheel_speed


@pytest.mark.parametrize("far", [3.0, 1e3, 1e6])
def test_a_target_far_away_is_approached_at_full_speed_within_the_limits(far):
    command = holonomic_nmpc(CHASSIS, DT).step(0.0, Pose(0.0, 0.0, 0.3), Hold(Pose(far, 0, 0), 9.0))
    speeds = np.abs(CHASSIS.wheel_speeds(command.twist))
    assert speeds.max() == pytest.approx(CHASSIS.max_wheel_speed, rel=5e-3)
    assert speeds.max() <= CHASSIS.max_wheel_speed * (1 + 1e-6)


def test_ipopt_drives_alike():
    pytest.importorskip("casadi")
    pose = Pose(0.3, -0.2, 0.5)
    ours = holonomic_nmpc(CHASSIS, DT).step(0.0, pose, Circle())
    theirs = holonomic_nmpc(CHASSIS, DT, solver="casadi").step(0.0, pose, Circle())
    assert np.allclose(ours.twist, theirs.twist, atol=1e-5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"dt": 0.0}, "the sample time must be positive, got 0 s"),
        ({"horizon": 0}, "the horizon must be at least 1 stage, got 0"),
        ({"parameters": HolonomicParameters(position_weight=-1.0)}, "position_weight"),
    ],
)
def test_bad_arguments_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        holonomic_nmpc(**{"chassis": CHASSIS, "dt": DT, **settings})


def test_a_solver_that_is_none_is_refused():
    with pytest.raises(InvalidInput, match="no solver 'acados'; there are sqp, casadi"):
        unwrap(holonomic_nmpc)(CHASSIS, DT, solver="acados")
