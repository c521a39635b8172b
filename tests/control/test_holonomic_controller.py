"""Holonomic controller: tracking, compensation, fallback levels and deadlines."""

import subprocess
import sys
from dataclasses import replace
from inspect import unwrap
from math import exp

import numpy as np
import pytest

from omnidrive.control import HolonomicParameters, Status, holonomic_nmpc
from omnidrive.control.nmpc.holonomic import (
    Actuation,
    FallbackLevel,
    HolonomicSolver,
    HolonomicSolverSettings,
    KeepOutZone,
)
from omnidrive.control.nmpc.holonomic.law import OLD_PLAN_STEPS, RAMP_STEPS
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.estimation.drive_estimate import DriveSettings
from omnidrive.estimation.motion.acceleration_ratio import reached_share
from omnidrive.geometry import BodyTwist, Pose, move, twist_between, wrap
from omnidrive.reference import (
    Hold,
    MotionLimits,
    ShapeReference,
    limit_rows,
    shortest_duration_within,
)
from omnidrive.reference.shapes import Eight, Square
from omnidrive.robot import Chassis, named_robot
from omnidrive.robot.drive_model import DriveModel
from omnidrive.robot.slip_response import slip_response
from omnidrive.simulation import PlanarPlant, simulate
from omnidrive.testing.laws import Circle

DT = 0.1
CHASSIS = named_robot("small").chassis
INVALID = Pose(np.nan, 0.0, 0.0)


def started(horizon=15):
    controller = holonomic_nmpc(CHASSIS, DT, horizon)
    start = Circle().at(0.0).pose
    controller.reset(State(0.0, start))
    return controller, controller.step(0.0, State(0.0, start), Circle())


def fallback_level(command):
    return FallbackLevel(int(command.details[0]))


def test_robot_on_the_reference_stays_on_it():
    controller, command = started()
    assert command.status is Status.OK
    assert fallback_level(command) is FallbackLevel.CONVERGED
    after = move(Circle().at(0.0).pose, command.twist, DT)
    assert np.allclose(after, Circle().at(DT).pose, atol=1e-9)
    assert controller.solution.residual < 1e-6


def test_controller_with_reduced_drive_continues_its_state():
    robot = named_robot("small")
    usual = Actuation.of(robot)
    controller = holonomic_nmpc(CHASSIS, DT, actuation=usual)
    controller.reset(State(0.0, Circle().at(0.0).pose))
    for k in range(5):
        controller.step(DT * k, State(DT * k, Circle().at(DT * k).pose), Circle())
    left = ReducedDrive.of(robot, {2})
    same = controller.with_reduced_drive(ReducedDrive.of(robot, ()))
    fewer = controller.with_reduced_drive(left)
    at = 0.5, State(0.5, Circle().at(0.5).pose), Circle()
    command = controller.step(*at)
    assert same.step(*at) == command
    far = Hold(Pose(9.0, 0.0, 0.0), 9.0)
    hurried = fewer.step(0.6, State(0.6, Circle().at(0.6).pose), far).twist
    twist = np.array(fewer.motion.twist)
    first, second = (Pose(*row) for row in fewer.solution.states[:2].tolist())
    planned = np.array(twist_between(first, second, DT))
    used = np.abs(left.acceleration_faces @ (planned - twist)).max()
    assert 0.9 * usual.traction * DT <= used <= DT * (1.0 + 1e-6)  # friction of three wheels
    assert np.isfinite(hurried).all()


def test_lost_measurements_descend_the_fallback_levels():
    controller, _ = started()
    planned = controller.solution
    commands = [
        controller.step(DT * k, State(DT * k, INVALID), Circle())
        for k in range(1, OLD_PLAN_STEPS + RAMP_STEPS + 2)
    ]
    levels = [fallback_level(each) for each in commands]
    assert levels == [FallbackLevel.OLD_PLAN] * OLD_PLAN_STEPS + [
        FallbackLevel.RAMP
    ] * RAMP_STEPS + [FallbackLevel.STOP]
    speeds = [np.hypot(each.twist.vx, each.twist.vy) for each in commands]
    assert np.all(np.diff(speeds[OLD_PLAN_STEPS - 1 :]) < 0.0)
    assert commands[-1].status is Status.FAILED
    assert commands[-1].twist == BodyTwist(0.0, 0.0, 0.0)
    assert [each.status for each in commands[:-1]] == [Status.FALLBACK] * (
        OLD_PLAN_STEPS + RAMP_STEPS
    )
    first = move(Pose(*planned.states[1]), commands[0].twist, DT)
    assert np.allclose(first, planned.states[2], atol=1e-9)


def test_invalid_measurement_is_a_missing_one():
    """The observed motion goes on as predicted, and the next measurement corrects it."""
    controller, _ = started()
    controller.step(DT, State(DT, INVALID), Circle())
    pose = Circle().at(2 * DT).pose
    controller.step(2 * DT, State(2 * DT, pose), Circle())
    observed = controller.motion
    assert np.allclose(observed.pose, pose, atol=1e-6)
    expected = twist_between(Circle().at(DT).pose, pose, DT)
    assert np.allclose(observed.twist, expected, atol=1e-3)


def test_lost_measurement_stops_the_robot_if_the_plan_is_too_short():
    controller, _ = started(horizon=1)
    assert fallback_level(controller.step(DT, State(DT, INVALID), Circle())) is FallbackLevel.STOP


def test_plan_at_maximum_of_iterations_is_feasible_and_reported():
    controller, _ = started()
    controller.solver = HolonomicSolver(HolonomicSolverSettings(max_iterations=2))
    command = controller.step(0.0, State(0.0, Pose(40.0, -30.0, 2.0)), Circle())
    assert fallback_level(command) is FallbackLevel.FEASIBLE
    assert command.status is Status.FALLBACK
    assert np.abs(CHASSIS.wheel_speeds(command.twist)).max() <= CHASSIS.max_wheel_speed


@pytest.mark.parametrize("far", [3.0, 1e3, 1e5])
def test_far_target_is_approached_at_the_wheel_speed_limit(far):
    command = holonomic_nmpc(CHASSIS, DT).step(
        0.0, State(0.0, Pose(0.0, 0.0, 0.3)), Hold(Pose(far, 0, 0), 9.0)
    )
    speeds = np.abs(CHASSIS.wheel_speeds(command.twist))
    assert speeds.max() == pytest.approx(CHASSIS.max_wheel_speed, rel=5e-3)
    assert speeds.max() <= CHASSIS.max_wheel_speed * (1 + 1e-6)


@pytest.mark.parametrize(("lag", "delay"), [(0.1, 0.25), (0.03, 0.05), (0.0, 0.2), (0.1, 0.0)])
def test_lag_and_delay_are_compensated(lag, delay):
    """The plant is the model: a delay of some steps, then a lag."""
    controller = holonomic_nmpc(CHASSIS, DT, actuation=Actuation(lag=(lag, lag), delay=delay))
    reference = Circle()
    pose, twist, errors = reference.at(0.0).pose, np.zeros(3), []
    controller.reset(State(0.0, pose))
    commanded, whole = [np.zeros(3)] * 5, int(delay / DT)
    for k in range(60):
        commanded.append(np.array(controller.step(k * DT, State(k * DT, pose), reference).twist))
        part = delay - whole * DT
        for command, h in ((commanded[-2 - whole], part), (commanded[-1 - whole], DT - part)):
            for _ in range(20 if h > 0.0 else 0):
                left = exp(-h / 20 / lag) if lag else 0.0
                mean = command + (twist - command) * (20 * lag / h * (1.0 - left))
                twist = command + (twist - command) * left
                pose = move(pose, BodyTwist(*mean.tolist()), h / 20)
        errors.append(np.hypot(*np.subtract(pose[:2], reference.at((k + 1) * DT).pose[:2])))
    assert max(errors[40:]) < 1e-7


def test_standing_target_is_approached_on_a_line_within_the_limits():
    robot = named_robot("small")
    controller = holonomic_nmpc(
        robot.chassis, DT, actuation=Actuation(acceleration_faces=robot.acceleration_faces)
    )
    controller.reset(State(0.0, Pose(0.0, 0.0, 0.0)))
    goal, pose, twists = np.array([1.0, 0.5, 1.0]), Pose(0.0, 0.0, 0.0), [np.zeros(3)]
    shares = []
    for k in range(20):
        command = controller.step(k * DT, State(k * DT, pose), Hold(Pose(*goal.tolist()), 9.0))
        twists.append(np.array(command.twist))
        pose = move(pose, command.twist, DT)
        shares.append(np.array(pose) / goal)
    used = np.abs(np.diff(twists, axis=0) / DT @ robot.acceleration_faces.T)
    assert used.max() < 1.0 + 1e-6
    assert used[:4].max() > 0.8
    assert np.ptp(shares, axis=1).max() < 0.05  # all coordinates arrive together
    assert np.max(shares) < 1.01
    assert np.allclose(pose, goal, atol=1e-3)


def test_reference_that_ends_in_motion_is_followed_to_its_end():
    """At 0.9 m/s the robot needs 0.2 s to stop; once the reference stands, it returns."""
    robot, circle = named_robot("small"), Circle(duration=7.0)
    faces = 2.0 * robot.acceleration_faces
    controller = holonomic_nmpc(CHASSIS, DT, actuation=Actuation(acceleration_faces=faces))
    pose, errors = circle.at(0.0).pose, []
    controller.reset(State(0.0, pose))
    for k in range(100):
        twist = controller.step(k * DT, State(k * DT, pose), circle).twist
        pose = move(pose, twist, DT)
        target = circle.at((k + 1) * DT).pose
        errors.append(
            max(np.hypot(*np.subtract(pose[:2], target[:2])), abs(wrap(pose.yaw - target.yaw)))
        )
    assert max(errors[20:70]) < 1e-6
    assert max(errors[70:75]) > 0.05
    assert max(errors[-5:]) < 1e-3


@pytest.mark.parametrize(("name", "overshoot"), [("paper", 0.05), ("mecanum", 0.06)])
def test_turn_overshoots_little_with_late_commands(name, overshoot):
    """The plant is the slip model with commands that are one sample later than it tells."""
    robot, dt, target = named_robot(name), 0.1, 0.8
    controller = holonomic_nmpc(robot.chassis, dt, actuation=Actuation.of(robot))
    model, yaws = DriveModel.of(robot), []
    pose, twist, late = Pose(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    controller.reset(State(0.0, pose))
    for k in range(40):
        command = controller.step(dt * k, State(dt * k, pose), Hold(Pose(0.0, 0.0, target), 9.0))
        mean, twist = slip_response(model, twist, late, dt)
        pose, late = move(pose, BodyTwist(*mean), dt), tuple(command.twist)
        yaws.append(pose.yaw)
    assert max(yaws) < (1.0 + overshoot) * target
    assert abs(yaws[-1] - target) < 0.05 * target


@pytest.mark.parametrize("friction", [1.0, 0.4])
def test_step_does_not_overshoot_on_a_slippery_floor(friction):
    """The plant is the slip model with another friction limit, which the controller observes."""
    robot = named_robot("small")
    controller = holonomic_nmpc(robot.chassis, 0.05, actuation=Actuation.of(robot))
    model = DriveModel.of(robot)
    model = model._replace(max_force=friction * model.max_force)
    pose, twist, path = Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), []
    controller.reset(State(0.0, pose))
    for k in range(60):
        command = controller.step(0.05 * k, State(0.05 * k, pose), Hold(Pose(1.0, 0.0, 0.0), 9.0))
        mean, final = slip_response(model, tuple(twist), tuple(command.twist), 0.05)
        pose, twist = move(pose, BodyTwist(*mean), 0.05), BodyTwist(*final)
        path.append(pose.x)
    assert max(path) < (1.005 if friction == 1.0 else 1.05)
    assert abs(path[-1] - 1.0) < 1e-3
    reached = reached_share(controller._memory.motion.state[0])
    assert reached > 0.9 if friction == 1.0 else 0.3 <= reached < 0.6


@pytest.mark.parametrize("moving", [False, True])
def test_keep_out_zone_on_the_path_is_avoided(moving):
    speed = np.array([0.0, 0.2 if moving else 0.0])

    def ahead(t, points, dt):
        times = t + dt * np.arange(points)
        return [KeepOutZone(np.array([1.0, 0.02]) + (times[:, None] - 2.0) * speed, 0.4)]

    fixed = [KeepOutZone(np.array([1.0, 0.02]), 0.4)]
    controller = holonomic_nmpc(CHASSIS, DT, 30, keep_outs=ahead if moving else fixed)
    pose = Pose(0.0, 0.0, 0.0)
    controller.reset(State(0.0, pose))
    nearest, statuses = np.inf, set()
    for k in range(60):
        command = controller.step(k * DT, State(k * DT, pose), Hold(Pose(2.0, 0.0, 0.0), 9.0))
        statuses.add(command.status)
        pose = move(pose, command.twist, DT)
        centre = np.array([1.0, 0.02]) + ((k + 1) * DT - 2.0) * speed
        nearest = min(nearest, np.hypot(*(np.array(pose[:2]) - centre)))
    assert nearest > 0.36  # a soft constraint of 0.4, against the cost of a target 1 m behind it
    assert statuses == {Status.OK}
    assert np.allclose(pose, (2.0, 0.0, 0.0), atol=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.001, 0.01])
def test_plans_stay_on_one_side_of_a_zone_in_the_middle_of_the_way(offset):
    """Both sides cost nearly the same, in another order at every sample."""

    class Straight:
        duration = 100.0

        def window(self, t, n, dt):
            rows = np.zeros((n, 6))
            rows[:, 0], rows[:, 3] = 0.6 * (t + dt * np.arange(n)), 0.6
            return rows

    kiwi, pose, dt = named_robot("kiwi"), Pose(0.0, offset, 0.0), 0.05
    controller = holonomic_nmpc(
        kiwi.chassis,
        dt,
        actuation=Actuation.of(kiwi),
        keep_outs=[KeepOutZone(np.array([1.2, 0.0]), 0.35)],
        governor=False,
    )
    controller.reset(State(0.0, pose))
    sides = []
    for k in range(70):
        command = controller.step(k * dt, State(k * dt, pose), Straight())
        beside = controller.solution.states[np.abs(controller.solution.states[:, 0] - 1.2) < 0.1]
        sides += np.sign(beside[np.abs(beside[:, 1]) > 0.05, 1]).tolist()
        pose = move(pose, command.twist, dt)
    assert len(sides) > 15
    assert len(set(sides)) == 1


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("turns", [0.0, 2 * np.pi, -4 * np.pi])
def test_circle_is_tracked_across_the_jump_of_the_heading(sense, turns):
    """The reference's heading jumps from pi to -pi, the measured one does not."""

    class Wrapped(Circle):
        def window(self, t, n, dt):
            rows = np.array(
                [[*self.at(t + k * dt).pose, *self.at(t + k * dt).twist] for k in range(n)]
            )
            rows[:, 2] = wrap(sense * rows[:, 2])
            return rows * [1.0, sense, 1.0, 1.0, sense, sense]

    reference, controller = Wrapped(), holonomic_nmpc(CHASSIS, DT)
    pose = Pose(*reference.window(0.0, 1, DT)[0, :3].tolist())
    pose = pose._replace(yaw=pose.yaw + turns)
    controller.reset(State(0.0, pose))
    for k in range(80):
        command = controller.step(k * DT, State(k * DT, pose), reference)
        assert command.status is Status.OK
        pose = move(pose, command.twist, DT)
        x, y, yaw = reference.window((k + 1) * DT, 1, DT)[0, :3]
        assert np.hypot(pose.x - x, pose.y - y) < 1e-6
        assert abs(wrap(pose.yaw - yaw)) < 1e-6


def test_expired_deadline_yields_a_feasible_plan():
    solver = HolonomicSolver(deadline=0.0)
    controller = holonomic_nmpc(CHASSIS, DT, solver=solver)
    command = controller.step(0.0, State(0.0, Pose(40.0, -30.0, 2.0)), Circle())
    assert fallback_level(command) is FallbackLevel.FEASIBLE
    assert command.status is Status.FALLBACK
    assert np.abs(CHASSIS.wheel_speeds(command.twist)).max() <= CHASSIS.max_wheel_speed


LOADED = """
import omnidrive as od
from omnidrive.control.nmpc.holonomic import active_set, interior_point
chassis = od.named_robot("small").chassis
od.holonomic_nmpc(chassis, 0.02, {horizon}, solver=od.HolonomicSolver(deadline=1e-3))
print(*(bool(f.signatures) for f in (
    active_set.solve_active_set, interior_point.initialize, interior_point.iterate
)))
"""


@pytest.mark.parametrize("horizon", [pytest.param(1, marks=pytest.mark.long), 15])
def test_solver_with_deadline_is_compiled_before_the_first_step(horizon):
    code = LOADED.format(horizon=horizon)
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True"] * 3


def test_commands_agree_with_ipopt():
    pytest.importorskip("casadi")
    pose = Pose(0.3, -0.2, 0.5)
    own = holonomic_nmpc(CHASSIS, DT).step(0.0, State(0.0, pose), Circle())
    ipopt = holonomic_nmpc(CHASSIS, DT, solver="casadi").step(0.0, State(0.0, pose), Circle())
    assert np.allclose(own.twist, ipopt.twist, atol=1e-5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"dt": 0.0}, "the sample time is 0 s, need 1e-09 to 3600 s"),
        ({"horizon": 0}, "the horizon must be 1 to 1000 stages, got 0"),
        ({"horizon": 10**9}, "the horizon must be 1 to 1000 stages, got 1000000000"),
        ({"parameters": HolonomicParameters(position_weight=-1.0)}, "position_weight"),
        ({"parameters": HolonomicParameters(velocity_weight=0.0)}, "velocity_weight"),
    ],
)
def test_invalid_arguments_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        holonomic_nmpc(**{"chassis": CHASSIS, "dt": DT, **settings})


@pytest.mark.parametrize("value", [-0.1, np.nan, np.inf])
def test_negative_lag_or_delay_is_rejected(value):
    for name, given in (("lag", (0.1, value)), ("delay", value)):
        with pytest.raises(InvalidInput, match=f"the {name} must not be negative, got"):
            Actuation(**{name: given})


def test_chassis_that_is_not_holonomic_is_rejected():
    wheels = np.array([[20.0, 0.0, 5.0], [20.0, 0.0, -5.0]])  # a differential drive
    with pytest.raises(InvalidInput, match="rank 2, need 3"):
        Chassis(wheels, 50.0)


def test_unknown_solver_is_rejected():
    with pytest.raises(InvalidInput, match="no solver 'acados'; there are sqp, rti, casadi"):
        unwrap(holonomic_nmpc)(CHASSIS, DT, solver="acados")


def test_rti_plan_is_feasible_and_nearly_optimal():
    """Without active limits it is optimal."""
    near, far = Circle().at(0.0).pose, Pose(0.3, -0.2, -1.5)
    quick, full = holonomic_nmpc(CHASSIS, DT, solver="rti"), holonomic_nmpc(CHASSIS, DT)
    assert quick.step(0.0, State(0.0, near), Circle()) == full.step(0.0, State(0.0, near), Circle())
    command = quick.step(0.0, State(0.0, far), Circle())
    full.step(0.0, State(0.0, far), Circle())
    assert fallback_level(command) is FallbackLevel.FEASIBLE
    assert quick.solution.violation <= 0.0
    assert full.solution.cost < quick.solution.cost < 1.5 * full.solution.cost


def test_commands_keep_the_wheel_speed_limit_at_long_sample_times():
    """Also where a plan from a fast start exceeds it, because braking within the limit is too hard.

    Without limiting the command, that of step 39 exceeds it by 8e-7.
    """
    robot, rng = named_robot("paper"), np.random.default_rng(0)
    actuation = Actuation(robot.acceleration_faces / 0.85)
    controller = holonomic_nmpc(robot.chassis, 1.0, actuation=actuation)
    for k in range(45):
        pose = Pose(*(rng.normal(size=3) * [30.0, 30.0, 3.0]).tolist())
        twist = controller.step(float(k), State(float(k), pose), Circle()).twist
        most = np.abs(robot.chassis.wheel_speeds(twist)).max()
        assert most <= robot.max_wheel_speed * (1.0 + 1e-12)


def drive_controller(robot, dt, adaptation, **known):
    actuation = Actuation.of(replace(robot, **known))
    return holonomic_nmpc(robot.chassis, dt, actuation=actuation, adaptation=adaptation)


def mean_error(robot, controller, **changes):
    """Mean error on a figure eight after 3 s, m; the plant differs from the robot."""
    reference = ShapeReference(Eight(), 12.0)
    start = reference.at(0.0).pose
    plant = PlanarPlant(replace(robot, **changes))
    run = simulate(plant, controller, reference, start=start, dt=0.05)
    difference = (run.pose - run.target)[run.t > 3.0]
    return np.hypot(difference[:, 0], difference[:, 1]).mean()


@pytest.mark.parametrize(
    ("changes", "most"),
    [({"motor_lag": 0.08}, 0.3), ({"drive_gain": (0.95, 0.95, 0.9)}, 0.4), ({}, 1.0)],
)
def test_what_is_identified_is_compensated(changes, most):
    robot = named_robot("small")
    fixed = mean_error(robot, drive_controller(robot, 0.05, False), **changes)
    adaptive = drive_controller(robot, 0.05, DriveSettings())
    assert mean_error(robot, adaptive, **changes) <= most * fixed
    assert adaptive.drive.lag == pytest.approx(changes.get("motor_lag", 0.0), abs=0.01)
    assert adaptive.drive.gains[0] == pytest.approx(changes.get("drive_gain", [1.0])[0], abs=0.01)


def test_a_known_drive_is_compensated_without_adaptation():
    robot, changes = named_robot("small"), {"motor_lag": 0.08, "drive_gain": (0.95, 0.95, 0.9)}
    known = drive_controller(robot, 0.05, False, **changes)
    unknown = drive_controller(robot, 0.05, False)
    assert mean_error(robot, known, **changes) < 0.2 * mean_error(robot, unknown, **changes)


def test_an_approach_at_the_friction_limit_is_no_evidence_of_a_gain():
    """With a friction that is lower than known, the missing acceleration looks like a gain."""
    robot = named_robot("small")
    plant = PlanarPlant(replace(robot, friction=0.4 * robot.friction))
    controller = drive_controller(robot, 0.02, DriveSettings())
    start = Pose(0.0, 0.0, 0.0)
    run = simulate(plant, controller, Hold(Pose(1.0, 0.0, 0.0), 0.6), start=start, dt=0.02)
    assert 0.1 < run.pose[-1, 0] < 0.7  # the robot is on its way
    assert controller.drive.gains[0] == 1.0
    assert controller.drive.lag + controller.drive.delay == 0.0


def test_a_reset_forgets_what_was_identified():
    robot = named_robot("small")
    controller = drive_controller(robot, 0.05, DriveSettings())
    first = mean_error(robot, controller, motor_lag=0.08)
    assert controller.drive.lag > 0.05
    assert mean_error(robot, controller, motor_lag=0.08) == first


def test_adaptation_with_bounds_that_exclude_the_robot_is_refused():
    with pytest.raises(InvalidInput, match="the lag before adaptation"):
        drive_controller(named_robot("small"), 0.05, DriveSettings(max_lag=0.1), motor_lag=0.2)


def test_plans_keep_to_the_acceleration_that_a_slippery_floor_gives():
    """With those of the known friction the mean errors are 287 mm and 164 mrad."""
    robot = named_robot("small")
    reference = ShapeReference(Square(), 14.0)
    limits = limit_rows(robot.chassis, MotionLimits.of_robot(robot, share=0.7))
    reference = ShapeReference(Square(), shortest_duration_within(reference, limits))
    plant = PlanarPlant(replace(robot, friction=0.25 * robot.friction))
    controller = drive_controller(robot, 0.05, DriveSettings())
    run = simulate(plant, controller, reference, start=reference.at(0.0).pose, dt=0.05)
    apart = (run.pose - run.target)[run.t > 3.0]
    assert np.hypot(apart[:, 0], apart[:, 1]).mean() < 0.2
    assert np.abs(apart[:, 2]).mean() < 0.15
