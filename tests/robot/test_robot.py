"""Wheel matrices and saturation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.errors import InvalidGeometry, InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.robot import ROBOTS, Chassis, named_robot

speed = st.floats(-8, 8)
every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)


@every_robot
@given(vx=speed, vy=speed, w=speed)
def test_wheels_then_twist_is_identity(robot, vx, vy, w):
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


def test_the_papers_wheel_equation():
    """r w_i = -sin(a_i) vx + cos(a_i) vy + R wz at 45 degrees, by hand."""
    robot = named_robot("paper")
    wheels = robot.chassis.wheel_speeds(BodyTwist(1.0, 0.0, 0.0)) * robot.wheel.radius
    assert wheels == pytest.approx(np.sqrt(0.5) * np.array([-1, -1, 1, 1]))
    turning = robot.chassis.wheel_speeds(BodyTwist(0.0, 0.0, 1.0)) * robot.wheel.radius
    assert turning == pytest.approx(np.full(4, np.hypot(0.5, 0.5)))


def test_two_wheels_are_not_omnidirectional():
    with pytest.raises(InvalidGeometry, match="rank 2, need 3"):
        Chassis.omni(angles=(0.0, np.pi), arm=0.2, wheel_radius=0.05, max_wheel_speed=10.0)


def test_an_unknown_robot_is_named_with_those_that_exist():
    with pytest.raises(InvalidInput, match="no robot 'papr'; there are paper, small"):
        named_robot("papr")
