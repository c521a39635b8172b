"""Contacts of the outline of a robot in MuJoCo."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.geometry.polygon import Polygon
from omnidrive.maps import OccupancyGrid
from omnidrive.planning.footprint import pose_distance
from omnidrive.robot import named_robot
from omnidrive.simulation import MovingObstacle, MujocoPlant
from omnidrive.simulation.mujoco.outline import box_gaps, touches_discs

BOX = ((0.254, 0.215), (-0.254, 0.215), (-0.254, -0.215), (0.254, -0.215))
CHEVRON = ((0.33, 0.0), (-0.21, 0.27), (-0.07, 0.0), (-0.21, -0.27))
FORWARD = BodyTwist(0.4, 0.0, 0.0)


def robot(outline):
    return replace(named_robot("mecanum"), outline=outline)


def wall(yaw=0.0):
    """A wall of 0.1 m with a door of 0.5 m, from x = 2 m on, in the frame of the map."""
    occupied = np.zeros((60, 80), bool)
    occupied[:, 40:42] = True
    occupied[25:35, 40:42] = False
    return OccupancyGrid(occupied, 0.05, walled=False, yaw=yaw)


def drive(plant, pose, command=FORWARD, seconds=4.0):
    plant.reset(pose)
    return [plant.step(command, 0.1) for _ in range(int(10 * seconds))]


@pytest.mark.parametrize("wheels", ["ball", "rollers"])
@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_robot_passes_a_door_at_the_heading_at_which_it_fits(wheels, yaw):
    grid = wall(yaw)
    x, y = grid.points_of(np.array([[30.0, 28.0]]))[0].tolist()
    plant = MujocoPlant(robot(BOX), wheels, obstacles=grid)
    states = drive(plant, Pose(x, y, yaw), seconds=3.5)
    assert states[-1].collisions == 0
    assert np.hypot(states[-1].pose.x - x, states[-1].pose.y - y) > 1.2
    states = drive(plant, Pose(x, y, yaw + 0.5 * pi), BodyTwist(0.0, -0.4, 0.0))
    assert states[-1].collisions == 1
    assert np.hypot(states[-1].pose.x - x, states[-1].pose.y - y) < 0.45
    plant.close()


@pytest.mark.parametrize("outline", [BOX, CHEVRON])
def test_depth_of_contact_is_small(outline):
    plant = MujocoPlant(robot(outline), "ball", obstacles=wall())
    poses = np.array([state.pose for state in drive(plant, Pose(1.2, 0.6, 0.3))])
    depth = -pose_distance(wall(), Polygon.of(np.array(outline)), poses)
    assert 0.0 <= depth < 5e-3
    plant.close()


def test_moving_obstacle_touches_the_outline_and_not_the_circle():
    plant = MujocoPlant(robot(BOX), "ball", moving=[MovingObstacle(0.1, (0.0,), ((0.0, 0.33),))])
    assert drive(plant, Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0), 0.3)[-1].collisions == 0
    assert drive(plant, Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.2, 0.0), 1.0)[-1].collisions == 1
    plant.close()


@pytest.mark.parametrize("outline", [BOX, CHEVRON])
def test_gaps_have_the_sign_of_the_exact_distance(outline):
    polygon, rng = Polygon.of(np.array(outline)), np.random.default_rng(4)
    occupied = np.zeros((30, 30), bool)
    occupied[14:16, 14:16] = True
    grid = OccupancyGrid(occupied, 0.1, walled=False)
    box = np.array([[1.4, 1.6, 1.4, 1.6]])
    poses = np.column_stack([rng.uniform(0.9, 2.1, (300, 2)), rng.uniform(-4.0, 4.0, 300)])
    gaps = box_gaps(polygon, box, poses)[:, 0]
    exact = np.array([pose_distance(grid, polygon, pose[None]) for pose in poses])
    np.testing.assert_array_equal(gaps < 0.0, exact < 0.0)
    assert (gaps <= exact + 1e-9)[exact > 0.0].all()
    ball = np.tile([1.5, 1.5], (300, 1))
    inscribed = touches_discs(polygon, ball, 0.1, poses)
    around = touches_discs(polygon, ball, 0.1 * 2.0**0.5, poses)
    assert (inscribed <= (exact <= 0.0)).all()
    assert ((exact <= 0.0) <= around).all()
