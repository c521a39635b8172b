"""Laws of plants that conditions act on. A new one is added to PLANTS, nothing else."""

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


def broken(wheel, motor):
    """Conditions under which one motor is not healthy."""
    motors = [Motor.HEALTHY] * len(ROBOT.mounts)
    motors[wheel] = motor
    return Disturbances(tuple(motors))


def drive(plant, twist, steps=8, dt=0.1):
    return [plant.step(twist, dt) for _ in range(steps)]


def begun(make, conditions, twist=STILL, steps=8):
    """A plant that was driven for a while, and on which conditions then act."""
    plant = make(ROBOT)
    plant.reset(AT)
    state = drive(plant, twist, steps)[-1]
    plant.apply(conditions)
    return plant, state


def speed(state):
    return hypot(*state.twist[:2])


@every_plant
def test_satisfies_the_protocol(make):
    assert isinstance(make(ROBOT), DisturbablePlant)


@every_plant
def test_reset_takes_all_back_bit_for_bit(make):
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
def test_nothing_changes_nothing(make):
    plant = make(ROBOT)
    plant.reset(AT)
    fresh = repr(drive(plant, GOING))
    plant.reset(AT)
    plant.apply(Disturbances())
    assert repr(drive(plant, GOING)) == fresh


@every_plant
def test_what_ends_is_over(make):
    """After conditions were taken back, the robot goes on as if they had never been."""
    plant, _ = begun(make, EVERYTHING._replace(impulse=Impulse(0, 0, 0)), GOING)
    drive(plant, GOING, 2)
    plant.apply(Disturbances())
    after = drive(plant, GOING, 10)[-1]
    healthy, _ = begun(make, Disturbances(), GOING)
    assert np.array(after.twist) == pytest.approx(drive(healthy, GOING, 10)[-1].twist, abs=0.02)


@every_plant
def test_a_dead_motor_gives_no_torque_and_the_others_drive_on(make):
    plant, before = begun(make, broken(0, Motor.DEAD), GOING)
    after = drive(plant, GOING)[-1]
    assert after.wheel_torques[0] == 0.0
    assert all(abs(torque) > 0.01 for torque in after.wheel_torques[1:])
    assert np.array(after.twist) == pytest.approx(before.twist, abs=0.02)
    turned = after.wheel_angles[0] - before.wheel_angles[0]
    assert turned / 0.8 == pytest.approx(ROBOT.chassis.wheel_speeds(GOING)[0], rel=0.1)


@every_plant
def test_a_locked_wheel_stands_and_its_motor_strains(make):
    plant, before = begun(make, broken(1, Motor.LOCKED), GOING)
    after = drive(plant, GOING)[-1]
    assert after.wheel_angles[1] == pytest.approx(before.wheel_angles[1], abs=0.02)
    asked = ROBOT.servo_gain * ROBOT.chassis.wheel_speeds(GOING)[1]
    assert after.wheel_torques[1] == pytest.approx(np.clip(asked, -50.0, 50.0))


@every_plant
def test_a_weak_motor_gives_half(make):
    spin = BodyTwist(0.0, 0.0, 8.0)
    plant, _ = begun(make, broken(0, Motor.WEAK))
    weak, *healthy = plant.step(spin, 0.002).wheel_torques
    assert weak == pytest.approx(0.5 * ROBOT.max_torque)
    assert healthy == pytest.approx([ROBOT.max_torque] * 3)


@every_plant
@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_an_impulse_changes_the_velocity_by_itself_over_the_mass(make, angle):
    """2 ms later friction on the floor has had no time yet."""
    blow = 0.5 * ROBOT.mass * np.array([np.cos(angle), np.sin(angle)])
    plant, before = begun(make, Disturbances(impulse=Impulse(*blow.tolist(), 0.0)))
    after = plant.step(STILL, 0.002)
    moved = np.subtract(after.pose, before.pose)[:2] / 0.002
    assert moved == pytest.approx(blow / ROBOT.mass, abs=0.06)


@every_plant
def test_a_payload_makes_it_heavier_and_lopsided(make):
    plant, _ = begun(make, Disturbances(payload=Payload(ROBOT.mass, 0.0, 0.5)))
    drive(plant, STILL)
    blow = Impulse(0.5 * ROBOT.mass * np.cos(AT.yaw), 0.5 * ROBOT.mass * np.sin(AT.yaw), 0.0)
    plant.apply(Disturbances(payload=Payload(ROBOT.mass, 0.0, 0.5), impulse=blow))
    after = plant.step(STILL, 0.002)
    # the blow passes the common centre of mass, which lies 0.25 m to the left: it turns left
    assert after.twist.yaw_rate > 0.05
    assert 0.2 < after.twist.vx < 0.45


@every_plant
def test_with_dead_wheels_it_rolls_down_a_slope(make):
    rise = tan(0.1)
    plant, _ = begun(make, ALL[Motor.DEAD]._replace(slope=(0.0, rise)))
    after = drive(plant, STILL, 5)[-1]
    free = GRAVITY * np.sin(0.1) * 0.5
    moved = np.subtract(after.pose, AT)
    assert moved[1] < 0.0
    assert abs(moved[0]) < 0.02
    assert 0.5 * free < speed(after) < free  # wheels have to be turned, too


@every_plant
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_locked_wheels_slide_as_friction_says(make, friction):
    """Each resists along its rim only: friction acts with the cosine of 45 degrees."""
    patch = Patch(AT.x, AT.y, 5.0, friction)
    blow = Impulse(ROBOT.mass * np.cos(AT.yaw), ROBOT.mass * np.sin(AT.yaw), 0.0)
    plant, _ = begun(make, ALL[Motor.LOCKED]._replace(patch=patch, impulse=blow))
    first, last = plant.step(STILL, 0.1), plant.step(STILL, 0.3)
    braking = (speed(first) - speed(last)) / 0.3
    assert braking == pytest.approx(friction * GRAVITY * np.cos(pi / 4), rel=0.1)


@every_plant
def test_a_patch_is_where_it_is_and_nowhere_else(make):
    blow = Impulse(0.5 * ROBOT.mass * np.cos(AT.yaw), 0.5 * ROBOT.mass * np.sin(AT.yaw), 0.0)
    far = ALL[Motor.LOCKED]._replace(patch=Patch(AT.x + 5.0, AT.y, 1.0, 0.05), impulse=blow)
    plant, _ = begun(make, far)
    away = speed(drive(plant, STILL, 2)[-1])
    plant, _ = begun(make, far._replace(patch=None))
    assert away == pytest.approx(speed(drive(plant, STILL, 2)[-1]), abs=1e-6)


@every_plant
def test_it_is_carried_elsewhere_at_once(make):
    jump = PoseOffset(0.3, -0.4, 2.5)
    plant, before = begun(make, Disturbances(offset=jump), GOING)
    after = plant.step(GOING, 0.002)
    assert np.subtract(after.pose, before.pose) == pytest.approx(jump, abs=0.002)
    assert np.array(after.twist) == pytest.approx(before.twist, abs=0.01)


@every_plant
def test_wheels_that_are_not_there_are_refused(make):
    plant = make(ROBOT)
    plant.reset(AT)
    with pytest.raises(InvalidInput, match="3 motors for 4 wheels"):
        plant.apply(Disturbances((Motor.DEAD,) * 3))


def test_without_forces_only_a_jump_means_something():
    plant = KinematicPlant(ROBOT)
    plant.reset(AT)
    plant.apply(Disturbances(offset=PoseOffset(0.3, -0.4, 2.5)))
    assert plant.step(STILL, 0.1).pose == pytest.approx((0.5, -0.5, 2.9))
    for other in (EVERYTHING, ALL[Motor.DEAD], Disturbances(slope=(0.1, 0.0))):
        with pytest.raises(InvalidInput, match="take the plant rollers, ball or planar"):
            plant.apply(other)
