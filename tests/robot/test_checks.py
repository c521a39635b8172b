"""Invalid robots are rejected with a message; static loads."""

import pickle
from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest

from omnidrive.errors import InvalidGeometry, InvalidInput
from omnidrive.robot import ROBOTS, Chassis, Mount, OmniWheel, named_robot, omni_ring
from omnidrive.robot.mount import mecanum_rectangle

SMALL = named_robot("small")
SWAPPED = tuple(m._replace(roller_angle=-m.roller_angle) for m in mecanum_rectangle(0.2, 0.2))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": -1.0}, "the robot's mass must be positive, got -1 kg"),
        ({"mass": nan}, "the robot's mass must be positive, got nan kg"),
        ({"mass": 2.0}, r"mass is 2 kg and its wheels alone weigh 2.264 kg: raise the mass"),
        ({"com": (0.3, 0.0)}, r"at \(0.3, 0\) m wheel 2 would lift off .* move com between"),
        ({"com": (nan, 0.0)}, "com must be finite"),
        ({"body_inertia": 0.0}, "body_inertia must be positive"),
        ({"friction": -0.1}, "friction must not be negative, got -0.1$"),
        ({"max_torque": inf}, "max_torque must be positive, got inf N m"),
        ({"motor_lag": -0.01}, "lag of the robot must not be negative, got -0.01 s"),
        ({"lag": (nan, 0.0)}, "lag of the robot must not be negative, got nan s"),
        ({"max_wheel_speed": 0.0}, "max_wheel_speed must be positive, got 0 rad/s"),
        ({"assumed_effective_radius": 0.0}, "assumed_effective_radius must be positive"),
        ({"drive_gain": (1.0, 0.0, 1.0)}, "drive_gain of the robot must be positive"),
        ({"mounts": omni_ring([0.1 * k for k in range(20)], 0.2)}, "20 wheels, need at most 16"),
        ({"mounts": (Mount(nan, 0.0, 0.0), *SMALL.mounts)}, "wheel 0 is mounted at .* finite"),
        ({"mounts": (Mount(0.2, 0.2, 0.0, 0.5 * pi), *SMALL.mounts)}, "cannot drive the robot"),
    ],
)
def test_invalid_robot_is_rejected(changes, message):
    with pytest.raises(InvalidInput, match=message):
        replace(SMALL, **changes)


@pytest.mark.parametrize("mounts", [(), omni_ring((0.0, pi), 0.2)])
def test_singular_wheel_layout_is_rejected(mounts):
    with pytest.raises(InvalidGeometry, match="need 3: not omnidirectional; turn a wheel"):
        replace(SMALL, mounts=mounts)


@pytest.mark.parametrize("roller", [0.0, 0.785])
def test_parallel_drive_directions_are_rejected_as_such(roller):
    mounts = [m._replace(roller_angle=roller) for m in mecanum_rectangle(0.2, 0.3)]
    with pytest.raises(InvalidGeometry, match="all wheels push in the same direction; mec") as e:
        replace(SMALL, mounts=tuple(mounts))
    assert str(pickle.loads(pickle.dumps(e.value))) == str(e.value)


def test_swapped_rollers_on_a_square_are_rejected_as_such():
    """Without a lever arm the wheels cannot turn the robot; with the other signs they can."""
    replace(SMALL, mounts=mecanum_rectangle(0.2, 0.2))
    with pytest.raises(InvalidGeometry, match=r"rank 2, .* swapped; reverse the sign of every"):
        replace(SMALL, mounts=SWAPPED)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"radius": 0.0}, "radius must be positive, got 0 m"),
        ({"mass": -0.1}, "mass must be positive"),
        ({"rotor_inertia": nan}, "rotor_inertia must not be negative, got nan"),
        ({"roller_radius": 0.05}, "do not fit a wheel of radius 0.05 m: make the rollers smaller"),
        ({"rollers_per_row": 2}, "2 rows of 2 rollers, need"),
        ({"rollers_per_row": 10**6}, "need 1 to 4 rows of 3 to 100"),
        ({"rows": 0}, "0 rows"),
    ],
)
def test_invalid_wheel_is_rejected(changes, message):
    with pytest.raises(InvalidInput, match=message):
        replace(SMALL.wheel, **changes)


@pytest.mark.parametrize(("radius", "speed"), [(0.0, 1.0), (nan, 1.0), (0.05, 0.0), (0.05, nan)])
def test_chassis_needs_finite_positive_numbers(radius, speed):
    with pytest.raises(InvalidInput, match="must be positive"):
        Chassis.of_mounts(SMALL.mounts, wheel_radius=radius, max_wheel_speed=speed)
    with pytest.raises(InvalidInput, match="must be positive"):
        Chassis.omni(
            angles=(0.0, 2.0, 4.0), ring_radius=0.2, wheel_radius=radius, max_wheel_speed=speed
        )


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_loads_balance_the_weight(robot):
    """The equations of static equilibrium hold: force and both moments."""
    shifted = replace(
        robot, com=(0.1 * robot.mean_wheel_distance, -0.2 * robot.mean_wheel_distance)
    )
    weight = 9.81 * robot.mass
    assert shifted.loads.sum() == pytest.approx(weight)
    for axis in (0, 1):
        moment = sum(load * m[axis] for load, m in zip(shifted.loads, robot.mounts, strict=True))
        assert moment == pytest.approx(weight * shifted.com[axis])


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_load_transfer_balances_moments(robot):
    """Load transfer balances the moment of a floor force; the total load is constant."""
    rolling = np.array([np.cos(mount.roller_angle) for mount in robot.mounts])
    loads = robot.load_transfer / (robot.friction * rolling[:, None])
    positions = np.array([(mount.x, mount.y) for mount in robot.mounts])
    assert loads.sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert positions.T @ loads == pytest.approx(-robot.com_height * np.eye(2), abs=1e-12)


def test_total_mass_of_wheel():
    wheel = OmniWheel(radius=0.08, mass=1.0, rotor_inertia=0.0, rows=1, rollers_per_row=10,
                      roller_mass=0.03)  # fmt: skip
    assert wheel.total_mass == pytest.approx(1.3)
