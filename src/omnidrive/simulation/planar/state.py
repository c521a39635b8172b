"""State of the planar robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose

MOTION = np.dtype(
    [
        ("x", float),  # position of B in W, m
        ("y", float),
        ("yaw", float),  # rad, not wrapped
        ("vx", float),  # velocity in B, m/s
        ("vy", float),
        ("yaw_rate", float),  # rad/s
        ("work", float),  # absolute mechanical work of the motors, J
        ("force_x", float),  # floor's force on the robot after the lag of the axles, in B, N
        ("force_y", float),
        ("saturated", int),  # limits reached during the last command, a sum of Saturation
    ]
)
"""Record of the body."""

WHEEL_STATE = np.dtype(
    [
        ("angle", float),  # rad
        ("speed", float),  # rad/s
        ("target", float),  # set point of the servo after the motor lag, rad/s
        ("torque", float),  # mean torque of the motor during the last command, N m
        ("command", float),  # commanded speed, rad/s
        ("max_impulse", float),  # friction limit of the contact in this step, N s
        ("moment_arm", float),  # moment of the contact force about B's origin per N, m
        ("effective_mass", float),  # minus the derivative of the impulse by the mount's speed, kg
        ("mode", int),  # 0: rolls; 1 or -1: rolls at the torque limit; 2 or -2: slips
    ]
)
"""Record of one wheel."""


class PlanarState(NamedTuple):
    """Everything that the plant keeps from one command to the next."""

    motion: Array
    """One record of :data:`MOTION`."""
    wheels: Array
    """One record of :data:`WHEEL_STATE` per wheel."""
    rollers: Float[Array, "wheels rollers"]
    """Surface speed of every roller relative to the wheel's mount, m/s."""

    @classmethod
    def at_rest(cls, wheels: int, rollers: int, pose: Pose) -> PlanarState:
        """Return the state of a robot at rest at ``pose``.

        Args:
            wheels: Number of wheels.
            rollers: Number of rollers of each wheel.
            pose: Pose of B in W.
        """
        state = cls(np.zeros(1, MOTION), np.zeros(wheels, WHEEL_STATE), np.zeros((wheels, rollers)))
        for name, value in pose._asdict().items():
            state.motion[name] = value
        return state
