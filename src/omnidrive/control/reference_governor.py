"""Reference governor: a reference beyond the robot's limits is followed later, on its path."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

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
    SplicedReference,
    delay_within_limits,
    needed_limits,
)
from omnidrive.reference.reference import WindowReference
from omnidrive.reference.timing.limits import SPEED_SHARE
from omnidrive.robot import Chassis, force_share

TOLERATED_DELAY = 0.1
"""Delay, s, up to which the tracking controller makes up for what the limits do not permit."""

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
    _latest: tuple[_Governed, ...] = field(default=(), init=False, repr=False)
    """The latest two references that were governed, so that each is governed once."""
    _tracked: _Governed | None = field(default=None, init=False, repr=False)
    """The one that is tracked: another thread may govern any number that could follow it."""

    def prepare(self) -> None:
        """Compile the kernels."""
        delay_within_limits(_STILL, self._limits(SPEED_SHARE, force_share.GOVERNED))
        DelayedReference(_STILL, 0.1, np.zeros((2, 6)), np.ones(2)).window(0.0, 2, 0.1)

    def reset(self) -> None:
        """Discard references, unless their class is of this package: they do not change."""
        fixed = (WindowReference, Hold)
        self._latest = tuple(each for each in self._latest if isinstance(each.reference, fixed))
        self._tracked = None

    def govern(self, reference: Reference) -> Reference:
        """Return the reference to track, computed when ``reference`` is first seen."""
        self._tracked = self._find(reference)
        return self._tracked.retiming.reference

    def delay(self, reference: Reference, t: float) -> float:
        """Return the delay of the governed reference at the time ``t`` (s), in s."""
        governed = self.govern(reference)
        if isinstance(governed, SplicedReference):
            t -= governed.switch_time
            governed = governed.after
        return governed.delay(t) if isinstance(governed, DelayedReference) else 0.0

    def retime(self, reference: Reference) -> Retiming:
        """Return the governed reference, and what the original one needs if it is another."""
        return self._find(reference).retiming

    def _find(self, reference: Reference) -> _Governed:
        """Return the governed reference of ``reference``."""
        for each in (self._tracked, *self._latest):
            if each is not None and each.reference is reference:
                return each
        governed = self._computed(reference)
        found = _Governed(reference, Retiming(governed, self._needs(reference, governed)))
        self._latest = (found, *self._latest[:1])
        return found

    def _needs(self, reference: Reference, governed: Reference) -> str:
        """Return what the original reference needs if the governed one is another."""
        if isinstance(reference, SplicedReference) and isinstance(governed, SplicedReference):
            reference, governed = reference.after, governed.after
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

    def _computed(self, reference: Reference, *, rest: bool = True) -> Reference:
        """Return the reference to track; ``rest``: whether the robot is at rest at its start."""
        if isinstance(reference, Hold):
            return reference
        if isinstance(reference, SplicedReference):  # its first part is governed already
            after = self._computed(reference.after, rest=False)
            return reference if after is reference.after else replace(reference, after=after)
        limits = self._limits(SPEED_SHARE, force_share.GOVERNED)
        try:
            if delay_within_limits(reference, limits, rest=False).max_delay <= TOLERATED_DELAY:
                return reference
            return delay_within_limits(reference, limits, rest=rest)
        except PART_ERRORS:  # of the reference: the step reports it if it happens there as well
            return reference


class _Governed(NamedTuple):
    """A reference and what is tracked instead."""

    reference: Reference
    retiming: Retiming
