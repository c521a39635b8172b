"""Velocity servos of the motors in MuJoCo: stable step lengths and mean torques."""

from __future__ import annotations

from math import ceil

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

_MAX_SUBSTEPS = 20  # the stiffest servo of the named robots needs 5


class VelocityServos:
    """Velocity servos of one model, each acting on one hinge."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Look up the hinges of the wheels."""
        self._model, self._data = model, data
        self._dofs = model.jnt_dofadr[model.actuator_trnid[:, 0]]
        self._gears = model.actuator_gear[:, 0]

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
        changes[-1] = self._gears * self._data.qvel[self._dofs]
        changes -= speeds
        corrections = gains * changes * (np.abs(forces) < limits)
        mean: Float[Array, " wheels"] = (forces - corrections).sum(axis=0) / len(forces)
        return mean
