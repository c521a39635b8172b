"""The robot on MuJoCo: rigid bodies, friction, motors with limits, obstacles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import atan2, ceil, nan, pi
from typing import get_args

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, WorldTwist, to_body, wrap
from omnidrive.maps import OccupancyGrid
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.moving_obstacle import MovingObstacle
from omnidrive.simulation.mujoco.disturbances import MujocoDisturbances, harden_body
from omnidrive.simulation.mujoco.mjcf import TIMESTEPS, WheelModel, omni_model
from omnidrive.simulation.mujoco.obstacles import MujocoObstacles
from omnidrive.simulation.mujoco.servos import MujocoServos
from omnidrive.simulation.mujoco.walls import Walls
from omnidrive.simulation.plant import PlantCapabilities, PlantState

_SPELL = 0.05  # s after which what is near is looked up again, and motors at their limits
_SETTLING = 0.2  # s for the axle springs to take the load before a run starts


# divergence is read from the counters; MuJoCo would write a log file into the working folder
mujoco.set_mju_user_warning(lambda _: None)


class MujocoPlant:
    """A robot of any wheels in MuJoCo; see :mod:`omnidrive.simulation.mujoco.mjcf` for the models.

    The command becomes wheel speeds by ``robot.drive`` (scaled together when one saturates);
    velocity servos with the robot's torque limit turn the wheels. What is imposed on it and what
    draws it may use :attr:`model` and :attr:`data`; B is the frame of the body ``base``.

    Attributes:
        observer: Called after every physics step of a command; it must change nothing.
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
        """Build the world.

        Args:
            robot: What drives.
            wheels: How its wheels are made.
            rng: What the angles are drawn from at which the wheels' rollers stand in every run;
                None: all wheels stand alike. Balls have no such angle.
            obstacles: The map that stands around the robot; None: an endless floor.
            moving: Obstacles that move, from the time of ``reset`` on.

        Raises:
            InvalidInput: There is no such wheel model, or too much moves.
        """
        if wheels not in get_args(WheelModel):
            raise InvalidInput(
                f"there is no wheel model '{wheels}'; there are {', '.join(get_args(WheelModel))}"
            )
        self.robot = robot
        self.wheels = wheels
        self._drive = robot.drive
        walls = Walls(obstacles) if obstacles is not None else None
        xml = omni_model(robot, wheels, walls=walls, moving=moving)
        self._model = mujoco.MjModel.from_xml_string(xml)
        if wheels == "ball":
            harden_body(self._model)
        self._data = mujoco.MjData(self._model)
        self._obstacles = MujocoObstacles(self._model, robot, walls, moving)
        self._servos = MujocoServos(self._model, self._data)
        self._timestep = TIMESTEPS[wheels]
        self._disturbances = MujocoDisturbances(self._model, robot.mounts)
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
        """The world as MuJoCo has it."""
        return self._model

    @property
    def data(self) -> mujoco.MjData:
        """The world's state."""
        return self._data

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable, with forces, collisions and a model to render."""
        return PlantCapabilities(disturbable=True, collides=True, renders=True, forces=True)

    def close(self) -> None:
        """Do nothing: MuJoCo's memory is freed with the object."""

    def reset(self, pose: Pose) -> PlantState:
        """Stand at rest at ``pose``, springs settled."""
        data = self._data
        self._disturbances.clear()
        mujoco.mj_resetData(self._model, data)
        self._model.opt.timestep = self._timestep
        if self.wheels == "rollers":
            data.qpos[self._joints] = self._phases
        self._obstacles.reset(data)
        self._place(pose)
        mujoco.mj_step(self._model, data, round(_SETTLING / self._timestep))
        data.qvel[:] = 0.0
        self._place(pose)
        data.time = 0.0
        self._obstacles.approach(data)
        mujoco.mj_forward(self._model, data)
        self._start(pose.yaw)
        return self._measure()

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Servo the wheels to ``twist`` for ``dt`` seconds."""
        self._data.ctrl[:] = self._drive.wheel_speeds(self._drive.saturate(twist))
        count = ceil(dt / self._timestep - 1e-9)
        length, torques = dt / count, np.zeros(len(self.robot.mounts))
        spell, done = max(1, round(_SPELL / length)), 0
        while done < count:
            parts = self._servos.parts(length)
            steps = 1 if parts > 1 else min(spell - done % spell, count - done)
            torques += steps * self._advance(steps * parts, length / parts)
            done += steps
        self._torques = torques / count
        for i in self._disturbances.locked:  # what its motor gives against what holds the wheel
            most = self.robot.max_torque
            self._torques[i] = np.clip(self.robot.servo_gain * self._data.ctrl[i], -most, most)
        return self._measure()

    def _advance(self, steps: int, length: float) -> Float[Array, " wheels"]:
        """Do physics steps of ``length`` s; mean torques of the motors, in N m."""
        model, data, advance = self._model, self._data, mujoco.mj_step
        obstacles, disturbances, observer = self._obstacles, self._disturbances, self.observer
        forces, speeds = np.empty((2, steps, model.nu))
        force, speed = data.actuator_force, data.actuator_velocity
        places, place = np.empty((steps, 2)), data.qpos[:2]
        began, watched = data.time, obstacles.approach(data)
        model.opt.timestep = length
        for k in range(steps):
            if watched:
                obstacles.move(data)
            if disturbances.patch is not None:
                disturbances.tread(data)
            advance(model, data)
            forces[k], speeds[k] = force, speed  # at the step's begin
            if watched:
                places[k] = place
            if observer is not None:
                observer()
        if watched:
            obstacles.count(places, began + length * np.arange(1, steps + 1))
        self._work += length * float(np.abs(forces * speeds).sum())
        return self._servos.given(forces, speeds)

    def apply(self, disturbances: Disturbances) -> None:
        """Let ``conditions`` hold from now on; ``reset`` takes them back.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        self._disturbances.apply(disturbances, self._data)
        self._yaw += disturbances.offset.yaw

    def _start(self, yaw: float) -> None:
        """Nothing done yet."""
        wheels = len(self.robot.mounts)
        self._yaw, self._work = yaw, 0.0
        self._torques = np.zeros(wheels)
        self._angles_at_start = self._data.qpos[self._joints].copy()

    def _wheel_angles(self) -> Float[Array, " wheels"]:
        """How far the wheels have turned, in rad."""
        turned = self._data.qpos[self._joints] - self._angles_at_start
        angles: Float[Array, " wheels"] = turned * self._model.actuator_gear[:, 0]
        return angles

    def _place(self, pose: Pose) -> None:
        self._data.qpos[:2] = pose.x, pose.y
        half = 0.5 * pose.yaw
        self._data.qpos[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)

    def _measure(self) -> PlantState:
        """Read B's pose and velocity; the yaw is counted on from the last reading."""
        data = self._data
        collisions = self._obstacles.collisions
        if any(data.warning[int(w)].number for w in _DIVERGED):
            lost = Pose(nan, nan, nan), BodyTwist(nan, nan, nan)
            return PlantState(*lost, nan, collisions=collisions)
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
        )


_DIVERGED = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
