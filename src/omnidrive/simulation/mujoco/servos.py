"""The motors' velocity servos in MuJoCo, and the physics steps that they bear."""

from __future__ import annotations

from math import ceil

import mujoco
import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

_MOST_PARTS = 20  # the stiffest named servo needs 5


class MujocoServos:
    """Servos of one model, whose actuators each act on one hinge."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Find the wheels' hinges."""
        self._model, self._data = model, data
        self._dofs = model.jnt_dofadr[model.actuator_trnid[:, 0]]
        self._gears = model.actuator_gear[:, 0]

    def parts(self, length: float) -> int:
        """In how many parts a physics step of ``length`` s must now be done.

        MuJoCo takes the push of a motor at its limit as it is at a step's begin. If that turns a
        wheel that spins past its speed so far that the motor turns it back with all its might, the
        wheel swings to and fro and hardly drives. With gain g and inertia J it does so in steps of
        more than 2 J / g.
        """
        model, data, gears = self._model, self._data, self._gears
        gains, goals = -model.actuator_biasprm[:, 2], data.act if model.na else data.ctrl
        asked = model.actuator_gainprm[:, 0] * goals - gains * gears * data.qvel[self._dofs]
        limited = model.actuator_forcelimited.astype(bool)
        over = (np.abs(asked) > model.actuator_forcerange[:, 1]) & limited
        if not over.any():
            return 1
        inertias = model.dof_M0[self._dofs] / gears**2
        return min(ceil(length * float((gains / inertias)[over].max()) / 2.0), _MOST_PARTS)

    def given(
        self, forces: Float[Array, "steps wheels"], speeds: Float[Array, "steps wheels"]
    ) -> Float[Array, " wheels"]:
        """Mean torques that the motors gave in steps up to now, in N m.

        MuJoCo tells them as they are at a step's begin; its integrator takes the servo's answer to
        the speed at the end, unless the motor is at its limit.

        Args:
            forces: Of the motors at the begin of every step, in N m.
            speeds: Of the wheels then, in rad/s.
        """
        model = self._model
        limits, gains = model.actuator_forcerange[:, 1], -model.actuator_biasprm[:, 2]
        changes = np.empty_like(speeds)
        changes[:-1] = speeds[1:]
        changes[-1] = self._gears * self._data.qvel[self._dofs]
        changes -= speeds
        answers = gains * changes * (np.abs(forces) < limits)
        mean: Float[Array, " wheels"] = (forces - answers).sum(axis=0) / len(forces)
        return mean
