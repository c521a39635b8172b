"""Use of limits by any reference, and slower motion that keeps them."""

from __future__ import annotations

import numpy as np

from omnidrive.reference.motion import limit_shares
from omnidrive.reference.reference import Reference
from omnidrive.reference.retimed_reference import RetimedReference
from omnidrive.reference.sampled_reference import SampledReference
from omnidrive.reference.shape_reference import ShapeReference
from omnidrive.reference.timing.limited_reference import LimitedReference
from omnidrive.reference.timing.limits import LimitRows

_SAMPLES = 4000


def limit_usage(reference: Reference, limits: tuple[LimitRows, ...]) -> dict[str, float]:
    """Return the peak use of each limit within [0, duration], as a share of the limit, by name.

    A :class:`ShapeReference` is evaluated at 4001 times with its exact accelerations, a
    :class:`SampledReference` at five points of each of its polynomials. Another reference is
    evaluated as its cubic Hermite interpolation at 4001 times, whose accelerations are up to 1.5
    times too large where the acceleration of the reference jumps. A jump of the velocity at the
    start or at the end does not count.

    Args:
        reference: The motion.
        limits: Limits, see :func:`~omnidrive.reference.timing.limits.limit_rows`.
    """
    if isinstance(reference, RetimedReference):
        faster = reference.reference.duration / reference.duration
        own = limit_usage(reference.reference, limits)
        return {g.name: own[g.name] * faster ** _ORDER[g.kind] for g in limits}
    if isinstance(reference, ShapeReference):
        motion = reference.motion(np.linspace(0.0, reference.duration, _SAMPLES + 1))
        shares = limit_shares(motion, limits)
    else:
        if not isinstance(reference, SampledReference):
            reference = SampledReference.of(reference, reference.duration / _SAMPLES)
        shares = reference.interval_usage(limits)
    return {name: float(share.max()) for name, share in shares.items()}


def shortest_duration_within(reference: Reference, limits: tuple[LimitRows, ...]) -> float:
    """Return the shortest duration of the reference, retimed uniformly, within the limits, in s."""
    usage = limit_usage(reference, limits)
    factors = [usage[group.name] ** (1.0 / _ORDER[group.kind]) for group in limits]
    shortest: float = reference.duration * max(factors)
    return shortest


def slowed_to(reference: Reference, max_speed: float | None) -> Reference:
    """Return the reference, slowed uniformly if it exceeds ``max_speed``, m/s; None: unchanged."""
    if max_speed is None:
        return reference
    row = LimitRows("speed", "speed", np.eye(3)[:2] / max_speed, euclidean=True)
    duration = shortest_duration_within(reference, (row,))
    if duration <= reference.duration * (1.0 + 1e-9):
        return reference
    if isinstance(reference, LimitedReference):
        return reference.with_duration(duration)
    return RetimedReference(reference, duration)


_ORDER = {"speed": 1, "twist rate": 2, "acceleration": 2}
"""Power of the rate of time with which the use of each kind of limit grows."""
