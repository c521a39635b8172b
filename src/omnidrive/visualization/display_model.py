"""MuJoCo model that displays the robot at given poses, of other plants and of logs."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import Robot
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes
from omnidrive.simulation.mujoco.robot_model import robot_mjcf
from omnidrive.simulation.plant import PlantState


class DisplayModel:
    """MuJoCo model of the robot whose pose and wheel angles are set, not simulated.

    Attributes:
        model: The MuJoCo model.
        data: Its state; only positions are valid.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        obstacles: OccupancyGrid | None = None,
        moving: Sequence[MovingObstacle] = (),
    ) -> None:
        """Build the model.

        Args:
            robot: The robot.
            obstacles: Map to draw.
            moving: Moving obstacles to draw.
        """
        walls = ObstacleBoxes(obstacles) if obstacles is not None else None
        xml = robot_mjcf(robot, "rollers", walls=walls, moving=moving)
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        self._chassis = robot.chassis
        self._height = robot.wheel.radius
        self._moving = tuple(moving)
        wheels = range(len(robot.mounts))
        self._joints = [int(self.model.joint(f"wheel{i}").qposadr[0]) for i in wheels]
        self.set_pose(0.0, Pose(0.0, 0.0, 0.0), np.zeros(len(wheels)))

    def set_pose(self, t: float, pose: Pose, wheel_angles: Float[Array, " wheels"]) -> None:
        """Set the time (s), the pose of B in W and the wheel angles (rad).

        The angles have the signs of the wheel matrix. The moving obstacles are placed where they
        are at this time.
        """
        x, y, yaw = pose
        data = self.data
        data.time = t
        data.qpos[:7] = x, y, self._height, cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)
        data.qpos[self._joints] = wheel_angles
        for k, obstacle in enumerate(self._moving):
            data.mocap_pos[k, :2] = obstacle.position(t)
        update_kinematics(self.model, data)

    def next_wheel_angles(
        self, before: PlantState, after: PlantState, angles: Float[Array, " wheels"], dt: float
    ) -> Float[Array, " wheels"]:
        """Return the wheel angles (rad) at ``after``, ``dt`` s later than ``angles`` at ``before``.

        They are those in ``after`` or, if it has none, those of wheels that roll without slip at
        the mean of both body twists. The signs are those of the wheel matrix.
        """
        if len(after.wheel_angles) == len(angles):
            return np.array(after.wheel_angles)
        mean = BodyTwist(*(0.5 * (np.array(before.twist) + np.array(after.twist))).tolist())
        rolled: Float[Array, " wheels"] = angles + dt * self._chassis.wheel_speeds(mean)
        return rolled


def update_kinematics(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compute the poses of bodies, cameras and lights from ``qpos`` and the mocap positions."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)


def interpolate_pose(before: PlantState, after: PlantState, dt: float, fraction: float) -> Pose:
    """Return the pose of B in W at a fraction (0 to 1) of the ``dt`` seconds between two states.

    It is the cubic Hermite interpolation of their poses and velocities in W.
    """
    first, last = np.array(before.pose), np.array(after.pose)
    rates = [dt * _in_world(state) for state in (before, after)]
    s = fraction
    pose = (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * first
        + s * (1.0 - s) ** 2 * rates[0]
        + s * s * (3.0 - 2.0 * s) * last
        + s * s * (s - 1.0) * rates[1]
    )
    return Pose(*pose.tolist())


def _in_world(state: PlantState) -> Float[Array, " 3"]:
    c, s = cos(state.pose.yaw), sin(state.pose.yaw)
    vx, vy, rate = state.twist
    return np.array([c * vx - s * vy, s * vx + c * vy, rate])
