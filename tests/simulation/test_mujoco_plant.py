"""MuJoCo plant: loads, inertia, motors, wheels and contacts."""

from dataclasses import replace
from math import exp, pi

import mujoco
import numpy as np
import pytest

from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, to_world
from omnidrive.robot import ROBOTS, Mount, named_robot, omni_ring
from omnidrive.simulation import MujocoPlant
from omnidrive.simulation.mujoco.wheels import roller_shape

SMALL = named_robot("small")
ORIGIN = Pose(0.0, 0.0, 0.0)
REST = BodyTwist(0.0, 0.0, 0.0)
every_model = pytest.mark.parametrize("wheels", ["ball", "rollers"])
every_robot = pytest.mark.parametrize("name", ROBOTS)


def full_inertia(model):
    """Return the joint-space inertia matrix of a MuJoCo model in its initial pose."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    return matrix


def settled(plant):
    plant.reset(ORIGIN)
    plant.step(REST, 1.0)
    return plant


@every_model
@every_robot
@pytest.mark.parametrize("share", [(0.0, 0.0), (0.15, -0.2)])
def test_wheel_loads_equal_statics(name, wheels, share):
    """Contact forces of MuJoCo compared with statics."""
    robot = ROBOTS[name]
    robot = replace(
        robot, com=(share[0] * robot.mean_wheel_distance, share[1] * robot.mean_wheel_distance)
    )
    plant = settled(MujocoPlant(robot, wheels))
    model, data, carried = plant.model, plant.data, np.zeros(len(robot.mounts))
    roots = {model.body(f"wheel{i}").id: i for i in range(len(robot.mounts))}
    for k in range(data.ncon):
        body = int(model.geom_bodyid[max(data.contact[k].geom)])
        while body not in roots:
            body = int(model.body_parentid[body])
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, k, force)
        carried[roots[body]] += force[0]
    # the contacts of rollers are beside the centres of the wheels
    tolerance = {"ball": 0.04, "rollers": 0.08}[wheels] * float(robot.loads.mean())
    assert carried == pytest.approx(robot.loads, abs=tolerance)


@every_model
def test_centre_of_mass_and_inertia_equal_the_parameters(wheels):
    robot = replace(SMALL, com=(0.04, -0.02), mass=12.0, body_inertia=0.4)
    plant = MujocoPlant(robot, wheels)
    plant.reset(ORIGIN)
    model, data = plant.model, plant.data
    assert data.subtree_com[0][:2] == pytest.approx(robot.com, abs=1e-4)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    assert matrix[0, 0] == pytest.approx(12.0)
    assert matrix[5, 5] == pytest.approx(robot.yaw_inertia, rel=0.03)
    assert robot.yaw_inertia > 0.4


SHAPES = {
    "five": omni_ring([0.3 + 0.4 * pi * k for k in range(5)], 0.22),
    "crooked": (
        Mount(0.2, 0.15, 0.9), Mount(-0.15, 0.2, 2.2), Mount(-0.2, -0.15, 3.8), Mount(0.2, -0.2, -1)
    ),
    "steep": tuple(
        Mount(x, y, -0.5 * pi, side * 0.6) for x, y, side in
        ((0.2, 0.2, 1), (0.2, -0.2, -1), (-0.2, 0.2, -1), (-0.2, -0.2, 1))
    ),
}  # fmt: skip


@every_model
@pytest.mark.parametrize(
    "shape", ["crooked", *(pytest.param(n, marks=pytest.mark.long) for n in ("five", "steep"))]
)
def test_any_wheel_arrangement_realises_the_command(wheels, shape):
    wheel = SMALL.wheel if shape != "steep" else replace(SMALL.wheel, rows=1, rollers_per_row=12)
    robot = replace(SMALL, mounts=SHAPES[shape], wheel=wheel)
    plant = MujocoPlant(robot, wheels)
    plant.reset(ORIGIN)
    for twist in (BodyTwist(0.3, 0.0, 0.0), BodyTwist(0.0, 0.3, 0.0), BodyTwist(0.0, 0.0, 0.8)):
        before = plant.step(twist, 0.8).pose
        after = plant.step(twist, 3.0).pose
        moved = to_body(WorldTwist(*np.subtract(after, before) / 3.0), before.yaw)
        assert np.array(moved) == pytest.approx(np.array(twist), abs=4e-3)


@every_model
@every_robot
def test_wheel_angles_are_consistent_with_the_motion(name, wheels):
    """At low acceleration wheels roll without slip: the angles are the Jacobian times the path."""
    robot = ROBOTS[name]
    plant = MujocoPlant(robot, wheels)
    assert plant.reset(ORIGIN).wheel_angles == (0.0,) * len(robot.mounts)
    for k in range(20):
        plant.step(BodyTwist(0.01 * k, 0.005 * k, 0.0), 0.05)
    state = plant.step(BodyTwist(0.2, 0.1, 0.0), 2.0)
    angles = robot.chassis.jacobian @ to_body(WorldTwist(*state.pose), state.pose.yaw)
    assert np.array(state.wheel_angles) == pytest.approx(angles, rel=0.01, abs=0.02)


@every_model
@every_robot
def test_torques_equal_mass_times_acceleration(name, wheels):
    """By the principle of virtual work, the forces at the rims equal mass times acceleration."""
    robot = ROBOTS[name]
    plant = MujocoPlant(robot, wheels)
    assert plant.reset(ORIGIN).wheel_torques == (0.0,) * len(robot.mounts)
    rate, torques = 0.5, []
    for k in range(60):
        state = plant.step(BodyTwist(rate * 0.02 * k, 0.0, 0.0), 0.02)
        torques.append(state.wheel_torques)
    force = robot.rim_jacobian[:, 0] @ np.mean(torques[20:], axis=0) / robot.wheel.radius
    speeds = robot.rim_jacobian[:, 0] / robot.wheel.radius  # of the wheels, per m/s
    mass = robot.mass + robot.wheel.rotor_inertia * float(speeds @ speeds)
    assert mass * rate < force < 1.15 * mass * rate  # hubs and rollers are accelerated too


@every_model
def test_motor_lag_is_first_order(wheels):
    """The difference to a robot without lag follows 1 - exp(-t / T)."""
    lag, command = 0.4, BodyTwist(0.0, 0.0, 0.5)
    quick = MujocoPlant(replace(SMALL, servo_gain=2.0), wheels)
    slow = MujocoPlant(replace(SMALL, servo_gain=2.0, motor_lag=lag), wheels)
    for plant in (quick, slow):
        plant.reset(ORIGIN)
    for k in range(1, 13):
        without, with_lag = (plant.step(command, 0.1).wheel_angles[0] for plant in (quick, slow))
        t = 0.1 * k
        full = float(slow.robot.chassis.wheel_speeds(command)[0])
        assert with_lag == pytest.approx(
            without - full * lag * (1.0 - exp(-t / lag)), abs=0.03 * full
        )
    again = slow.reset(ORIGIN)
    assert again.wheel_angles == (0.0,) * 4
    assert abs(slow.step(REST, 0.1).twist.yaw_rate) < 1e-3


def test_torque_is_limited():
    plant = MujocoPlant(replace(SMALL, friction=3.0, max_torque=0.3), "ball")
    plant.reset(ORIGIN)
    state = plant.step(BodyTwist(2.0, 0.0, 0.0), 0.1)
    assert np.abs(state.wheel_torques).max() == pytest.approx(0.3)


def test_acceleration_is_limited_by_friction():
    """All four wheels act along x with sqrt(1/2) of their friction limit."""
    plant = MujocoPlant(replace(SMALL, friction=0.1, max_torque=20.0, servo_gain=5.0), "ball")
    plant.reset(ORIGIN)
    plant.step(BodyTwist(5.0, 0.0, 0.0), 0.1)
    before = plant.step(BodyTwist(5.0, 0.0, 0.0), 0.1).twist.vx
    after = plant.step(BodyTwist(5.0, 0.0, 0.0), 0.5).twist.vx
    assert (after - before) / 0.5 == pytest.approx(0.5**0.5 * 0.1 * 9.81, rel=0.06)


@every_model
@every_robot
def test_slipping_wheels_transmit_the_friction_limit(name, wheels):
    """With stiff servos too, whose speed would oscillate without substeps."""
    robot = replace(ROBOTS[name], friction=0.1)
    plant = MujocoPlant(robot, wheels)
    plant.reset(ORIGIN)
    before = plant.step(BodyTwist(1.0, 0.0, 0.0), 0.2).twist.vx
    after = plant.step(BodyTwist(1.0, 0.0, 0.0), 0.6).twist.vx
    force = 0.1 * 9.81 * float(np.mean([abs(mount.drive_direction[0]) for mount in robot.mounts]))
    assert (after - before) / 0.6 == pytest.approx(
        force, rel={"ball": 0.04, "rollers": 0.08}[wheels]
    )


@every_robot
def test_balls_have_friction_along_their_forces_only(name):
    """Frames of MuJoCo's contacts, at any yaw and wheel angle."""
    robot = ROBOTS[name]
    plant = MujocoPlant(robot, "ball")
    plant.reset(Pose(0.3, -0.2, 0.7))
    yaw = plant.step(BodyTwist(0.3, 0.2, 0.5), 1.0).pose.yaw
    data = plant.data
    assert data.ncon == len(robot.mounts)
    for k in range(data.ncon):
        mount = robot.mounts[int(plant.model.geom(max(data.contact[k].geom)).name[4:])]
        force = [*to_world(BodyTwist(*mount.drive_direction, 0.0), yaw)[:2], 0.0]
        _, across, along = data.contact[k].frame.reshape(3, 3)
        assert abs(along @ force) == pytest.approx(1.0, abs=1e-3)
        assert abs(across @ force) < 5e-3
        assert data.contact[k].friction[:2] == pytest.approx(
            [1e-4 * robot.friction, robot.friction]
        )


@every_robot
def test_initial_roller_angles_are_random(name):
    robot = ROBOTS[name]

    def end(seed):
        rng = None if seed is None else np.random.default_rng(seed)
        plant = MujocoPlant(robot, "rollers", rng)
        starts = [plant.reset(ORIGIN) for _ in range(2)]
        assert repr(starts[0]) == repr(starts[1])
        assert starts[0].wheel_angles == (0.0,) * len(robot.mounts)
        joints = [plant.data.joint(f"wheel{i}").qpos[0] for i in range(len(robot.mounts))]
        return np.mod(joints, 2.0 * pi / robot.wheel.rollers_per_row), plant.step(
            BodyTwist(0.3, 0.1, 0.0), 0.5
        ).pose

    phases, pose = end(1)
    again, same = end(1)
    other, different = end(2)
    none, _ = end(None)
    assert phases.tolist() == again.tolist() != other.tolist()
    assert pose == same != different
    assert np.ptp(phases) > 0.01
    assert np.ptp(np.mod(none + 0.1, 2.0 * pi / robot.wheel.rollers_per_row)) < 0.01
    assert np.array(pose) == pytest.approx(np.array(different), abs=0.01)


@pytest.mark.parametrize("angle", [0.25 * pi, -0.25 * pi, 0.6])
@pytest.mark.parametrize("rollers", [9, 12, 16])
def test_mecanum_wheels_have_constant_height(rollers, angle):
    """Height of the axle during a turn, computed from points of the rollers."""
    wheel = replace(named_robot("mecanum").wheel, rollers_per_row=rollers)
    tilt, half = roller_shape(wheel, angle)
    r, b = wheel.radius, wheel.roller_radius
    t, u = np.meshgrid(np.linspace(-1, 1, 801), np.linspace(0, 2 * pi, 361))
    along, around = half * t, b * np.sqrt(1 - t**2)  # an ellipsoid about z
    x, y = around * np.cos(u), around * np.sin(u)
    heights = []
    for d in np.linspace(0.0, pi / rollers, 25):
        # roller below the axle, its axis tilted by `tilt`, and the wheel turned by d
        ahead = along * np.cos(tilt) - y * np.sin(tilt)
        low = -(r - b) + x
        heights.append(-(low * np.cos(d) - ahead * np.sin(d)).min())
    assert np.ptp(heights) < {9: 4e-4, 12: 1e-4, 16: 4e-5}[rollers]
    assert np.mean(heights) == pytest.approx(r, abs=2e-4)


def test_visual_geoms_have_no_contacts():
    """The group of visual geoms collides with nothing."""
    plant = MujocoPlant(SMALL, "ball")
    model = plant.model
    visual = [i for i in range(model.ngeom) if model.geom_group[i] == 1]
    assert visual
    assert all(model.geom_contype[i] == model.geom_conaffinity[i] == 0 for i in visual)
    assert model.geom("nose").pos[0] > 0.5 * SMALL.body_radius
