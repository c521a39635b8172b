"""Planar plant compared with analytical mechanics, MuJoCo's inertias and the MuJoCo plant."""

from dataclasses import replace
from itertools import pairwise
from math import exp, hypot, nan, pi, sqrt

import mujoco
import numpy as np
import pytest

from omnidrive.control import WheelSpeeds
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move, twist_between
from omnidrive.robot import GRAVITY, ROBOTS, Robot, named_robot
from omnidrive.scenario import make_plant
from omnidrive.simulation import (
    DisturbablePlant,
    Disturbances,
    Impulse,
    Motor,
    MujocoPlant,
    Patch,
    Payload,
    PlanarPlant,
    PoseOffset,
    simulate_commands,
)
from omnidrive.simulation.mujoco.robot_model import robot_mjcf
from omnidrive.simulation.planar.model import mass_matrix, planar_model
from tests.simulation.test_mujoco_plant import full_inertia

ORIGIN, STILL = Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
ALONG = np.array([1.0, 1.0]) / sqrt(2.0)
"""Direction of the axles of wheels 0 and 2 of robot small: wheels 1 and 3 drive."""


class Small:
    """Masses of the robot small for motion along the diagonal, from MuJoCo."""

    robot = named_robot("small")
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, "rollers"))

    @classmethod
    def wheel(cls):
        """Return the inertia of a wheel about its axle, kg m^2."""
        return full_inertia(cls.model)[np.ix_(*[[cls.model.joint("wheel0").dofadr[0]]] * 2)].item()

    @classmethod
    def mass(cls):
        """Return the effective mass of the robot with its two rolling wheels, kg."""
        return cls.robot.mass + 2.0 * cls.wheel() / cls.robot.wheel.radius**2


def small(**changes) -> Robot:
    return replace(Small.robot, **changes)


def diagonal(speed):
    return BodyTwist(*(speed * ALONG).tolist(), 0.0)


def kick(speed):
    return Disturbances(impulse=Impulse(*(Small.robot.mass * speed * ALONG).tolist(), 0.0))


def speed_along(state):
    return float(ALONG @ state.twist[:2])


@pytest.mark.parametrize("name", ROBOTS)
def test_inertias_equal_those_of_the_mujoco_model(name):
    robot = ROBOTS[name]
    reference = mujoco.MjModel.from_xml_string(robot_mjcf(robot, "rollers"))
    matrix = full_inertia(reference)
    model = planar_model(robot, Disturbances())
    assert mass_matrix(model.body)[[0, 2], [0, 2]] == pytest.approx(
        matrix[[0, 5], [0, 5]], rel=1e-4
    )
    wheel = reference.joint("wheel0").dofadr[0]
    assert model.wheels["inertia"] == pytest.approx(matrix[wheel, wheel], rel=1e-4)
    rollers = [i for i in range(reference.nv) if 0.0 < reference.dof_damping[i] < 1e-4]
    inertia = matrix[rollers[0], rollers[0]]
    decay = model.wheels["roller_decay"]
    assert decay == pytest.approx(reference.dof_damping[rollers[0]] / inertia, rel=1e-4)
    assert len(rollers) == len(robot.mounts) * robot.wheel.rows * robot.wheel.rollers_per_row


def test_mass_matrix_with_offset_centre_of_mass_equals_mujocos():
    robot = small(com=(0.05, -0.03))
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, "rollers"))
    planar = full_inertia(model)[np.ix_([0, 1, 5], [0, 1, 5])]
    assert mass_matrix(planar_model(robot, Disturbances()).body) == pytest.approx(planar, abs=2e-4)


def test_acceleration_at_the_torque_limit():
    robot = small(servo_gain=1e3, friction=5.0, max_torque=1.0)
    plant = PlanarPlant(robot)
    plant.reset(ORIGIN)
    state = plant.step(diagonal(2.0), 0.2)
    force = 2.0 * robot.max_torque / robot.wheel.radius
    assert speed_along(state) == pytest.approx(0.2 * force / Small.mass(), rel=5e-3)
    assert state.wheel_torques == pytest.approx([0.0, -1.0, 0.0, 1.0], abs=0.02)


@pytest.mark.parametrize("friction", [0.1, 0.4])
def test_acceleration_at_the_friction_limit(friction):
    plant = PlanarPlant(small(friction=friction, max_torque=50.0, servo_gain=50.0))
    plant.reset(ORIGIN)
    state = plant.step(diagonal(2.0), 0.2)
    # two of four wheels drive, each with friction times a quarter of the weight
    assert speed_along(state) == pytest.approx(0.2 * friction * GRAVITY / 2.0, rel=0.01)
    plant.reset(ORIGIN)
    ahead = plant.step(BodyTwist(2.0, 0.0, 0.0), 0.1)  # all four, at 45 degrees
    assert ahead.twist.vx == pytest.approx(0.1 * friction * GRAVITY / sqrt(2.0), rel=0.05)


@pytest.mark.parametrize(("share", "slips"), [(0.97, False), (1.03, True)])
def test_wheels_slip_above_the_friction_limit(share, slips):
    friction, r = 0.3, Small.robot.wheel.radius
    force = friction * Small.robot.mass * GRAVITY / 4.0
    spin = Small.wheel() * (2.0 * force / Small.robot.mass) / r  # torque that accelerates the wheel
    robot = small(friction=friction, servo_gain=1e3, max_torque=share * (force * r + spin))
    plant = PlanarPlant(robot)
    plant.reset(ORIGIN)
    state = plant.step(diagonal(2.4), 0.5)
    rolled = r * state.wheel_angles[3]
    moved = hypot(state.pose.x, state.pose.y)
    assert (abs(rolled - moved) > 0.01 * moved) == slips


def test_with_dead_motors_only_roller_bearings_brake():
    """Two wheels do not turn; one roller of each keeps turning."""
    plant = PlanarPlant(Small.robot, np.random.default_rng(1))
    plant.reset(ORIGIN)
    dead = (Motor.DEAD,) * 4
    plant.apply(kick(0.6)._replace(motors=dead))
    plant.apply(Disturbances(motors=dead))
    first = plant.step(STILL, 0.1)
    last = plant.step(STILL, 1.0)
    wheel = planar_model(Small.robot, Disturbances()).wheels[0]
    drag = 2.0 * wheel["roller_mass"] * wheel["roller_decay"]
    mass = Small.mass() + 2.0 * wheel["roller_mass"]
    lost = 1.0 - speed_along(last) / speed_along(first)
    assert lost == pytest.approx(1.0 - exp(-drag / mass), rel=0.1)
    assert speed_along(first) == pytest.approx(0.6 * Small.robot.mass / mass, rel=1e-3)
    assert last.work == 0.0


def test_without_friction_the_centre_of_mass_moves_straight():
    robot = small(friction=0.0, com=(0.06, -0.02))
    plant = PlanarPlant(robot, timestep=1e-3)
    plant.reset(Pose(0.3, 0.2, 0.5))
    plant.apply(Disturbances(impulse=Impulse(4.0, 2.0, 0.8)))
    plant.apply(Disturbances())

    def centre(state):
        return np.array(move(state.pose, BodyTwist(*robot.com, 0.0), 1.0)[:2])

    states = [plant.step(STILL, 0.25) for _ in range(8)]
    positions = np.array([centre(state) for state in states])
    assert np.diff(positions, axis=0) == pytest.approx(
        np.tile([0.25 * 4.0 / robot.mass, 0.25 * 2.0 / robot.mass], (7, 1)), abs=2e-4
    )
    rates = [state.twist.yaw_rate for state in states]
    assert rates == pytest.approx([rates[0]] * 8, rel=1e-12)
    inertia = mass_matrix(planar_model(robot, Disturbances()).body)
    turned = np.array([[np.cos(0.5), np.sin(0.5)], [-np.sin(0.5), np.cos(0.5)]]) @ [4.0, 2.0]
    assert rates[0] == pytest.approx(np.linalg.solve(inertia, [*turned, 0.8])[2], rel=1e-9)


def test_work_exceeds_kinetic_energy():
    plant = PlanarPlant(small(friction=3.0), timestep=5e-4)
    plant.reset(ORIGIN)
    for _ in range(12):
        state = plant.step(diagonal(0.8), 0.025)
        motion = 0.5 * Small.mass() * speed_along(state) ** 2
        assert state.work >= motion
    assert state.work == pytest.approx(motion, rel=0.01)


def test_motion_on_a_slope_with_and_without_motors():
    steep = 0.1
    slope = Disturbances(slope=tuple((steep * ALONG).tolist()))
    downhill_force = GRAVITY * steep / hypot(1.0, steep) * Small.robot.mass
    plant = PlanarPlant(Small.robot)
    plant.reset(ORIGIN)
    plant.apply(slope._replace(motors=(Motor.DEAD,) * 4))
    rolling = plant.step(STILL, 0.3)
    assert speed_along(rolling) == pytest.approx(-0.3 * downhill_force / Small.mass(), rel=5e-3)
    plant.reset(ORIGIN)
    plant.apply(slope)
    creeping = plant.step(STILL, 1.0)
    r, gain = Small.robot.wheel.radius, Small.robot.servo_gain
    assert speed_along(creeping) == pytest.approx(-downhill_force * r * r / (2.0 * gain), rel=5e-3)


def test_slope_is_fixed_in_the_world():
    turned = PlanarPlant(Small.robot)
    turned.reset(Pose(0.0, 0.0, 0.5 * pi))
    turned.apply(Disturbances(slope=(0.1, 0.0), motors=(Motor.DEAD,) * 4))
    state = turned.step(STILL, 0.5)
    assert state.pose.x < -0.1
    assert abs(state.pose.y) < 1e-3


def test_payload_changes_mass_and_loads():
    payload = Payload(6.0, 0.1, -0.05)
    loaded = planar_model(Small.robot, Disturbances(payload=payload)).wheels["load"]
    together = small(mass=16.0, com=(6.0 * 0.1 / 16.0, -6.0 * 0.05 / 16.0))
    assert loaded == pytest.approx(together.loads, rel=1e-12)
    plant = PlanarPlant(small(servo_gain=1e3, friction=5.0, max_torque=1.0))
    plant.reset(ORIGIN)
    plant.apply(Disturbances(payload=Payload(Small.mass(), 0.0, 0.0)))
    state = plant.step(diagonal(2.0), 0.2)
    assert speed_along(state) == pytest.approx(0.2 * 40.0 / (2.0 * Small.mass()), rel=5e-3)


def test_acceleration_shifts_the_load():
    """A start of kiwi at the friction limit, compared with the MuJoCo plant."""
    robot, command = named_robot("kiwi"), BodyTwist(1.5, 0.0, 0.0)
    poses = {}
    for name, plant in {
        "rollers": MujocoPlant(robot),
        "planar": PlanarPlant(robot),
        "flat": PlanarPlant(replace(robot, com_height=1e-6)),
    }.items():
        plant.reset(ORIGIN)
        poses[name] = np.array(plant.step(command, 0.6).pose)
    shifted, flat = (np.abs(poses[name] - poses["rollers"])[0] for name in ("planar", "flat"))
    assert shifted < flat


def test_patch_acts_on_the_wheels_inside():
    robot = small(friction=0.5, servo_gain=50.0, max_torque=50.0)
    x, y, *_ = robot.mounts[1]
    speeds = {}
    for radius in (0.05, 5.0):
        plant = PlanarPlant(robot)
        plant.reset(ORIGIN)
        plant.apply(Disturbances(patch=Patch(x, y, radius, 0.1)))
        speeds[radius] = plant.step(diagonal(2.0), 0.05)
    force = 0.05 * GRAVITY / 4.0
    assert speed_along(speeds[5.0]) == pytest.approx(force * 0.2, rel=0.01)
    assert speed_along(speeds[0.05]) == pytest.approx(force * 0.6, rel=0.03)


def test_locked_wheel_and_weak_motor():
    plant = PlanarPlant(small(servo_gain=1e3))
    plant.reset(ORIGIN)
    plant.apply(Disturbances(motors=(Motor.LOCKED, Motor.WEAK, Motor.HEALTHY, Motor.DEAD)))
    state = plant.step(BodyTwist(2.0, 0.0, 0.0), 0.02)
    assert state.wheel_angles[0] == 0.0
    assert abs(state.wheel_torques[1]) == pytest.approx(0.5 * Small.robot.max_torque)
    assert abs(state.wheel_torques[2]) == pytest.approx(Small.robot.max_torque)
    assert state.wheel_torques[3] == 0.0


def test_locked_wheel_permits_motion_along_its_axle_only():
    plant = PlanarPlant(Small.robot)
    plant.reset(ORIGIN)
    plant.apply(Disturbances(motors=(Motor.LOCKED, *[Motor.HEALTHY] * 3)))
    free = plant.step(diagonal(0.2), 1.0)  # along its axle: rollers turn
    assert speed_along(free) == pytest.approx(0.2, abs=2e-3)
    plant.apply(Disturbances(motors=(Motor.LOCKED, *[Motor.DEAD] * 3)))
    plant.step(STILL, 0.1)
    plant.apply(Disturbances((Motor.LOCKED, *[Motor.DEAD] * 3), impulse=Impulse(-0.5, 0.5, 0.0)))
    state = plant.step(STILL, 0.2)
    assert abs(Small.robot.rim_jacobian[0] @ state.twist) < 1e-5
    assert abs(state.twist.yaw_rate) > 0.01


def test_pose_offset_and_reset():
    plant = PlanarPlant(Small.robot)
    plant.reset(ORIGIN)
    untouched = [plant.step(diagonal(0.3), 0.1) for _ in range(3)]
    load, patch = Payload(3.0, 0.1, 0.0), Patch(0.0, 0.0, 9.0, 0.01)
    offset = PoseOffset(0.5, -0.2, 0.7)
    plant.apply(Disturbances((Motor.DEAD,) * 4, (0.2, 0.1), load, patch, offset=offset))
    after = plant.step(diagonal(0.3), 1e-9)
    moved = np.subtract(after.pose, untouched[-1].pose)
    assert moved == pytest.approx([0.5, -0.2, 0.7], abs=1e-6)
    assert np.array(after.twist) == pytest.approx(np.array(untouched[-1].twist), abs=1e-6)
    plant.reset(ORIGIN)
    assert [plant.step(diagonal(0.3), 0.1) for _ in range(3)] == untouched


def test_wrong_number_of_motors_is_refused():
    plant = PlanarPlant(Small.robot)
    assert isinstance(plant, DisturbablePlant)
    with pytest.raises(InvalidInput, match="3 motors for 4 wheels"):
        plant.apply(Disturbances(motors=(Motor.DEAD,) * 3))


def test_servo_response_converges_with_first_order():
    """Without limits v' = (c - v) / tau, and the errors are halved with h."""
    robot = small(friction=3.0, max_torque=20.0)
    tau = robot.wheel.radius**2 * Small.mass() / (2.0 * robot.servo_gain)
    t, c = 0.016, 0.02
    errors = []
    for h in (2e-3, 1e-3, 5e-4):
        plant = PlanarPlant(robot, timestep=h)
        plant.reset(ORIGIN)
        errors.append(speed_along(plant.step(diagonal(c), t)) - c * (1.0 - exp(-t / tau)))
    halves = np.divide(errors[:-1], errors[1:])
    assert halves == pytest.approx([2.0, 2.0], rel=0.15)
    assert abs(errors[0]) < 0.05 * c


def test_motor_lag_delays_the_robot():
    lag, quick_robot = 0.2, small(friction=3.0, max_torque=20.0)
    plant = PlanarPlant(replace(quick_robot, motor_lag=lag))
    plant.reset(ORIGIN)
    states = [plant.step(diagonal(0.2), 0.02) for _ in range(100)]
    behind = 0.2 * 2.0 - hypot(*states[-1].pose[:2])
    plant = PlanarPlant(quick_robot)
    plant.reset(ORIGIN)
    quick = 0.2 * 2.0 - hypot(*plant.step(diagonal(0.2), 2.0).pose[:2])
    assert behind - quick == pytest.approx(0.2 * lag, rel=0.02)


def test_batch_equals_single_steps_bit_for_bit():
    robot, rng = named_robot("kiwi"), np.random.default_rng(5)
    starts = rng.normal(size=(3, 3))
    commands = rng.normal(size=(3, 12, 3))
    poses, twists = simulate_commands(robot, starts, commands, 0.05)
    plant = PlanarPlant(robot)
    for run in range(3):
        plant.reset(Pose(*starts[run].tolist()))
        for k in range(12):
            state = plant.step(BodyTwist(*commands[run, k].tolist()), 0.05)
            assert tuple(poses[run, k].tolist()) == tuple(state.pose)
            assert tuple(twists[run, k].tolist()) == tuple(state.twist)


def test_batch_with_wrong_sizes_is_refused():
    with pytest.raises(InvalidInput, match="2 starts for 3 runs"):
        simulate_commands(Small.robot, np.zeros((2, 3)), np.zeros((3, 4, 3)), 0.1)
    with pytest.raises(InvalidInput, match="need 1e-09 to 3600 s"):
        simulate_commands(Small.robot, np.zeros((1, 3)), np.zeros((1, 4, 3)), 0.0)


def test_initial_roller_angles_are_random():
    drawn = [PlanarPlant(Small.robot, np.random.default_rng(seed)) for seed in (1, 1, 2)]
    states = [plant.reset(ORIGIN) and plant.step(diagonal(0.5), 0.5) for plant in drawn]
    assert states[0] == states[1] != states[2]
    assert states[2].wheel_angles == pytest.approx(states[0].wheel_angles, abs=0.05)
    again = drawn[0].reset(ORIGIN)
    assert again.wheel_angles == (0.0,) * 4
    assert drawn[0].step(diagonal(0.5), 0.5) == states[0]


def s_commands(dt=0.05, speed=0.7):
    """Return body twists along one period of a sine, 4 m long, amplitude 0.5 m, tangential."""
    x = np.linspace(0.0, 4.0, 8001)
    y = 0.5 * np.sin(0.5 * pi * x)
    run = np.concatenate([[0.0], np.hypot(np.diff(x), np.diff(y)).cumsum()])
    heading = np.arctan2(0.25 * pi * np.cos(0.5 * pi * x), 1.0)
    along = np.arange(0.0, run[-1], speed * dt)
    rows = np.transpose([np.interp(along, run, column) for column in (x, y, heading)])
    poses = [Pose(*row) for row in rows.tolist()]
    return poses[0], [twist_between(a, b, dt) for a, b in pairwise(poses)]


@pytest.mark.parametrize(("friction", "limit"), [(0.8, 0.012), (0.1, 0.01)])
def test_s_path_equals_that_of_the_mujoco_plant(friction, limit):
    """Without an acceleration ramp: at low friction the wheels slip for a second."""
    robot, (start, twists) = small(friction=friction), s_commands()
    paths = []
    for plant in (MujocoPlant(robot), PlanarPlant(robot)):
        plant.reset(start)
        paths.append(np.array([plant.step(twist, 0.05).pose for twist in twists]))
    assert np.hypot(*(paths[0] - paths[1])[:, :2].T).max() < limit


def test_long_steps_equal_their_parts(monkeypatch):
    """A long step is integrated in parts, so that signals are handled between them."""
    command = BodyTwist(9.0, 0.0, 1.0)
    whole = PlanarPlant(Small.robot)
    whole.reset(ORIGIN)
    expected = whole.step(command, 0.1)
    monkeypatch.setattr("omnidrive.simulation.planar.plant._MAX_STEPS", 7)
    for value in (command, WheelSpeeds(2.0 * Small.robot.chassis.wheel_speeds(command))):
        parts = PlanarPlant(Small.robot)
        parts.reset(ORIGIN)
        state = parts.step(value, 0.1)
        assert np.array(state.pose) == pytest.approx(expected.pose, rel=1e-12)
        assert state.wheel_torques == pytest.approx(expected.wheel_torques, rel=1e-12)
        assert state.saturated == expected.saturated


@pytest.mark.parametrize("timestep", [0.0, -0.002, nan, 1.0])
def test_invalid_time_step_is_refused(timestep):
    with pytest.raises(InvalidInput, match="timestep is"):
        PlanarPlant(Small.robot, timestep=timestep)


def test_plant_name_in_studies():
    assert isinstance(make_plant(Small.robot, "planar"), PlanarPlant)
