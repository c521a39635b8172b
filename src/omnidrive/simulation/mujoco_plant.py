"""The robot on MuJoCo: rigid bodies, friction, motors with limits."""

from __future__ import annotations

from math import atan2, ceil, nan
from typing import get_args

import mujoco
import numpy as np

from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, wrap
from omnidrive.robot import Robot
from omnidrive.simulation.mjcf import TIMESTEP, WheelModel, omni_model
from omnidrive.simulation.plant import Measurement

_SETTLING = 0.2  # s for the axle springs to take the load before a run starts


# divergence is read from the counters; MuJoCo would write a log file into the working folder
mujoco.set_mju_user_warning(lambda _: None)


class MujocoPlant:
    """A four-wheel omni robot in MuJoCo; see :mod:`omnidrive.simulation.mjcf` for the models.

    The command becomes wheel speeds by ``robot.drive`` (scaled together when one saturates);
    velocity servos with the robot's torque limit turn the wheels.
    """

    def __init__(self, robot: Robot, wheels: WheelModel = "rollers") -> None:
        if wheels not in get_args(WheelModel):
            raise InvalidInput(
                f"there is no wheel model '{wheels}'; there are {', '.join(get_args(WheelModel))}"
            )
        self.robot = robot
        self.wheels = wheels
        self._drive = robot.drive
        self._model = mujoco.MjModel.from_xml_string(omni_model(robot, wheels))
        self._data = mujoco.MjData(self._model)
        self._yaw = 0.0
        self._work = 0.0
        self._angles = np.zeros(self._model.nu)
        self._torques = np.zeros(self._model.nu)

    def reset(self, pose: Pose) -> Measurement:
        """Stand at rest at ``pose``, springs settled."""
        data = self._data
        mujoco.mj_resetData(self._model, data)
        self._model.opt.timestep = TIMESTEP
        self._place(pose)
        mujoco.mj_step(self._model, data, round(_SETTLING / TIMESTEP))
        data.qvel[:] = 0.0
        self._place(pose)
        mujoco.mj_forward(self._model, data)
        self._yaw, self._work = pose.yaw, 0.0
        self._angles = np.zeros(self._model.nu)
        self._torques = np.zeros(self._model.nu)
        return self._measure()

    def step(self, twist: BodyTwist, dt: float) -> Measurement:
        """Servo the wheels to ``twist`` for ``dt`` seconds."""
        model, data = self._model, self._data
        substeps = ceil(dt / TIMESTEP - 1e-9)
        model.opt.timestep = dt / substeps
        data.ctrl[:] = self._drive.wheel_speeds(self._drive.saturate(twist))
        power = 0.0
        turned, torques = np.zeros(model.nu), np.zeros(model.nu)
        for _ in range(substeps):
            mujoco.mj_step(model, data)
            power += np.abs(data.actuator_force * data.actuator_velocity).sum()
            turned += data.actuator_velocity
            torques += data.actuator_force
        self._work += float(power) * dt / substeps
        self._angles += turned * dt / substeps
        self._torques = torques / substeps
        return self._measure()

    def _place(self, pose: Pose) -> None:
        self._data.qpos[:2] = pose.x, pose.y
        half = 0.5 * pose.yaw
        self._data.qpos[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)

    def _measure(self) -> Measurement:
        """Read B's pose and velocity; the yaw is counted on from the last reading."""
        data = self._data
        if any(data.warning[int(w)].number for w in _DIVERGED):
            return Measurement(Pose(nan, nan, nan), BodyTwist(nan, nan, nan), nan)
        w, x, y, z = data.qpos[3:7].tolist()
        heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        self._yaw += wrap(heading - self._yaw)
        vx, vy, _, _, _, yaw_rate = data.qvel[:6].tolist()
        twist = to_body(WorldTwist(vx, vy, yaw_rate), self._yaw)
        px, py = data.qpos[:2].tolist()
        angles, torques = tuple(self._angles.tolist()), tuple(self._torques.tolist())
        return Measurement(Pose(px, py, self._yaw), twist, self._work, angles, torques)


_DIVERGED = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
