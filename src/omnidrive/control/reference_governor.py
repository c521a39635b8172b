"""Reference governor: a reference beyond the robot's limits is followed later, on its path."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import Retiming
from omnidrive.errors import PART_ERRORS
from omnidrive.reference import (
    DelayedReference,
    Hold,
    LimitRows,
    Reference,
    SampledReference,
    delay_within_limits,
    needed_limits,
)
from omnidrive.reference.reference import WindowReference
from omnidrive.robot import Chassis

TOLERATED_DELAY = 0.1
"""Delay, s, up to which the tracking controller makes up for what the limits do not permit."""

SPEED_SHARE, FORCE_SHARE = 0.98, 0.965
"""Shares of the wheel speed limit and of the acceleration limits of the controller that governed
references use; the rest is for feedback."""

_STILL = SampledReference(np.array([0.0, 0.1]), np.zeros((2, 3)), np.zeros((2, 3)))


@dataclass(slots=True)
class ReferenceGovernor:
    """Replaces references that a robot cannot follow in time by ones that it can.

    The governed reference has the same path, is never ahead of the original one, and is late only
    where the limits demand it, see :func:`~omnidrive.reference.delay_within_limits`. A reference is
    left as it is, the same object, if its delay would be at most :data:`TOLERATED_DELAY` (a jump of
    the velocity at its start or end does not count), and if it has no path: a :class:`Hold`, one
    that jumps, or one that cannot be evaluated from its start to its end.

    Governors of references: Garone, Di Cairano & Kolmanovsky, "Reference and command governors for
    systems with constraints: a survey", Automatica 75, 2017.

    Attributes:
        chassis: The wheels and their maximum speed.
        acceleration_faces: Rows of ``|acceleration_faces @ (ax, ay, yaw acceleration)| <= 1`` in B;
            s^2/m, s^2/m and s^2/rad. None: no limit.
    """

    chassis: Chassis
    acceleration_faces: Float[Array, "faces 3"] | None
    _reference: Reference | None = field(default=None, init=False, repr=False)
    """The latest reference, so that each is governed once."""
    _governed: Reference | None = field(default=None, init=False, repr=False)
    _retiming: Retiming | None = field(default=None, init=False, repr=False)

    def prepare(self) -> None:
        """Compile the kernels."""
        delay_within_limits(_STILL, self._limits(SPEED_SHARE, FORCE_SHARE))
        DelayedReference(_STILL, 0.1, np.zeros((2, 6)), np.ones(2)).window(0.0, 2, 0.1)

    def reset(self) -> None:
        """Forget the latest reference, unless its class is of this package: they do not change."""
        if not isinstance(self._reference, (WindowReference, Hold)):
            self._reference = self._governed = self._retiming = None

    def govern(self, reference: Reference) -> Reference:
        """Return the reference to track, computed when ``reference`` is first seen."""
        if reference is not self._reference or self._governed is None:
            self._reference, self._governed = reference, self._computed(reference)
            self._retiming = None
        return self._governed

    def delay(self, t: float) -> float:
        """Return the delay of the latest governed reference at the time ``t`` (s), in s."""
        governed = self._governed
        return governed.delay(t) if isinstance(governed, DelayedReference) else 0.0

    def retime(self, reference: Reference) -> Retiming:
        """Return the governed reference, and what the original one needs if it is another."""
        governed = self.govern(reference)
        if self._retiming is None:
            self._retiming = Retiming(governed, self._needs(reference))
        return self._retiming

    def _needs(self, reference: Reference) -> str:
        """Return what the original reference needs if the governed one is another."""
        governed = self._governed
        if not isinstance(governed, DelayedReference):
            return ""
        used = needed_limits(reference, self._limits(1.0, 1.0))
        top = self.chassis.max_wheel_speed
        needs = f"wheel speeds of {used['wheel speed'] * top:.3g} rad/s (limit {top:.3g} rad/s)"
        if "wheel force" in used:
            needs += f" and {used['wheel force']:.2f} times the forces of the wheels in plans"
        return (
            f"the reference needs {needs}: its path is followed with a delay of up to "
            f"{governed.max_delay:.2f} s, to its end at {governed.duration:.2f} s instead of "
            f"{reference.duration:.2f} s"
        )

    def _limits(self, speed_share: float, force_share: float) -> tuple[LimitRows, ...]:
        """Return shares of the limits."""
        top = speed_share * self.chassis.max_wheel_speed
        speed = LimitRows("wheel speed", "speed", self.chassis.jacobian / top)
        if self.acceleration_faces is None:
            return (speed,)
        faces = self.acceleration_faces / force_share
        return speed, LimitRows("wheel force", "acceleration", faces)

    def _computed(self, reference: Reference) -> Reference:
        """Return the reference to track."""
        if isinstance(reference, Hold):
            return reference
        limits = self._limits(SPEED_SHARE, FORCE_SHARE)
        try:
            if delay_within_limits(reference, limits, rest=False).max_delay <= TOLERATED_DELAY:
                return reference
            return delay_within_limits(reference, limits)
        except PART_ERRORS:  # of the reference: the step reports it if it happens there as well
            return reference
