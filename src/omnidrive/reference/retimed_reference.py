"""References that are slowed down or sped up uniformly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference.reference import Reference, Setpoint


@dataclass(frozen=True, eq=False, slots=True)
class RetimedReference:
    """The same motion in another duration.

    Velocities scale with 1 / duration, accelerations with its square.

    Attributes:
        reference: The motion.
        duration: New duration, in s.

    Raises:
        InvalidReference: A duration is not positive and finite.
    """

    reference: Reference
    duration: float

    def __post_init__(self) -> None:
        for duration in (self.duration, self.reference.duration):
            if not (np.isfinite(duration) and duration > 0.0):
                raise InvalidReference(f"duration must be positive, got {duration:g} s")

    def at(self, t: float) -> Setpoint:
        """Return the setpoint at time ``t`` in s; outside [0, duration] an end pose, at rest."""
        x, y, yaw, *twist = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(x, y, yaw), WorldTwist(*twist))

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        faster = self.reference.duration / self.duration
        setpoints = self.reference.window(t * faster, n, dt * faster).copy()
        setpoints[:, 3:] *= faster
        return setpoints
