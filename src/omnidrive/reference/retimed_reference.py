"""References that are slowed down or sped up uniformly."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.reference import Reference, WindowReference, check_duration


@dataclass(frozen=True, eq=False, slots=True)
class RetimedReference(WindowReference):
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
            check_duration(duration)

    def window(self, t: float, n: int, dt: float) -> Float[Array, "n 6"]:
        """Return the setpoints at ``t + k * dt``; columns as in :class:`Reference`."""
        faster = self.reference.duration / self.duration
        setpoints = self.reference.window(t * faster, n, dt * faster).copy()
        setpoints[:, 3:] *= faster
        return setpoints
