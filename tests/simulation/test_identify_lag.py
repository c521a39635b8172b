"""Identification of lags, and the parameters of the named robots."""

import mujoco
import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import ROBOTS
from omnidrive.simulation import MujocoPlant, PlantCapabilities, PlantState, identify_lag
from omnidrive.simulation.mujoco.robot_model import robot_mjcf
from tests.simulation.test_mujoco_plant import full_inertia


class LaggingPlant:
    """A plant with an exact first-order lag, integrated with backward Euler."""

    capabilities = PlantCapabilities()

    def __init__(self, lag):
        self.lag = np.array([lag[0], lag[0], lag[1]])

    def reset(self, pose):
        self.pose, self.twist = pose, np.zeros(3)
        return PlantState(pose, BodyTwist(0.0, 0.0, 0.0), 0.0)

    def step(self, twist, dt):
        self.twist = self.twist + dt / (self.lag + dt) * (np.array(twist) - self.twist)
        realised = BodyTwist(*self.twist.tolist())
        self.pose = move(self.pose, realised, dt)
        return PlantState(self.pose, realised, 0.0)

    def close(self):
        pass


@pytest.mark.parametrize("lag", [(0.0, 0.0), (0.02, 0.005), (0.3, 0.1)])
def test_lag_is_identified_exactly(lag):
    assert identify_lag(LaggingPlant(lag), np.random.default_rng(1)) == pytest.approx(lag, abs=1e-9)


@pytest.mark.parametrize(
    "name",
    [each if each == "small" else pytest.param(each, marks=pytest.mark.long) for each in ROBOTS],
)
def test_named_robots_have_the_identified_lags(name):
    robot = ROBOTS[name]
    found = identify_lag(MujocoPlant(robot), np.random.default_rng(1))
    assert found == pytest.approx(robot.lag, rel=0.1, abs=1e-4)


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_and_inertia_equal_those_of_mujoco(name):
    robot = ROBOTS[name]
    matrix = full_inertia(mujoco.MjModel.from_xml_string(robot_mjcf(robot, "rollers")))
    assert matrix[0, 0] == pytest.approx(robot.mass)
    assert matrix[5, 5] == pytest.approx(robot.yaw_inertia, rel=0.03)  # wheels are not point masses


def test_plant_without_motion_is_refused():
    class StuckPlant(LaggingPlant):
        def step(self, twist, dt):
            return PlantState(Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), 0.0)

    with pytest.raises(InvalidInput, match="does not follow the commands"):
        identify_lag(StuckPlant((0.0, 0.0)), np.random.default_rng(1))
