"""MuJoCo plant: rigid bodies, friction, motors with limits, obstacles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, nan, pi
from typing import get_args

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import CommandValue, WheelTorques
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, wrap
from omnidrive.maps import OccupancyGrid
from omnidrive.parameter import check_choice
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.disturbances import MujocoDisturbances, stiffen_body_contacts
from omnidrive.simulation.mujoco.obstacle_boxes import ObstacleBoxes
from omnidrive.simulation.mujoco.obstacles import MujocoObstacles
from omnidrive.simulation.mujoco.robot_model import TIMESTEPS, WheelModel, robot_mjcf
from omnidrive.simulation.mujoco.servos import VelocityServos
from omnidrive.simulation.plant import (
    PlantCapabilities,
    PlantState,
    Saturation,
    check_robot,
    check_step,
    count_steps,
)

_UPDATE_PERIOD = 0.05  # s; period of the updates of near obstacles and of substeps
_SETTLING_TIME = 0.2  # s; time in which the axle springs settle before a run
_WHEEL_SPEED, _TORQUE, _FRICTION = map(
    int, (Saturation.WHEEL_SPEED, Saturation.TORQUE, Saturation.FRICTION)
)
_SLIP_SHARE = 0.95  # share of the friction limit above which a wheel counts as slipping
_ON_CONE = int(mujoco.mjtConstraintState.mjCNSTRSTATE_CONE)


# divergence is read from the counters; without this MuJoCo writes a log file into the folder
mujoco.set_mju_user_warning(lambda _: None)


class MujocoPlant:
    """A robot in MuJoCo; :mod:`omnidrive.simulation.mujoco.robot_model` describes the models.

    ``robot.drive`` converts a body twist into wheel speeds, scaled together if one exceeds its
    limit; velocity servos with the robot's torque limit drive the wheels. :attr:`model` and
    :attr:`data` are public for disturbances and rendering; B is the frame of the body ``base``.

    Attributes:
        observer: Called after every physics step; it must not change the simulation.
    """

    def __init__(
        self,
        robot: Robot,
        wheels: WheelModel = "rollers",
        rng: np.random.Generator | None = None,
        *,
        obstacles: OccupancyGrid | None = None,
        moving: Sequence[MovingObstacle] = (),
    ) -> None:
        """Build the model.

        Args:
            robot: The robot.
            wheels: Model of its wheels.
            rng: Generator of the initial wheel angles of every run, uniform in one roller pitch,
                for wheels with rollers. None: 0 rad.
            obstacles: Map of the obstacles; None: an infinite floor.
            moving: Moving obstacles; their time starts at ``reset``.

        Raises:
            InvalidInput: ``robot`` is not a robot, the wheel model is unknown, or there are too
                many moving obstacles.
        """
        check_robot(robot, "MujocoPlant")
        check_choice("wheel model", wheels, get_args(WheelModel))
        self.robot = robot
        self.wheels = wheels
        self._drive = robot.drive
        walls = ObstacleBoxes(obstacles) if obstacles is not None else None
        xml = robot_mjcf(robot, wheels, walls=walls, moving=moving)
        self._model = mujoco.MjModel.from_xml_string(xml)
        if wheels == "ball":
            stiffen_body_contacts(self._model)
        self._data = mujoco.MjData(self._model)
        self._obstacles = MujocoObstacles(self._model, robot, walls, moving)
        self._servos = VelocityServos(self._model, self._data)
        self._timestep = TIMESTEPS[wheels]
        self._disturbances = MujocoDisturbances(self._model, robot.mounts)
        self._wheel_of_geom = np.full(self._model.ngeom, -1)
        for wheel, geoms in enumerate(self._disturbances.tyre_geoms):
            self._wheel_of_geom[geoms] = wheel
        self._drive_directions = np.array([mount.drive_direction for mount in robot.mounts])
        self._joints = [
            int(self._model.joint(f"wheel{i}").qposadr[0]) for i in range(len(robot.mounts))
        ]
        pitch = 2.0 * pi / robot.wheel.rollers_per_row
        count = len(robot.mounts)
        self._phases = rng.uniform(0.0, pitch, count) if rng is not None else np.zeros(count)
        self.observer: Callable[[], None] | None = None
        self._start(0.0)

    @property
    def model(self) -> mujoco.MjModel:
        """The MuJoCo model."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """The MuJoCo state."""
        return self._data

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable, with forces, collisions, rendering, wheel speeds and torques."""
        return PlantCapabilities(
            disturbable=True,
            collides=True,
            renders=True,
            forces=True,
            wheel_speeds=True,
            wheel_torques=True,
        )

    def close(self) -> None:
        """Do nothing: MuJoCo's memory is freed with the object."""

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``, with settled springs."""
        data = self._data
        self._servos.restore_limits()
        self._disturbances.clear()
        mujoco.mj_resetData(self._model, data)
        self._model.opt.timestep = self._timestep
        if self.wheels == "rollers":
            data.qpos[self._joints] = self._phases
        self._obstacles.reset(data)
        self._set_pose(pose)
        mujoco.mj_step(self._model, data, round(_SETTLING_TIME / self._timestep))
        data.qvel[:] = 0.0
        self._set_pose(pose)
        data.time = 0.0
        self._obstacles.update_boxes(data)
        mujoco.mj_forward(self._model, data)
        self._start(pose.yaw)
        return self._measure()

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Execute ``command`` for ``dt`` seconds.

        Raises:
            InvalidInput: It cannot, see :func:`~omnidrive.simulation.plant.check_step`.
        """
        check_step(command, dt, self.capabilities, len(self.robot.mounts))
        if isinstance(command, WheelTorques):
            self._step_torques(command, dt)
        else:
            speeds, scaled = self._drive.limited_speeds(command)
            self._servos.command_speeds(speeds)
            self._simulate(dt, scaled=scaled)
        return self._measure()

    def _step_torques(self, command: WheelTorques, dt: float) -> None:
        """Simulate ``dt`` seconds with the commanded torques."""
        limited = self._servos.command_torques(command, self.robot.max_wheel_speed)
        self._simulate(dt, scaled=False)
        self._torques[self._disturbances.locked] = limited[self._disturbances.locked]
        works = self._model.actuator_gainprm[:, 0] != 0.0
        reduced = np.abs(self._torques) < (1.0 - 1e-6) * np.abs(limited)
        self._reached &= _FRICTION
        self._reached |= _TORQUE * bool((np.abs(command) > np.abs(limited)).any())
        self._reached |= _WHEEL_SPEED * bool((works & reduced).any())

    def _simulate(self, dt: float, *, scaled: bool) -> None:
        """Simulate ``dt`` seconds; ``scaled``: whether commanded speeds were above the limit."""
        count = count_steps(dt, self._timestep)
        length, torques = dt / count, np.zeros(len(self.robot.mounts))
        period, done = max(1, round(_UPDATE_PERIOD / length)), 0
        reached = _WHEEL_SPEED if scaled else 0
        while done < count:
            substeps = self._servos.substeps(length)
            steps = 1 if substeps > 1 else min(period - done % period, count - done)
            torques += steps * self._advance(steps * substeps, length / substeps)
            done += steps
            if self._servos.at_limit:
                reached |= _TORQUE
            if not reached & _FRICTION and self._slips():
                reached |= _FRICTION
        self._torques, self._speeds = torques / count, self._servos.last_speeds
        self._reached = reached
        for i in self._disturbances.locked:  # torque of the motor of a locked wheel
            limit = self.robot.max_torque
            self._torques[i] = np.clip(self.robot.servo_gain * self._data.ctrl[i], -limit, limit)

    def _slips(self) -> bool:
        """Return whether friction limits the force of a wheel along its drive direction.

        A roller that has just reached the floor is at its limit too, but across that direction.
        """
        data = self._data
        if _ON_CONE not in data.efc_state.tolist():
            return False
        contacts = data.contact
        wheels = self._wheel_of_geom[contacts.geom].max(axis=1)
        of_wheel = (wheels >= 0) & (contacts.efc_address >= 0)
        wheels, rows = wheels[of_wheel], contacts.efc_address[of_wheel]
        tangents = contacts.frame[of_wheel].reshape(-1, 3, 3)[:, 1:, :2]
        to_world = data.body("base").xmat.reshape(3, 3)[:2, :2]
        components = np.einsum("cij,cj->ci", tangents, self._drive_directions[wheels] @ to_world.T)
        normal, first, second = (data.efc_force[rows + k] for k in range(3))
        driving = np.bincount(wheels, first * components[:, 0] + second * components[:, 1])
        limits = np.bincount(wheels, contacts.friction[of_wheel, 1] * normal)
        return bool((np.abs(driving) > _SLIP_SHARE * np.maximum(limits, 1e-9)).any())

    def _advance(self, steps: int, length: float) -> Float[Array, " wheels"]:
        """Make physics steps of ``length`` (s); return the mean torque of each motor, N m."""
        model, data, advance = self._model, self._data, mujoco.mj_step
        obstacles, disturbances, observer = self._obstacles, self._disturbances, self.observer
        forces, speeds = np.empty((2, steps, model.nu))
        force, speed = data.actuator_force, data.actuator_velocity
        places, place = np.empty((steps, 7)), data.qpos[:7]
        start, has_obstacles = data.time, obstacles.update_boxes(data)
        model.opt.timestep = length
        for k in range(steps):
            if has_obstacles:
                obstacles.move_obstacles(data)
            if disturbances.patch is not None:
                disturbances.update_patch(data)
            advance(model, data)
            forces[k], speeds[k] = force, speed  # at the start of the step
            if has_obstacles:
                places[k] = place
            if observer is not None:
                observer()
        if has_obstacles:
            obstacles.count_collisions(places, start + length * np.arange(1, steps + 1))
        self._work += length * float(np.abs(forces * speeds).sum())
        return self._servos.mean_torques(forces, speeds)

    def apply(self, disturbances: Disturbances) -> None:
        """Set the disturbances that act from now on; ``reset`` removes them.

        Raises:
            InvalidInput: The number of motors differs from the number of wheels.
        """
        self._servos.restore_limits()
        self._disturbances.apply(disturbances, self._data)
        self._yaw += disturbances.offset.yaw

    def _start(self, yaw: float) -> None:
        """Set what the plant reports besides MuJoCo's state to its initial values."""
        wheels = len(self.robot.mounts)
        self._yaw, self._work = yaw, 0.0
        self._torques, self._speeds = np.zeros(wheels), np.zeros(wheels)
        self._reached = 0
        self._initial_positions = self._data.qpos[self._joints].copy()

    def _wheel_angles(self) -> Float[Array, " wheels"]:
        """Return the angle of each wheel since ``reset``, rad."""
        turned = self._data.qpos[self._joints] - self._initial_positions
        angles: Float[Array, " wheels"] = turned * self._model.actuator_gear[:, 0]
        return angles

    def _set_pose(self, pose: Pose) -> None:
        self._data.qpos[:2] = pose.x, pose.y
        half = 0.5 * pose.yaw
        self._data.qpos[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)

    def _measure(self) -> PlantState:
        """Return the state; the yaw is continued from the last one without a jump."""
        data = self._data
        collisions = self._obstacles.collisions
        if any(data.warning[int(w)].number for w in _DIVERGED):
            diverged = Pose(nan, nan, nan), BodyTwist(nan, nan, nan)
            return PlantState(*diverged, nan, collisions=collisions)
        w, x, y, z = data.qpos[3:7].tolist()
        heading = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        self._yaw += wrap(heading - self._yaw)
        vx, vy, _, _, _, yaw_rate = data.qvel[:6].tolist()
        twist = to_body(WorldTwist(vx, vy, yaw_rate), self._yaw)
        px, py = data.qpos[:2].tolist()
        return PlantState(
            Pose(px, py, self._yaw),
            twist,
            self._work,
            wheel_angles=tuple(self._wheel_angles().tolist()),
            wheel_torques=tuple(self._torques.tolist()),
            collisions=collisions,
            wheel_speeds=tuple(self._speeds.tolist()),
            saturated=self._reached,
        )


_DIVERGED = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
