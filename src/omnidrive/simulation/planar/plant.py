"""Planar plant: a rigid body whose wheel forces are limited by friction."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import entry_point
from omnidrive.control.controller import CommandValue, WheelTorques
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.parameter import Bounds, check_number
from omnidrive.robot import Robot
from omnidrive.simulation.disturbances.disturbances import Disturbances
from omnidrive.simulation.planar.dynamics import integrate, integrate_wheels
from omnidrive.simulation.planar.model import mass_matrix, planar_model
from omnidrive.simulation.planar.state import PlanarState
from omnidrive.simulation.plant import (
    PlantCapabilities,
    PlantState,
    Saturation,
    check_robot,
    check_step,
    count_steps,
)

TIMESTEP = 0.002
"""Longest integration step, s."""
_MAX_STEPS = 100_000  # of one call of a kernel; they take about 30 ms


class PlanarPlant:
    """A robot of three degrees of freedom; see :mod:`omnidrive.simulation.planar.contact`.

    ``robot.drive`` converts a body twist into wheel speeds, scaled together if one exceeds its
    limit; velocity servos with the robot's lag and torque limit track them. A motor with a
    commanded torque is a servo at the largest wheel speed, without lag, whose torque limit is the
    commanded torque: near that speed the torque falls to 0.

    Every wheel carries its share of the weight, which changes with the acceleration, and its force
    acts along the axis of its rollers. Rollers absorb momentum when they reach the floor, and their
    two rows have different distances from the robot's centre. There are no obstacles, and the robot
    cannot tip.

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
            rng: Generator of the initial wheel angles of every run, uniform in one roller pitch.
                None: 0 rad.
            timestep: Longest integration step, 1e-6 to 0.1 s.

        Raises:
            InvalidInput: ``robot`` is not a robot, or the time step is out of range.
        """
        check_robot(robot, "PlanarPlant")
        check_number("timestep", timestep, Bounds(1e-6, 0.1, "s"))
        self.robot = robot
        self.timestep = timestep
        count, pitch = len(robot.mounts), 2.0 * pi / robot.wheel.rollers_per_row
        self._phases = rng.uniform(0.0, pitch, count) if rng is not None else np.zeros(count)
        self._own_limits: Float[Array, " wheels"] | None = None
        """Torque limits of the motors while torques are commanded, N m."""
        self._model = planar_model(robot, Disturbances())
        self._state = self._at_rest(Pose(0.0, 0.0, 0.0))
        self._integrate = entry_point(integrate, *self._model, *self._state, 0.0, 0.0, 0.0, 0.1, 1)

    @property
    def capabilities(self) -> PlantCapabilities:
        """Disturbable, with forces, wheel speeds and torques; it has no obstacles."""
        return PlantCapabilities(
            disturbable=True, forces=True, wheel_speeds=True, wheel_torques=True
        )

    def close(self) -> None:
        """Do nothing: the plant holds no resources."""

    def reset(self, pose: Pose) -> PlantState:
        """Start at rest at ``pose``, without disturbances."""
        self._own_limits = None
        self._model = planar_model(self.robot, Disturbances())
        self._state = self._at_rest(pose)
        return self._measure()

    def step(self, command: CommandValue, dt: float) -> PlantState:
        """Execute ``command`` for ``dt`` seconds.

        Raises:
            InvalidInput: It cannot, see :func:`~omnidrive.simulation.plant.check_step`.
        """
        check_step(command, dt, self.capabilities, len(self.robot.mounts))
        if isinstance(command, WheelTorques):
            return self._step_torques(command, dt)
        self._end_torques()
        if isinstance(command, BodyTwist):
            self._advance(self._integrate, dt, *map(float, command))
            return self._measure()
        self._state.wheels["command"], scaled = self.robot.drive.limited_speeds(command)
        self._advance(integrate_wheels, dt)
        return self._measure(Saturation.WHEEL_SPEED if scaled else 0)

    def _advance(self, kernel: Callable[..., None], dt: float, *twist: float) -> None:
        """Integrate ``dt`` seconds; Python handles signals after every 100,000 steps.

        Args:
            kernel: :func:`integrate` or :func:`integrate_wheels`.
            dt: Duration, s.
            twist: Commanded twist, for :func:`integrate`.
        """
        steps = count_steps(dt, self.timestep)
        h, count = dt / steps, min(steps, _MAX_STEPS)
        kernel(*self._model, *self._state, *twist, h, count)
        if count == steps:
            return
        motion, wheels = self._state.motion, self._state.wheels
        torques, reached, done = count * wheels["torque"], motion["saturated"].copy(), count
        while done < steps:
            count = min(steps - done, _MAX_STEPS)
            kernel(*self._model, *self._state, *twist, h, count)
            torques, done = torques + count * wheels["torque"], done + count
            reached |= motion["saturated"]
        wheels["torque"], motion["saturated"] = torques / steps, reached

    def _step_torques(self, command: WheelTorques, dt: float) -> PlantState:
        """Integrate ``dt`` seconds with the commanded torques."""
        wheels = self._state.wheels
        if self._own_limits is None:
            self._own_limits = self._model.wheels["limit"].copy()
        limits = self._own_limits
        torques = np.clip(command, -limits, limits)
        self._model.wheels["limit"] = np.abs(torques)
        wheels["command"] = np.copysign(self.robot.max_wheel_speed, torques)
        wheels["target"] = wheels["command"]
        self._advance(integrate_wheels, dt)
        self._state.motion["saturated"] &= Saturation.FRICTION
        reached = 0
        if (np.abs(command) > limits).any():
            reached |= Saturation.TORQUE
        if (np.abs(wheels["torque"]) < (1.0 - 1e-6) * np.abs(torques)).any():
            reached |= Saturation.WHEEL_SPEED
        return self._measure(reached)

    def _end_torques(self) -> None:
        """Return to velocity servos with the motors' own limits, from the present wheel speeds."""
        if self._own_limits is not None:
            self._model.wheels["limit"] = self._own_limits
            self._state.wheels["target"] = self._state.wheels["speed"]
            self._own_limits = None

    def apply(self, disturbances: Disturbances) -> None:
        """Set the disturbances that act from now on; ``reset`` removes them.

        A pose offset keeps the velocity in B; a payload is added with the velocity of the robot.

        Raises:
            InvalidInput: The number of motors differs from the number of wheels.
        """
        self._end_torques()
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

    def _measure(self, reached: int = 0) -> PlantState:
        """Return the state; ``reached``: limits in addition to those that the kernel found."""
        x, y, yaw, vx, vy, yaw_rate, work, _, _, saturated = self._state.motion.item()
        wheels = self._state.wheels
        return PlantState(
            Pose(x, y, yaw),
            BodyTwist(vx, vy, yaw_rate),
            work,
            tuple((wheels["angle"] - self._phases).tolist()),
            tuple(wheels["torque"].tolist()),
            0,
            tuple(wheels["speed"].tolist()),
            saturated | reached,
        )
