"""Identification finds what the plant does, and the named robots say what it finds."""

import mujoco
import numpy as np
import pytest

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.robot import ROBOTS
from omnidrive.simulation import MujocoPlant, PlantCapabilities, PlantState, identify_lag
from omnidrive.simulation.mujoco.robot_model import robot_mjcf


class Lagging:
    """A robot that follows with backward Euler of a lag, exactly."""

    capabilities = PlantCapabilities()

    def __init__(self, lag):
        self.lag = np.array([lag[0], lag[0], lag[1]])

    def reset(self, pose):
        self.pose, self.twist = pose, np.zeros(3)
        return PlantState(pose, BodyTwist(0.0, 0.0, 0.0), 0.0)

    def step(self, twist, dt):
        self.twist = self.twist + dt / (self.lag + dt) * (np.array(twist) - self.twist)
        done = BodyTwist(*self.twist.tolist())
        self.pose = move(self.pose, done, dt)
        return PlantState(self.pose, done, 0.0)

    def close(self):
        pass


@pytest.mark.parametrize("lag", [(0.0, 0.0), (0.02, 0.005), (0.3, 0.1)])
def test_a_lag_is_found_exactly(lag):
    assert identify_lag(Lagging(lag), np.random.default_rng(1)) == pytest.approx(lag, abs=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_named_robots_have_the_lags_that_are_found(name):
    robot = ROBOTS[name]
    found = identify_lag(MujocoPlant(robot), np.random.default_rng(1))
    assert found == pytest.approx(robot.lag, rel=0.1, abs=1e-4)


@pytest.mark.parametrize("name", ROBOTS)
def test_mass_and_inertia_are_those_of_the_physics(name):
    robot = ROBOTS[name]
    model = mujoco.MjModel.from_xml_string(robot_mjcf(robot, "rollers"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    about = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, about)
    assert about[0, 0] == pytest.approx(robot.mass)
    assert about[5, 5] == pytest.approx(robot.yaw_inertia, rel=0.03)  # wheels are not points


def test_a_robot_that_stands_still_is_refused():
    class Stuck(Lagging):
        def step(self, twist, dt):
            return PlantState(Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), 0.0)

    with pytest.raises(InvalidInput, match="does not do what it is asked"):
        identify_lag(Stuck((0.0, 0.0)), np.random.default_rng(1))
