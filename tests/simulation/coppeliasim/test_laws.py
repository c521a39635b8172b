"""Properties of every plant, tested with the vendor's client and the fake server."""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.control import FeedforwardController, WheelTorques
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    CoppeliaSimPlant,
    CoppeliaSimScene,
    MujocoPlant,
    Outcome,
    Plant,
    Saturation,
    simulate,
)
from omnidrive.testing.laws import Circle
from tests.laws import test_plants as laws
from tests.simulation.coppeliasim.fake_server import fake_server


@pytest.fixture
def make():
    """Return a factory of plants, each with its own fake server with the robot's true geometry."""
    with ExitStack() as stack:

        def build(robot, step=0.05, **options):
            server = stack.enter_context(
                fake_server(replace(robot, assumed_effective_radius=None), step=step)
            )
            scene = CoppeliaSimScene(port=server.port, timeout=20.0, **options)
            plant = stack.enter_context(CoppeliaSimPlant(robot, scene))
            plant.server = server
            return plant

        yield build


def test_satisfies_the_protocol(make):
    assert isinstance(make(named_robot("small")), Plant)


@pytest.mark.parametrize("robot", ["paper", "small"])
def test_starts_at_the_given_pose(make, robot):
    laws.test_starts_at_rest_at_the_given_pose(make, robot)


@pytest.mark.parametrize(
    "law",
    [
        laws.test_saturated_command_keeps_its_direction,
        laws.test_wrong_effective_radius_scales_the_yaw_rate,
        laws.test_yaw_is_continuous_over_whole_turns,
    ],
    ids=lambda law: law.__name__.removeprefix("test_"),
)
def test_has_the_property_of_every_plant(make, law):
    law(make)


def test_two_runs_are_bit_identical(make):
    """Also with one plant object: reset clears its state."""
    robot, twist = named_robot("paper"), BodyTwist(0.4, -0.3, 0.9)
    plant = make(robot)
    once, again, fresh = (
        laws.drive(p, Pose(0.0, 0.0, 0.0), twist, 10) for p in (plant, plant, make(robot))
    )
    assert repr(once) == repr(again) == repr(fresh)


def test_reports_the_velocity_of_its_pose(make):
    laws.test_reported_velocity_is_the_derivative_of_the_pose(lambda robot: make(robot, step=0.01))


@pytest.mark.parametrize("twist", laws.TWISTS)
def test_rotation_of_the_world_rotates_the_motion(make, twist):
    laws.test_rotation_of_the_world_rotates_the_motion(make, twist)


@pytest.mark.parametrize("robot", ["paper", "small"])
@pytest.mark.parametrize("twist", laws.TWISTS)
def test_mean_velocity_equals_the_command(make, robot, twist):
    states = laws.drive(make(named_robot(robot)), Pose(0.0, 0.0, 0.0), twist, 40)
    velocity = np.subtract(states[-1].pose, states[9].pose) / 3.0
    assert velocity == pytest.approx(np.array(twist), abs=5e-4)


def test_wheel_angles_are_continuous_over_whole_turns(make):
    """At 1 m/s a wheel turns by 40 rad in 2 s, up to one radian between readings."""
    robot = named_robot("small")
    plant = make(robot)
    twist = BodyTwist(1.0, 0.2, 0.5)
    state = laws.drive(plant, Pose(0.0, 0.0, 0.0), twist, 20)[-1]
    assert state.wheel_angles == pytest.approx(plant.server.scene.angles, abs=1e-6)
    assert state.wheel_angles == pytest.approx(2.0 * robot.chassis.wheel_speeds(twist), rel=0.1)
    assert state.wheel_torques == ()  # the simulator reports instantaneous torques, not means
    assert state.work > 0.5 * robot.mass * 1.0


def test_wheel_speeds_of_a_twist_give_the_motion_of_the_twist(make):
    twist = BodyTwist(0.5, -0.2, 0.7)
    laws.test_wheel_speeds_of_a_twist_give_the_motion_of_the_twist(make, "small", twist)


def test_wheel_torques_are_refused(make):
    plant = make(named_robot("small"))
    plant.reset(Pose(0.0, 0.0, 0.0))
    with pytest.raises(InvalidInput, match="this plant does not execute wheel torques"):
        plant.step(WheelTorques([0.1] * 4), 0.1)


def test_reports_wheel_speeds_and_their_limit(make):
    plant = make(named_robot("small"))
    twist = BodyTwist(0.4, 0.2, 0.5)
    state = laws.drive(plant, Pose(0.0, 0.0, 0.0), twist, 20)[-1]
    expected = plant.robot.chassis.wheel_speeds(twist)
    assert state.wheel_speeds == pytest.approx(expected, rel=0.05, abs=0.1)
    assert state.saturated == Saturation.NONE
    assert plant.step(BodyTwist(9.0, 0.0, 0.0), 0.1).saturated == Saturation.WHEEL_SPEED


def test_body_object_with_another_orientation(make):
    """The x axis of the object points backwards in B."""
    plant = make(named_robot("small"), body_yaw=np.pi)
    start = Pose(1.0, 2.0, 0.5)
    assert np.array(plant.reset(start).pose) == pytest.approx(start, abs=1e-12)
    assert plant.server.scene.motion.pose.yaw == pytest.approx(0.5 - np.pi)


def test_closed_loop_equals_that_of_the_simulated_plant(make):
    robot = named_robot("small")
    reference = Circle(duration=4.0)

    def drive(plant):
        start = reference.at(0.0).pose
        return simulate(plant, FeedforwardController(0.1), reference, start=start, dt=0.1)

    remote, direct = drive(make(robot)), drive(MujocoPlant(robot, "ball"))
    assert remote.outcome is Outcome.FINISHED
    assert remote.pose == pytest.approx(direct.pose, abs=1e-9)
    assert remote.twist == pytest.approx(direct.twist, abs=1e-8)
    assert remote.work[-1] == pytest.approx(direct.work[-1], rel=0.2)
