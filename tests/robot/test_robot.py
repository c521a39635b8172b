"""Wheel kinematics, saturation and the acceleration polytope."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidGeometry, InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot import GRAVITY, ROBOTS, Chassis, named_robot

speed = st.floats(-8, 8)
every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


@every_robot
@given(vx=speed, vy=speed, w=speed)
def test_twist_inverts_wheel_speeds(robot, vx, vy, w):
    twist = BodyTwist(vx, vy, w)
    chassis = robot.chassis
    assert chassis.twist(chassis.wheel_speeds(twist)) == pytest.approx(twist, abs=1e-9)


@every_robot
@given(vx=speed, vy=speed, w=speed)
def test_saturation_keeps_direction_and_limit(robot, vx, vy, w):
    twist, chassis = BodyTwist(vx, vy, w), robot.chassis
    cut = chassis.saturate(twist)
    assert np.abs(chassis.wheel_speeds(cut)).max() <= chassis.max_wheel_speed * (1 + 1e-12)
    assert np.cross(cut, twist) == pytest.approx(np.zeros(3), abs=1e-9)
    assert np.dot(cut, twist) >= 0.0
    assert chassis.saturate(cut) == pytest.approx(cut, rel=1e-12)


def test_wheel_equation_of_the_paper():
    """r w_i = -sin(a_i) vx + cos(a_i) vy + R wz at 45 degrees, with values computed by hand."""
    robot = named_robot("paper")
    wheels = robot.chassis.wheel_speeds(BodyTwist(1.0, 0.0, 0.0)) * robot.wheel.radius
    assert wheels == pytest.approx(np.sqrt(0.5) * np.array([-1, -1, 1, 1]))
    turning = robot.chassis.wheel_speeds(BodyTwist(0.0, 0.0, 1.0)) * robot.wheel.radius
    assert turning == pytest.approx(np.full(4, np.hypot(0.5, 0.5)))


def test_two_wheels_are_not_omnidirectional():
    with pytest.raises(InvalidGeometry, match="rank 2, need 3"):
        Chassis.omni(angles=(0.0, np.pi), ring_radius=0.2, wheel_radius=0.05, max_wheel_speed=10.0)


@every_robot
@given(part=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4), index=st.integers(0, 2**32 - 1))
def test_acceleration_polytope_is_tight(robot, part, index):
    """All feasible wheel forces are inside, and every face is reached."""
    count, roller = len(robot.mounts), abs(robot.mounts[0].roller_angle)
    # all wheels carry equal loads
    friction_limit = robot.friction * robot.mass * GRAVITY / count * np.cos(roller)
    limit = min(friction_limit, robot.max_torque / robot.wheel.radius)
    rim_jacobian = robot.wheel.radius * robot.chassis.jacobian
    inertia = np.array([robot.mass, robot.mass, robot.yaw_inertia])
    reached = limit * np.array(part[:count]) @ rim_jacobian / inertia
    assert np.abs(robot.acceleration_faces @ reached).max() <= 1.0 + 1e-9
    normal = robot.acceleration_faces[index % len(robot.acceleration_faces)]
    furthest = limit * np.sign(rim_jacobian @ (normal / inertia)) @ rim_jacobian / inertia
    assert np.abs(robot.acceleration_faces @ furthest).max() == pytest.approx(1.0)


def test_acceleration_polytope_of_paper_robot():
    """Along a drive direction two of four wheels act: g / 2. Along x all four act: g / sqrt(2)."""
    rows = named_robot("paper").acceleration_faces
    diagonal = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0])
    assert 1.0 / np.abs(rows @ diagonal).max() == pytest.approx(0.5 * GRAVITY)
    assert 1.0 / np.abs(rows @ [1.0, 0.0, 0.0]).max() == pytest.approx(np.sqrt(0.5) * GRAVITY)


def test_message_of_unknown_robot():
    with pytest.raises(InvalidInput, match="no robot 'papr'; did you mean 'paper'"):
        named_robot("papr")
    with pytest.raises(InvalidInput, match="no robot 'x'; there are paper, small, kiwi, mecanum"):
        named_robot("x")
