"""The planar plant: a rigid body whose wheels push as far as the floor holds them."""

from __future__ import annotations

from math import ceil, cos, pi, sin

import numpy as np

from omnidrive.compiled import entry_point
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.planar.dynamics import drive
from omnidrive.simulation.planar.model import mass_matrix, model_of
from omnidrive.simulation.planar.state import State
from omnidrive.simulation.plant import PlantCapabilities, PlantState

TIMESTEP = 0.002
"""Longest step in s."""


class PlanarPlant:
    """A robot of three degrees of freedom; see :mod:`omnidrive.simulation.planar.traction`.

    The command becomes wheel speeds by ``robot.drive`` (scaled together when one saturates), which
    velocity servos with the robot's lag and torque limit follow. Every wheel carries its share of
    the weight, more or less of it as the robot accelerates, and pushes along its rollers' axis.
    Rollers show in what they take of the robot's momentum, and in the two rows' distances from its
    centre; nothing stands in the way, and nothing tips over.

    Attributes:
        robot: What moves.
        timestep: Longest step in s.
    """

    def __init__(
        self,
        robot: Robot,
        rng: np.random.Generator | None = None,
        *,
        timestep: float = TIMESTEP,
    ) -> None:
        """A robot on an empty floor.

        Args:
            robot: What moves.
            rng: What the angles at which the wheels stand at every reset are drawn from; None: they
                are those of MuJoCo's model.
            timestep: Longest step in s.
        """
        self.robot = robot
        self.timestep = timestep
        count, pitch = len(robot.mounts), 2.0 * pi / robot.wheel.rollers_per_row
        self._phases = rng.uniform(0.0, pitch, count) if rng is not None else np.zeros(count)
        self._model = model_of(robot, Disturbances())
        self._state = self._at_rest(Pose(0.0, 0.0, 0.0))
        self._drive = entry_point(drive, *self._model, *self._state, 0.0, 0.0, 0.0, 0.1, 1)

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable; it has forces, but no obstacles."""
        return PlantCapabilities(disturbable=True, forces=True)

    def close(self) -> None:
        """Do nothing: the plant holds no resources."""

    def reset(self, pose: Pose) -> PlantState:
        """Stand at rest at ``pose``; nothing is imposed."""
        self._model = model_of(self.robot, Disturbances())
        self._state = self._at_rest(pose)
        return self._measure()

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Servo the wheels to ``twist`` for ``dt`` seconds."""
        vx, vy, yaw_rate = twist
        steps = ceil(dt / self.timestep - 1e-9)
        self._drive(
            *self._model, *self._state, float(vx), float(vy), float(yaw_rate), dt / steps, steps
        )
        return self._measure()

    def apply(self, disturbances: Disturbances) -> None:
        """Let ``conditions`` hold from now on; ``reset`` takes them back.

        A robot that is carried elsewhere keeps its velocity in B; a payload arrives with it.

        Raises:
            InvalidInput: They speak of wheels that the robot does not have.
        """
        self._model = model_of(self.robot, disturbances)
        motion, spins = self._state.motion, self._state.spins
        for name, change in zip(("x", "y", "yaw"), disturbances.offset, strict=True):
            motion[name] += change
        spins["speed"][self._model.wheels["locked"]] = 0.0
        c, s = cos(float(motion["yaw"][0])), sin(float(motion["yaw"][0]))
        x, y, turn = disturbances.impulse
        kick = np.linalg.solve(mass_matrix(self._model.frame), [c * x + s * y, c * y - s * x, turn])
        for name, change in zip(("vx", "vy", "yaw_rate"), kick.tolist(), strict=True):
            motion[name] += change

    def _at_rest(self, pose: Pose) -> State:
        state = State.at_rest(len(self.robot.mounts), self.robot.wheel.rollers, pose)
        state.spins["angle"] = self._phases
        return state

    def _measure(self) -> PlantState:
        x, y, yaw, vx, vy, yaw_rate, work, _, _ = self._state.motion.item()
        spins = self._state.spins
        return PlantState(
            Pose(x, y, yaw),
            BodyTwist(vx, vy, yaw_rate),
            work,
            tuple((spins["angle"] - self._phases).tolist()),
            tuple(spins["torque"].tolist()),
        )
