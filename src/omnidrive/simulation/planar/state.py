"""Where the planar robot is, and how fast it and its wheels move."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.geometry import Pose

MOTION = np.dtype(
    [
        ("x", float),  # of B in W, m
        ("y", float),
        ("yaw", float),  # rad, not wrapped
        ("vx", float),  # in B, m/s
        ("vy", float),
        ("yaw_rate", float),  # rad/s
        ("work", float),  # of the motors, without signs, J
        ("push_x", float),  # of the floor on the robot as the axles feel it, in B, N
        ("push_y", float),
    ]
)
"""What there is once per robot."""

SPIN = np.dtype(
    [
        ("angle", float),  # rad
        ("speed", float),  # rad/s
        ("target", float),  # set point of the servo, rad/s
        ("torque", float),  # of the motor, mean of the last command, N m
        ("command", float),  # speed asked for, rad/s
        ("grip", float),  # most impulse between wheel and floor in this step, N s
        ("turn", float),  # moment of the push about B's origin per N, in m
        ("slope", float),  # how that impulse falls with the mount's speed, kg
        ("reason", int),  # why: 0 it rolls, 1 or -1 with all its torque, 2 or -2 it slips
    ]
)
"""What there is once per wheel."""


class State(NamedTuple):
    """All that the robot remembers from one command to the next."""

    motion: Array
    """One record of :data:`MOTION`."""
    spins: Array
    """A record of :data:`SPIN` per wheel."""
    rollers: Float[Array, "wheels rollers"]
    """Speed at which every roller's surface runs, in m/s, as its wheel's mount moves."""

    @classmethod
    def at_rest(cls, wheels: int, rollers: int, pose: Pose) -> State:
        """A robot of so many wheels, of so many rollers each, that stands at ``pose``."""
        state = cls(np.zeros(1, MOTION), np.zeros(wheels, SPIN), np.zeros((wheels, rollers)))
        for name, value in pose._asdict().items():
            state.motion[name] = value
        return state
