"""Commands of wheel speeds and torques in plants, the loop and its log."""

from dataclasses import replace

import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, Status, WheelSpeeds, WheelTorques
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold
from omnidrive.robot import ROBOTS, named_robot
from omnidrive.simulation import (
    Disturbances,
    KinematicPlant,
    Motor,
    MujocoPlant,
    Outcome,
    PlanarPlant,
    PlantState,
    Saturation,
    Schedule,
    parse_fault,
    simulate,
)
from omnidrive.simulation.planar.model import mass_matrix, planar_model
from omnidrive.testing.laws import Circle

ORIGIN, DT = Pose(0.0, 0.0, 0.0), 0.1
SMALL = named_robot("small")
TORQUE_PLANTS = {
    "planar": PlanarPlant,
    "ball": lambda robot: MujocoPlant(robot, "ball"),
    "rollers": lambda robot: MujocoPlant(robot, "rollers"),
}
every_torque_plant = pytest.mark.parametrize("make", TORQUE_PLANTS.values(), ids=TORQUE_PLANTS)
AHEAD = WheelTorques(0.3 * np.sign(SMALL.chassis.jacobian[:, 0]))


@pytest.mark.parametrize("plant", ["planar", "ball"])
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("motor_lag", [0.0, 0.3])
def test_torques_accelerate_by_their_wrench_over_the_inertia(plant, name, axis, motor_lag):
    """Newton's law with the wheels' inertia: ``(M + J^T I J) a = J^T torques``."""
    robot = replace(named_robot(name), friction=3.0, motor_lag=motor_lag)
    model, jacobian = planar_model(robot, Disturbances()), robot.chassis.jacobian
    inertia = mass_matrix(model.body) + jacobian.T * model.wheels["inertia"] @ jacobian
    wrench = 0.3 * robot.inertia * np.eye(3)[axis]
    torques = np.linalg.pinv(jacobian.T) @ wrench
    simulated = TORQUE_PLANTS[plant](robot)
    simulated.reset(ORIGIN)
    if plant == "planar":  # rollers of hardly any mass, in one row
        simulated._model.wheels["roller_mass"], simulated._model.wheels["row_offset"] = 1e-9, 0.0
    before, after = (simulated.step(WheelTorques(torques), 0.1) for _ in range(2))
    acceleration = np.subtract(after.twist, before.twist) / 0.1
    expected = np.linalg.solve(inertia, wrench)
    assert acceleration == pytest.approx(expected, abs=0.01 * np.abs(expected).max())
    assert after.wheel_torques == pytest.approx(torques)
    assert after.saturated == Saturation.NONE


@every_torque_plant
def test_torque_above_the_limit_is_limited_and_reported(make):
    plant = make(replace(SMALL, friction=3.0))
    plant.reset(ORIGIN)
    state = plant.step(WheelTorques([9.0, -9.0, 0.1, -0.1]), 0.01)
    assert state.wheel_torques == pytest.approx([2.0, -2.0, 0.1, -0.1])
    assert state.saturated & Saturation.TORQUE


@every_torque_plant
def test_torque_falls_to_zero_at_the_largest_wheel_speed(make):
    plant = make(SMALL)
    plant.reset(ORIGIN)
    for _ in range(60):
        state = plant.step(AHEAD, DT)
    assert np.abs(state.wheel_speeds) == pytest.approx([SMALL.max_wheel_speed] * 4, rel=0.01)
    assert np.abs(state.wheel_torques).max() < 0.1
    assert state.saturated & Saturation.WHEEL_SPEED


@every_torque_plant
def test_torques_make_wheels_slip_at_low_friction(make):
    plant = make(replace(SMALL, friction=0.05))
    plant.reset(ORIGIN)
    gentle = plant.step(WheelTorques(0.1 * np.array(AHEAD)), DT)
    assert gentle.saturated == Saturation.NONE
    assert plant.step(AHEAD, DT).saturated == Saturation.FRICTION


@every_torque_plant
@pytest.mark.parametrize("motor_lag", [0.0, 0.2])
def test_torques_leave_no_trace_in_later_runs(make, motor_lag):
    robot, twist = replace(SMALL, motor_lag=motor_lag), BodyTwist(0.3, 0.1, 0.2)
    plant = make(robot)
    plant.reset(ORIGIN)
    fresh = [plant.step(twist, DT) for _ in range(5)]
    plant.reset(ORIGIN)
    plant.step(AHEAD, DT)
    plant.reset(ORIGIN)
    assert repr([plant.step(twist, DT) for _ in range(5)]) == repr(fresh)


@every_torque_plant
@pytest.mark.parametrize("motor_lag", [0.0, 0.2])
def test_servos_start_from_the_present_speeds_after_torques(make, motor_lag):
    plant = make(replace(SMALL, motor_lag=motor_lag))
    plant.reset(ORIGIN)
    before = [plant.step(AHEAD, DT) for _ in range(3)][-1]
    after = plant.step(before.twist, 0.02)
    assert np.array(after.twist) == pytest.approx(before.twist, abs=0.03)
    assert np.abs(after.wheel_torques).max() < 0.3
    assert plant.step(BodyTwist(0.0, 0.0, 0.0), 3.0).twist == pytest.approx((0, 0, 0), abs=0.01)


@every_torque_plant
def test_faulty_motors_under_torques(make):
    plant = make(SMALL)
    plant.reset(ORIGIN)
    plant.step(AHEAD, DT)
    plant.apply(Disturbances((Motor.DEAD, Motor.LOCKED, Motor.WEAK, Motor.HEALTHY)))
    state = plant.step(WheelTorques([0.5, 0.5, 1.5, 1.5]), 0.02)
    assert state.wheel_torques == pytest.approx([0.0, 0.5, 1.0, 1.5])
    assert abs(state.wheel_speeds[1]) < 0.01
    plant.apply(Disturbances())
    assert plant.step(AHEAD, 0.02).wheel_torques == pytest.approx(AHEAD)


class Constant:
    """A controller that returns a constant command."""

    def __init__(self, value):
        self.value = value

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return Command(self.value)


class Wheels(FeedforwardController):
    """Feedforward control whose twists are converted to wheel speeds."""

    def step(self, t, state, reference):
        twist = super().step(t, state, reference).value
        return Command(WheelSpeeds(SMALL.chassis.wheel_speeds(twist)))


def run(controller, plant=None, *faults, reference=None, supervisor=None):
    reference = reference or Circle(duration=4.0)
    return simulate(
        plant or PlanarPlant(SMALL),
        controller,
        reference,
        start=reference.at(0.0).pose,
        dt=DT,
        supervisor=supervisor,
        schedule=Schedule(tuple(map(parse_fault, faults)), SMALL) if faults else None,
    )


@pytest.mark.parametrize("supervised", [False, True])
@pytest.mark.parametrize(
    "make",
    [
        KinematicPlant,
        TORQUE_PLANTS["planar"],
        *(
            pytest.param(TORQUE_PLANTS[name], marks=pytest.mark.long)
            for name in ("ball", "rollers")
        ),
    ],
)
def test_controller_of_wheel_speeds_drives_as_one_of_twists(make, supervised):
    supervisor = make_supervisor() if supervised else None
    twists = run(FeedforwardController(DT), make(SMALL))
    wheels = run(Wheels(DT), make(SMALL), supervisor=supervisor)
    assert wheels.pose == pytest.approx(twists.pose, abs=1e-9)
    assert wheels.events == ()
    commanded = twists.command[:-1] @ SMALL.chassis.jacobian.T
    assert wheels.wheel_speed_command[:-1] == pytest.approx(commanded, abs=1e-7)
    assert np.isnan(wheels.command[:-1]).all()
    assert twists.wheel_speed_command.shape == (len(twists.t), 0)


def test_log_holds_wheel_speeds_torques_and_limits():
    log = run(Constant(AHEAD), reference=Hold(ORIGIN, 1.0))
    assert log.outcome is Outcome.FINISHED
    assert log.wheel_torque_command[:-1] == pytest.approx(np.tile(AHEAD, (10, 1)))
    assert np.isnan(log.wheel_torque_command[-1]).all()  # the last row has no command
    assert log.wheel_torque[1:] == pytest.approx(np.tile(AHEAD, (10, 1)))
    assert not log.wheel_torque[0].any()
    assert (np.diff(np.abs(log.wheel_speed), axis=0) > 0.0).all()
    assert not log.saturated.any()
    start = run(Constant(BodyTwist(9.0, 0.0, 0.0)), reference=Hold(ORIGIN, 1.0))
    everything = Saturation.WHEEL_SPEED | Saturation.TORQUE | Saturation.FRICTION
    assert start.saturated[:2].tolist() == [0, everything]


def test_columns_of_the_log_have_units():
    log = run(Constant(AHEAD), reference=Hold(ORIGIN, 1.0))
    units = {column.name: column.unit for column in log.columns}
    for i in range(4):
        assert units[f"wheel_speed_{i}"] == "rad/s"
        assert units[f"wheel_torque_{i}"] == units[f"command_wheel_torque_{i}"] == "N m"
    assert units["saturated"] == "1"
    assert "command_wheel_speed_0" not in units
    kinematic = [
        column.name for column in run(FeedforwardController(DT), KinematicPlant(SMALL)).columns
    ]
    assert "wheel_speed_3" in kinematic
    assert "wheel_torque_0" not in kinematic


class TwistsOnly:
    """A plant without wheel commands."""

    capabilities = KinematicPlant(SMALL).capabilities._replace(wheel_speeds=False)

    def reset(self, pose):
        return PlantState(pose, BodyTwist(0.0, 0.0, 0.0), 0.0)

    def step(self, command, dt):
        raise AssertionError

    close = reset


@pytest.mark.parametrize(
    ("plant", "value", "reason"),
    [
        (KinematicPlant(SMALL), AHEAD, "this plant does not execute wheel torques: command a Body"),
        (TwistsOnly(), WheelSpeeds([1.0]), "this plant does not execute wheel speeds: command a B"),
        (PlanarPlant(SMALL), WheelTorques([1.0] * 3), "holds 3 wheel torques, but the robot has 4"),
        (PlanarPlant(SMALL), WheelSpeeds([]), "holds 0 wheel speeds, but the robot has 4"),
        (PlanarPlant(SMALL), WheelSpeeds([np.nan] * 4), "its wheel speeds are not finite"),
    ],
)
@pytest.mark.parametrize("supervised", [False, True])
def test_commands_that_the_plant_cannot_execute_end_the_run(plant, value, reason, supervised):
    log = run(Constant(value), plant, supervisor=make_supervisor() if supervised else None)
    assert log.outcome is Outcome.CONTROLLER_FAILED
    assert reason in log.reason
    assert "\n" not in log.reason
    assert log.status.tolist() == [Status.FAILED]


def make_supervisor():
    return SafetySupervisor(SMALL, Watchdog(WatchdogLimits.of(SMALL)), WheelMonitor(SMALL))


@pytest.mark.parametrize("plant", ["planar", "ball"])
def test_watchdog_brakes_a_robot_under_torques_from_its_present_speed(plant):
    supervisor = make_supervisor()
    log = run(
        Constant(AHEAD), TORQUE_PLANTS[plant](SMALL), reference=Hold(ORIGIN, 8.0),
        supervisor=supervisor,
    )  # fmt: skip
    assert log.outcome is Outcome.STOPPED
    assert "more than 1.00 m" in log.reason
    assert np.abs(log.twist[-1]).max() < 0.01
    stop = int(np.isfinite(log.command[:, 0]).argmax())  # the first twist
    assert log.twist[stop, 0] - 0.6 < log.command[stop, 0] < log.twist[stop, 0]
    braking = np.diff(log.command[stop:], axis=0)
    assert np.abs(braking @ SMALL.acceleration_faces.T).max() <= DT


@pytest.mark.parametrize("plant", ["planar", "ball"])
def test_dead_wheel_under_torques_is_detected_and_compensated(plant):
    """The wrench of the torques stays the same."""
    supervisor = SafetySupervisor(SMALL, None, WheelMonitor(SMALL))
    log = run(
        Constant(WheelTorques([0.02, 0.02, 0.02, 0.02])), TORQUE_PLANTS[plant](SMALL),
        "wheel-dead:at=1,wheel=2", reference=Hold(ORIGIN, 3.0), supervisor=supervisor,
    )  # fmt: skip
    (_, finding) = log.events
    assert finding.what.startswith("wheel 2 is dead; the other 3 compensate for it")
    assert finding.t == pytest.approx(1.3)
    wrenches = log.wheel_torque_command[:-1] @ SMALL.chassis.jacobian
    assert wrenches == pytest.approx(np.tile(wrenches[0], (len(wrenches), 1)), abs=1e-12)
    assert log.wheel_torque_command[-2, 2] == 0.0


@pytest.mark.parametrize(
    ("fault", "reaction"),
    [("wheel-dead", "the other 3 compensate"), ("wheel-locked", "the position is controlled")],
)
def test_failed_wheel_under_wheel_speeds_is_compensated(fault, reaction):
    log = run(
        Wheels(DT), MujocoPlant(SMALL, "ball"), f"{fault}:at=3,wheel=1",
        reference=Circle(duration=10.0), supervisor=make_supervisor(),
    )  # fmt: skip
    assert log.outcome is Outcome.FINISHED
    (finding,) = (event for event in log.events if reaction in event.what)
    errors = np.hypot(*(log.pose - log.target)[:, :2].T)
    assert errors[log.t > finding.t + 2.0].max() < 0.02
    after = log.t[:-1] > finding.t  # twists, which the supervisor computes
    assert np.isfinite(log.command[:-1][after]).all()
    assert np.isnan(log.command[:-1][~after]).any()


def test_locked_wheel_stops_a_robot_under_torques():
    """Torques cannot follow the two directions of motion that are left."""
    supervisor = make_supervisor()
    supervisor.reset(FeedforwardController(DT))
    supervisor._locked = 1
    limited = supervisor.limit(Command(AHEAD), DT)
    assert limited.value == BodyTwist(0.0, 0.0, 0.0)
    assert "wheel 1 is locked, which torques cannot compensate" in supervisor.stopped


def test_values_are_floats_and_survive_pickling():
    import pickle

    speeds = WheelSpeeds(np.array([1.0, 2.0, 3.0]))
    assert speeds == (1.0, 2.0, 3.0)
    assert all(type(value) is float for value in speeds)
    assert repr(speeds) == "WheelSpeeds([1.0, 2.0, 3.0])"
    again = pickle.loads(pickle.dumps(WheelTorques(speeds)))
    assert type(again) is WheelTorques
    assert Command(speeds).twist is None
    assert Command(BodyTwist(1.0, 0.0, 0.0)).twist == BodyTwist(1.0, 0.0, 0.0)
