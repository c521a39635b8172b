"""Planar plant: a rigid body whose wheel forces are limited by friction."""

from __future__ import annotations

from math import ceil, cos, pi, sin

import numpy as np

from omnidrive.compiled import entry_point
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.planar.dynamics import integrate
from omnidrive.simulation.planar.model import mass_matrix, planar_model
from omnidrive.simulation.planar.state import PlanarState
from omnidrive.simulation.plant import PlantCapabilities, PlantState

TIMESTEP = 0.002
"""Longest integration step, s."""


class PlanarPlant:
    """A robot of three degrees of freedom; see :mod:`omnidrive.simulation.planar.contact`.

    ``robot.drive`` converts the command into wheel speeds, scaled together if one exceeds its
    limit; velocity servos with the robot's lag and torque limit track them. Every wheel carries its
    share of the weight, which changes with the acceleration, and its force acts along the axis of
    its rollers. Rollers absorb momentum when they reach the floor, and their two rows have
    different distances from the robot's centre. There are no obstacles, and the robot cannot tip.

    Attributes:
        robot: The robot.
        timestep: Longest integration step, s.
    """

    def __init__(
        self,
        robot: Robot,
        rng: np.random.Generator | None = None,
        *,
        timestep: float = TIMESTEP,
    ) -> None:
        """Create the model of the robot on an empty floor.

        Args:
            robot: The robot.
            rng: Generator of the wheel angles at every reset; None: those of the MuJoCo model.
            timestep: Longest integration step, s.
        """
        self.robot = robot
        self.timestep = timestep
        count, pitch = len(robot.mounts), 2.0 * pi / robot.wheel.rollers_per_row
        self._phases = rng.uniform(0.0, pitch, count) if rng is not None else np.zeros(count)
        self._model = planar_model(robot, Disturbances())
        self._state = self._at_rest(Pose(0.0, 0.0, 0.0))
        self._integrate = entry_point(integrate, *self._model, *self._state, 0.0, 0.0, 0.0, 0.1, 1)

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable; it has forces, but no obstacles."""
        return PlantCapabilities(disturbable=True, forces=True)

    def close(self) -> None:
        """Do nothing: the plant holds no resources."""

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``, without disturbances."""
        self._model = planar_model(self.robot, Disturbances())
        self._state = self._at_rest(pose)
        return self._measure()

    def step(self, twist: BodyTwist, dt: float) -> PlantState:
        """Command ``twist`` for ``dt`` seconds."""
        vx, vy, yaw_rate = twist
        steps = ceil(dt / self.timestep - 1e-9)
        self._integrate(
            *self._model, *self._state, float(vx), float(vy), float(yaw_rate), dt / steps, steps
        )
        return self._measure()

    def apply(self, disturbances: Disturbances) -> None:
        """Set the disturbances that act from now on; ``reset`` removes them.

        A pose offset keeps the velocity in B; a payload is added with the velocity of the robot.

        Raises:
            InvalidInput: The number of motors differs from the number of wheels.
        """
        self._model = planar_model(self.robot, disturbances)
        motion, wheels = self._state.motion, self._state.wheels
        for name, change in zip(("x", "y", "yaw"), disturbances.offset, strict=True):
            motion[name] += change
        wheels["speed"][self._model.wheels["locked"]] = 0.0
        c, s = cos(float(motion["yaw"][0])), sin(float(motion["yaw"][0]))
        x, y, turn = disturbances.impulse
        change_of_twist = np.linalg.solve(
            mass_matrix(self._model.body), [c * x + s * y, c * y - s * x, turn]
        )
        for name, change in zip(("vx", "vy", "yaw_rate"), change_of_twist.tolist(), strict=True):
            motion[name] += change

    def _at_rest(self, pose: Pose) -> PlanarState:
        state = PlanarState.at_rest(len(self.robot.mounts), self.robot.wheel.rollers, pose)
        state.wheels["angle"] = self._phases
        return state

    def _measure(self) -> PlantState:
        x, y, yaw, vx, vy, yaw_rate, work, _, _ = self._state.motion.item()
        wheels = self._state.wheels
        return PlantState(
            Pose(x, y, yaw),
            BodyTwist(vx, vy, yaw_rate),
            work,
            tuple((wheels["angle"] - self._phases).tolist()),
            tuple(wheels["torque"].tolist()),
        )
