"""Least delay with which the path of a reference can be followed within limits."""

from __future__ import annotations

from math import ceil, inf
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicHermiteSpline

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.reference.delayed_progress import delayed_squared_rates
from omnidrive.reference.delayed_reference import DelayedReference
from omnidrive.reference.motion import Motion, limit_shares
from omnidrive.reference.reference import Reference, check_duration
from omnidrive.reference.sampled_reference import MAX_SAMPLES, SampledReference
from omnidrive.reference.timing.limits import LimitRows, limit_terms
from omnidrive.reference.timing.piecewise_path import (
    PathDerivatives,
    body_derivatives,
    rotate_into_body,
)

AVERAGING_TIME = 0.1
"""Time, in s, before and after a sample over which its acceleration is averaged."""

_STEP, _MAX_STEP = 0.01, 0.05
"""Time between samples, in s, and the largest one, with which accelerations are still resolved."""

_MIN_SAMPLES = 1000

_JUMP = 10.0
"""Use of a speed limit, as a share of it, between two samples that counts as a jump."""

_PASSES, _SHORT = 4, 0.02
"""Largest number of passes, between which the averaging times adapt to the rates, and the largest
delay, in s, after which one is enough."""

_TOP = 1e6
"""Largest squared rate, where the reference is at rest."""


class _Samples(NamedTuple):
    """Samples of a reference at even times from its start to its end."""

    step: float
    """Time between samples, in s."""
    poses: Float[Array, "samples 3"]
    """Poses of B in W, yaw unwrapped."""
    twists: Float[Array, "samples 3"]
    """Velocities in W, by central differences of the poses."""


def delay_within_limits(
    reference: Reference, limits: tuple[LimitRows, ...], *, rest: bool = True
) -> DelayedReference:
    """Return the motion along the path of ``reference`` within limits with the least delay.

    The motion is never ahead of the reference: where the limits permit it is the reference, before
    a part that is too fast it slows down, and afterwards it goes on as fast as the limits permit,
    until the delay is made up for or the end is reached. The delay is the least possible at every
    time: it is computed by reachability analysis (Pham & Pham, IEEE Trans. Robotics 34(3), 2018) of
    the reference's own time as path parameter.

    Only the poses of the reference are used, at steps of 0.01 s, smaller ones if it takes less than
    10 s, larger ones if it takes more than 1000 s. Its accelerations are means with triangular
    weights over 0.1 s before and after. A corner, which no robot passes at speed, is therefore
    passed at the speed at which a robot rounds it at a distance of acceleration x (0.1 s)^2 / 6, a
    few millimetres.

    Args:
        reference: The motion.
        limits: Limits, see :func:`~omnidrive.reference.timing.limits.limit_rows`.
        rest: Whether the motion starts and ends at rest, as a robot does. False: the velocity may
            jump there, as that of a reference with uniform timing does.

    Raises:
        InvalidReference: The reference cannot be sampled, takes longer than 5000 s, or jumps, so
            that it has no path; or the limits differ by too many orders of magnitude.
    """
    samples = _sampled(reference)
    _check_no_jump(samples, limits)
    rates = np.ones(len(samples.poses))
    for _ in range(_PASSES):
        a, b = _limit_rows(samples, limits, _accelerations(samples, rates, rest))
        squared, delays = delayed_squared_rates(a, b, samples.step, _TOP)
        if not delays[-1] < inf:
            raise InvalidReference("the limits are too low for the path: check their units")
        rates = np.sqrt(squared)
        if delays.max() < _SHORT:
            break
    return _tabulated(reference, samples, squared, delays)


def needed_limits(reference: Reference, limits: tuple[LimitRows, ...]) -> dict[str, float]:
    """Return the peak use of each limit by a reference, as a share of the limit, by name.

    As :func:`~omnidrive.reference.limit_usage`, but with the samples and the mean accelerations of
    :func:`delay_within_limits`. A jump of the velocity at the start or at the end does not count.

    Raises:
        InvalidReference: The reference cannot be sampled, or takes longer than 5000 s.
    """
    samples = _sampled(reference)
    accelerations = _accelerations(samples, np.ones(len(samples.poses)), rest=False)
    shares = limit_shares(Motion(samples.poses, samples.twists, accelerations), limits)
    return {name: float(share.max()) for name, share in shares.items()}


def _sampled(reference: Reference) -> _Samples:
    """Return the samples of a reference."""
    duration = reference.duration
    check_duration(duration)
    step = max(min(_STEP, duration / _MIN_SAMPLES), duration / MAX_SAMPLES)
    if step > _MAX_STEP:
        raise InvalidReference(
            f"a motion of {duration:g} s is too long, at most {_MAX_STEP * MAX_SAMPLES:g} s are "
            "possible"
        )
    samples = SampledReference.of(reference, step)
    poses = np.column_stack([samples.poses[:, :2], np.unwrap(samples.poses[:, 2])])
    step = float(samples.times[1])
    return _Samples(step, poses, np.gradient(poses, step, axis=0, edge_order=2))


def _check_no_jump(samples: _Samples, limits: tuple[LimitRows, ...]) -> None:
    """Raise InvalidReference if the reference is too fast somewhere to be continuous."""
    twists = rotate_into_body(np.diff(samples.poses, axis=0) / samples.step, samples.poses[:-1, 2])
    for group in limits:
        if group.kind == "speed":
            used = np.abs(twists @ group.rows.T).max(axis=1)
            if used.max() > _JUMP:
                raise InvalidReference(
                    f"the reference jumps at {samples.step * float(np.argmax(used)):.2f} s"
                )


def _limit_rows(
    samples: _Samples, limits: tuple[LimitRows, ...], accelerations: Float[Array, "samples 3"]
) -> tuple[Float[Array, "intervals rows"], Float[Array, "intervals rows"]]:
    """Return all limits as rows ``|a u + b x| <= 1`` at both ends of each interval.

    As :func:`~omnidrive.reference.timing.time_parameterization.interval_rows`; s is the time of the
    reference.
    """
    motion = PathDerivatives(samples.poses, samples.twists, accelerations)
    along, across = limit_terms(body_derivatives(motion), limits)
    a = np.hstack([along[:-1], along[1:] + 2.0 * samples.step * across[1:]])
    return a, np.hstack([across[:-1], across[1:]])


def _accelerations(
    samples: _Samples, rates: Float[Array, " samples"], rest: bool
) -> Float[Array, "samples 3"]:
    """Return the mean accelerations around the samples, in W.

    A second difference of poses is the mean of the acceleration with triangular weights. Before the
    start and after the end the pose is constant, or, without rest there, goes on with the velocity
    and the opposite acceleration.

    Args:
        samples: The samples.
        rates: Rate at each sample at which the motion follows the reference: where it is slow, the
            averaging time is a shorter one of the reference.
        rest: Whether the motion starts and ends at rest.
    """
    step, poses, _ = samples
    m = min(max(round(AVERAGING_TIME / step), 1), len(poses) - 1)
    before, after = np.tile(poses[0], (m, 1)), np.tile(poses[-1], (m, 1))
    if not rest:
        before, after = 2.0 * before - poses[m:0:-1], 2.0 * after - poses[-2 : -m - 2 : -1]
    times = step * np.arange(-m, len(poses) + m)
    columns = np.vstack([before, poses, after]).T
    width = np.maximum(m * np.minimum(rates, 1.0), 1.0) * step
    own = times[m:-m]
    second = [
        (np.interp(own + width, times, c) - 2.0 * c[m:-m] + np.interp(own - width, times, c))
        for c in columns
    ]
    rows: Float[Array, "samples 3"] = np.stack(second, axis=1) / (width * width)[:, None]
    return rows


def _tabulated(
    reference: Reference,
    samples: _Samples,
    rates: Float[Array, " nodes"],
    delays: Float[Array, " nodes"],
) -> DelayedReference:
    """Return the motion with the given squared rates and delays at the samples."""
    nodes = samples.step * np.arange(len(rates))
    times = nodes + delays
    end = float(times[-1])
    count = min(ceil(end / _STEP), MAX_SAMPLES)
    at = np.linspace(0.0, end, count + 1)
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    since, start = at - times[k], np.sqrt(rates[k])
    u = (rates[k + 1] - rates[k]) / (2.0 * samples.step)
    s = nodes[k] + np.clip((start + 0.5 * u * since) * since, 0.0, samples.step)
    curve = CubicHermiteSpline(nodes, samples.poses, samples.twists)
    rate = np.maximum(start + u * since, 0.0)
    setpoints = np.hstack([curve(s), curve(s, 1) * rate[:, None]])
    setpoints[-1, 3:] = 0.0
    on_time = (delays[k] == 0.0) & (delays[k + 1] == 0.0)
    late = np.where(on_time, 0.0, np.maximum(at - s, 0.0))
    return DelayedReference(reference, end / count, setpoints, late)
