"""Properties of every disturbable plant. A new plant only has to be added to PLANTS."""

from math import hypot, pi, tan

import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import GRAVITY, named_robot
from omnidrive.simulation import (
    DisturbablePlant,
    Disturbances,
    Impulse,
    KinematicPlant,
    Motor,
    MujocoPlant,
    Patch,
    Payload,
    PlanarPlant,
    PoseOffset,
)

PLANTS = {
    "planar": PlanarPlant,
    "ball": lambda robot: MujocoPlant(robot, "ball"),
    "rollers": lambda robot: MujocoPlant(robot, "rollers"),
}
every_plant = pytest.mark.parametrize("make", PLANTS.values(), ids=PLANTS)
ROBOT = named_robot("paper")
AT = Pose(0.2, -0.1, 0.4)
STILL = BodyTwist(0.0, 0.0, 0.0)
GOING = BodyTwist(0.4, 0.2, 0.3)
ALL = {motor: Disturbances((motor,) * len(ROBOT.mounts)) for motor in (Motor.DEAD, Motor.LOCKED)}
EVERYTHING = Disturbances(
    (Motor.DEAD, Motor.LOCKED, Motor.WEAK, Motor.HEALTHY),
    (0.1, -0.05),
    Payload(10.0, 0.2, -0.3),
    Patch(0.0, 0.0, 5.0, 0.05),
    Impulse(20.0, 0.0, 3.0),
    PoseOffset(0.3, 0.1, 1.0),
)


def faulty(wheel, motor):
    """Return disturbances with one faulty motor."""
    motors = [Motor.HEALTHY] * len(ROBOT.mounts)
    motors[wheel] = motor
    return Disturbances(tuple(motors))


def drive(plant, twist, steps=8, dt=0.1):
    return [plant.step(twist, dt) for _ in range(steps)]


def disturbed(make, disturbances, twist=STILL, steps=8):
    """Return a plant to which disturbances were applied during motion, and its last state."""
    plant = make(ROBOT)
    plant.reset(AT)
    state = drive(plant, twist, steps)[-1]
    plant.apply(disturbances)
    return plant, state


def speed(state):
    return hypot(*state.twist[:2])


@every_plant
def test_satisfies_the_protocol(make):
    assert isinstance(make(ROBOT), DisturbablePlant)


@every_plant
def test_reset_removes_disturbances_bit_for_bit(make):
    plant = make(ROBOT)
    plant.reset(AT)
    fresh = repr(drive(plant, GOING))
    plant.reset(AT)
    drive(plant, GOING, 4)
    plant.apply(EVERYTHING)
    drive(plant, GOING, 4)
    plant.reset(AT)
    assert repr(drive(plant, GOING)) == fresh


@every_plant
def test_empty_disturbances_change_nothing(make):
    plant = make(ROBOT)
    plant.reset(AT)
    fresh = repr(drive(plant, GOING))
    plant.reset(AT)
    plant.apply(Disturbances())
    assert repr(drive(plant, GOING)) == fresh


@every_plant
def test_removed_disturbances_have_no_effect(make):
    """After their removal the robot moves as without them."""
    plant, _ = disturbed(make, EVERYTHING._replace(impulse=Impulse(0, 0, 0)), GOING)
    drive(plant, GOING, 2)
    plant.apply(Disturbances())
    after = drive(plant, GOING, 10)[-1]
    healthy, _ = disturbed(make, Disturbances(), GOING)
    assert np.array(after.twist) == pytest.approx(drive(healthy, GOING, 10)[-1].twist, abs=0.02)


@every_plant
def test_dead_motor_has_no_torque(make):
    plant, before = disturbed(make, faulty(0, Motor.DEAD), GOING)
    after = drive(plant, GOING)[-1]
    assert after.wheel_torques[0] == 0.0
    assert all(abs(torque) > 0.01 for torque in after.wheel_torques[1:])
    assert np.array(after.twist) == pytest.approx(before.twist, abs=0.02)
    rotation = after.wheel_angles[0] - before.wheel_angles[0]
    assert rotation / 0.8 == pytest.approx(ROBOT.chassis.wheel_speeds(GOING)[0], rel=0.1)


@every_plant
def test_locked_wheel_stops_and_its_motor_has_torque(make):
    plant, before = disturbed(make, faulty(1, Motor.LOCKED), GOING)
    after = drive(plant, GOING)[-1]
    assert after.wheel_angles[1] == pytest.approx(before.wheel_angles[1], abs=0.02)
    torque = ROBOT.servo_gain * ROBOT.chassis.wheel_speeds(GOING)[1]
    assert after.wheel_torques[1] == pytest.approx(np.clip(torque, -50.0, 50.0))


@every_plant
def test_weak_motor_has_half_the_torque(make):
    spin = BodyTwist(0.0, 0.0, 8.0)
    plant, _ = disturbed(make, faulty(0, Motor.WEAK))
    weak, *healthy = plant.step(spin, 0.002).wheel_torques
    assert weak == pytest.approx(0.5 * ROBOT.max_torque)
    assert healthy == pytest.approx([ROBOT.max_torque] * 3)


@every_plant
@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_impulse_changes_the_velocity_by_impulse_over_mass(make, angle):
    """After 2 ms friction has hardly changed the velocity."""
    impulse = 0.5 * ROBOT.mass * np.array([np.cos(angle), np.sin(angle)])
    plant, before = disturbed(make, Disturbances(impulse=Impulse(*impulse.tolist(), 0.0)))
    after = plant.step(STILL, 0.002)
    moved = np.subtract(after.pose, before.pose)[:2] / 0.002
    assert moved == pytest.approx(impulse / ROBOT.mass, abs=0.06)


@every_plant
def test_payload_changes_mass_and_centre_of_mass(make):
    plant, _ = disturbed(make, Disturbances(payload=Payload(ROBOT.mass, 0.0, 0.5)))
    drive(plant, STILL)
    impulse = Impulse(0.5 * ROBOT.mass * np.cos(AT.yaw), 0.5 * ROBOT.mass * np.sin(AT.yaw), 0.0)
    plant.apply(Disturbances(payload=Payload(ROBOT.mass, 0.0, 0.5), impulse=impulse))
    after = plant.step(STILL, 0.002)
    # the common centre of mass is 0.25 m to the left of the impulse: the robot turns left
    assert after.twist.yaw_rate > 0.05
    assert 0.2 < after.twist.vx < 0.45


@every_plant
def test_robot_with_dead_motors_rolls_down_a_slope(make):
    rise = tan(0.1)
    plant, _ = disturbed(make, ALL[Motor.DEAD]._replace(slope=(0.0, rise)))
    after = drive(plant, STILL, 5)[-1]
    free = GRAVITY * np.sin(0.1) * 0.5
    moved = np.subtract(after.pose, AT)
    assert moved[1] < 0.0
    assert abs(moved[0]) < 0.02
    assert 0.5 * free < speed(after) < free  # wheels are accelerated too


@every_plant
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_locked_wheels_slide_with_coulomb_friction(make, friction):
    """Each wheel brakes along its rim only: friction acts with the cosine of 45 degrees."""
    patch = Patch(AT.x, AT.y, 5.0, friction)
    impulse = Impulse(ROBOT.mass * np.cos(AT.yaw), ROBOT.mass * np.sin(AT.yaw), 0.0)
    plant, _ = disturbed(make, ALL[Motor.LOCKED]._replace(patch=patch, impulse=impulse))
    first, last = plant.step(STILL, 0.1), plant.step(STILL, 0.3)
    braking = (speed(first) - speed(last)) / 0.3
    assert braking == pytest.approx(friction * GRAVITY * np.cos(pi / 4), rel=0.1)


@every_plant
def test_distant_patch_has_no_effect(make):
    impulse = Impulse(0.5 * ROBOT.mass * np.cos(AT.yaw), 0.5 * ROBOT.mass * np.sin(AT.yaw), 0.0)
    far = ALL[Motor.LOCKED]._replace(patch=Patch(AT.x + 5.0, AT.y, 1.0, 0.05), impulse=impulse)
    plant, _ = disturbed(make, far)
    with_patch = speed(drive(plant, STILL, 2)[-1])
    plant, _ = disturbed(make, far._replace(patch=None))
    assert with_patch == pytest.approx(speed(drive(plant, STILL, 2)[-1]), abs=1e-6)


@every_plant
def test_pose_offset_moves_the_robot_at_once(make):
    offset = PoseOffset(0.3, -0.4, 2.5)
    plant, before = disturbed(make, Disturbances(offset=offset), GOING)
    after = plant.step(GOING, 0.002)
    assert np.subtract(after.pose, before.pose) == pytest.approx(offset, abs=0.002)
    assert np.array(after.twist) == pytest.approx(before.twist, abs=0.01)


@every_plant
def test_wrong_number_of_motors_is_refused(make):
    plant = make(ROBOT)
    plant.reset(AT)
    with pytest.raises(InvalidInput, match="3 motors for 4 wheels"):
        plant.apply(Disturbances((Motor.DEAD,) * 3))


def test_kinematic_plant_supports_pose_offsets_only():
    plant = KinematicPlant(ROBOT)
    plant.reset(AT)
    plant.apply(Disturbances(offset=PoseOffset(0.3, -0.4, 2.5)))
    assert plant.step(STILL, 0.1).pose == pytest.approx((0.5, -0.5, 2.9))
    for other in (EVERYTHING, ALL[Motor.DEAD], Disturbances(slope=(0.1, 0.0))):
        with pytest.raises(InvalidInput, match="no disturbance but a pose offset"):
            plant.apply(other)
