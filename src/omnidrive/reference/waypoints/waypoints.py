"""From the numbers that a waypoint file holds to a path or a timed reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidReference
from omnidrive.planning import Path
from omnidrive.reference.sampled_reference import (
    MAX_SAMPLES,
    MAX_VALUE,
    MIN_STEP,
    SampledReference,
    first_nonincreasing,
)

Waypoints: TypeAlias = Path | SampledReference


def timed_waypoints(
    file: str,
    place: Callable[[int], str],
    times: Float[Array, " samples"],
    poses: Float[Array, "samples 3"],
    twists: Float[Array, "samples 3"] | None,
) -> SampledReference:
    """The reference through samples; without twists, from rest to rest on a cubic spline.

    Args:
        file: Its name, for messages.
        place: Where in the file a sample stands, for messages.
        times: In s.
        poses: x and y in m, yaw in rad.
        twists: In W; m/s, m/s, rad/s.

    Raises:
        InvalidReference: Fewer than two samples, or times that do not grow.
    """
    _check_count(file, len(poses))
    i = first_nonincreasing(times)
    if i is not None:
        raise InvalidReference(
            f"{file}, {place(i)}: the time {times[i]:.9g} s does not come after {times[i - 1]:.9g} "
            f"s; times must increase by at least {MIN_STEP:g} s from one sample to the next"
        )
    if twists is None:
        return SampledReference.through(times, poses)
    return SampledReference(times, poses, twists)


def untimed_waypoints(
    file: str, place: Callable[[int], str], poses: Float[Array, "points 3"]
) -> Path:
    """The path through poses, with the yaw unwrapped; arguments as for :func:`timed_waypoints`.

    Raises:
        InvalidReference: Fewer than two poses, the same one twice in a row, or a number that is
            not finite or beyond 1e10.
    """
    _check_count(file, len(poses))
    if not (np.abs(poses) <= MAX_VALUE).all():  # also catches NaN
        raise InvalidReference(
            f"{file}: a waypoint is not made of finite numbers of at most {MAX_VALUE:g}"
        )
    poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    same = np.flatnonzero((np.diff(poses, axis=0) == 0.0).all(axis=1))
    if len(same):
        i = int(same[0])
        raise InvalidReference(
            f"{file}, {place(i + 1)}: the same waypoint as before, x {poses[i, 0]:g} m, "
            f"y {poses[i, 1]:g} m; remove one of the two, or give times to stand there"
        )
    return Path(poses)


def _check_count(file: str, count: int) -> None:
    if count < 2:
        raise InvalidReference(
            f"{file}: a way needs at least 2 waypoints, and here {'is' if count == 1 else 'are'} "
            f"{count}"
        )
    if count > MAX_SAMPLES:
        raise InvalidReference(f"{file}: {count:,} waypoints are more than {MAX_SAMPLES:,}")
