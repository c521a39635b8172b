"""Velocity servos of the motors in MuJoCo: commands, stable step lengths and mean torques."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

_MAX_SUBSTEPS = 20  # the stiffest servo of the named robots needs 5


class VelocityServos:
    """Velocity servos of one model, each acting on one hinge.

    A motor with a commanded torque is a servo at the largest wheel speed whose torque limit is the
    commanded torque: near that speed the torque falls to 0.

    Attributes:
        at_limit: Whether a motor was at its torque limit in the last steps.
        last_speeds: Speed of each wheel at their end, rad/s.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look up the hinges of the wheels."""
        self._model, self._data = model, data
        self._dofs = model.jnt_dofadr[model.actuator_trnid[:, 0]]
        self._gears = model.actuator_gear[:, 0]
        self._own_limits: Float[Array, "wheels 2"] | None = None
        self.at_limit = False
        self.last_speeds = np.zeros(model.nu)

    @property
    def speeds(self) -> Float[Array, " wheels"]:
        """Speed of each wheel, rad/s."""
        speeds: Float[Array, " wheels"] = self._gears * self._data.qvel[self._dofs]
        return speeds

    def command_speeds(self, speeds: Float[Array, " wheels"]) -> None:
        """Set the commanded wheel speeds, rad/s."""
        self.restore_limits()
        self._data.ctrl[:] = speeds

    def command_torques(
        self, torques: Sequence[float], max_speed: float
    ) -> Float[Array, " wheels"]:
        """Set the commanded torques; return those within the limits of the motors, N m.

        Args:
            torques: Torque of each motor, N m.
            max_speed: Largest wheel speed, rad/s.
        """
        model, data = self._model, self._data
        if self._own_limits is None:
            self._own_limits = model.actuator_forcerange.copy()
        largest = self._own_limits[:, 1]
        limited: Float[Array, " wheels"] = np.clip(torques, -largest, largest)
        model.actuator_forcerange[:, 1] = np.abs(limited)
        model.actuator_forcerange[:, 0] = -np.abs(limited)
        data.ctrl[:] = np.copysign(max_speed, limited)
        if model.na:  # torques do not lag behind their commands
            data.act[:] = data.ctrl
        return limited

    def restore_limits(self) -> None:
        """End commanded torques: the motors have their own limits, and start at their speeds."""
        if self._own_limits is not None:
            self._model.actuator_forcerange[:] = self._own_limits
            self._own_limits = None
            if self._model.na:
                self._data.act[:] = self.speeds

    def substeps(self, length: float) -> int:
        """Return the number of equal substeps that a physics step of ``length`` (s) needs now.

        MuJoCo holds the torque of a motor at its limit constant during a step. If it accelerates a
        slipping wheel so far beyond its set point that the servo saturates in the other direction,
        the speed oscillates and the wheel transmits hardly any force. With servo gain g and inertia
        J this occurs in steps longer than 2 J / g.
        """
        model, data, gears = self._model, self._data, self._gears
        gains, set_points = -model.actuator_biasprm[:, 2], data.act if model.na else data.ctrl
        torques = model.actuator_gainprm[:, 0] * set_points - gains * gears * data.qvel[self._dofs]
        limited = model.actuator_forcelimited.astype(bool)
        saturated = (np.abs(torques) > model.actuator_forcerange[:, 1]) & limited
        if self._own_limits is not None:  # of commanded torques, which are limits at every speed
            errors = np.abs(set_points - self.speeds) * model.dof_M0[self._dofs] / gears**2
            saturated &= errors <= length * model.actuator_forcerange[:, 1]
        if not saturated.any():
            return 1
        inertias = model.dof_M0[self._dofs] / gears**2
        return min(ceil(length * float((gains / inertias)[saturated].max()) / 2.0), _MAX_SUBSTEPS)

    def mean_torques(
        self, forces: Float[Array, "steps wheels"], speeds: Float[Array, "steps wheels"]
    ) -> Float[Array, " wheels"]:
        """Return the mean torque of each motor over the last steps, N m.

        MuJoCo reports torques at the start of a step; its integrator applies the servo's torque at
        the speed at the end of the step, unless the motor is at its limit.

        Args:
            forces: Torques at the start of every step, N m.
            speeds: Wheel speeds at the start of every step, rad/s.
        """
        model = self._model
        limits, gains = model.actuator_forcerange[:, 1], -model.actuator_biasprm[:, 2]
        changes = np.empty_like(speeds)
        changes[:-1] = speeds[1:]
        self.last_speeds = changes[-1] = self.speeds
        changes -= speeds
        below = np.abs(forces) < limits
        self.at_limit = np.count_nonzero(below) < below.size
        corrections = gains * changes * below
        mean: Float[Array, " wheels"] = (forces - corrections).sum(axis=0) / len(forces)
        return mean
