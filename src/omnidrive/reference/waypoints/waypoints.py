"""Conversion of the contents of a waypoint file to a path or a reference."""

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
    first_short_step,
)

Waypoints: TypeAlias = Path | SampledReference


def timed_waypoints(
    file: str,
    position: Callable[[int], str],
    times: Float[Array, " samples"],
    poses: Float[Array, "samples 3"],
    twists: Float[Array, "samples 3"] | None,
) -> SampledReference:
    """Return the reference through samples; without twists, a cubic spline from rest to rest.

    Args:
        file: Name of the file, for messages.
        position: Position of a sample in the file, for messages.
        times: Times in s.
        poses: x and y in m, yaw in rad.
        twists: Velocities in W, in m/s, m/s and rad/s; None: unknown.

    Raises:
        InvalidReference: There are fewer than two samples, or times do not increase.
    """
    _check_count(file, len(poses))
    i = first_short_step(times)
    if i is not None:
        raise InvalidReference(
            f"{file}, {position(i)}: the time {times[i]:.9g} s does not come after "
            f"{times[i - 1]:.9g} s; times must increase by at least "
            f"{MIN_STEP:g} s from one sample to the next"
        )
    if twists is None:
        return SampledReference.through(times, poses)
    return SampledReference(times, poses, twists)


def untimed_waypoints(file: str, poses: Float[Array, "points 3"]) -> Path:
    """Return the path through poses, with the yaw unwrapped; ``file`` is its name, for messages.

    A pose that repeats the previous one is left out.

    Raises:
        InvalidReference: There are fewer than two different poses, or a number is not finite or
            above 1e10 in magnitude.
    """
    _check_count(file, len(poses))
    if not (np.abs(poses) <= MAX_VALUE).all():  # NaN as well
        raise InvalidReference(
            f"{file}: a waypoint has a number that is not finite or above {MAX_VALUE:g} "
            "in magnitude"
        )
    poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    changed = (np.diff(poses, axis=0) != 0.0).any(axis=1)
    if not changed.any():
        raise InvalidReference(
            f"{file}: all waypoints are the same, x {poses[0, 0]:g} m, y {poses[0, 1]:g} m; "
            "a path needs two different ones"
        )
    return Path(poses[np.concatenate([[True], changed])])


def _check_count(file: str, count: int) -> None:
    if count < 2:
        raise InvalidReference(
            f"{file}: a path needs at least 2 waypoints, and the file has {count}"
        )
    if count > MAX_SAMPLES:
        raise InvalidReference(f"{file}: {count:,} waypoints are more than {MAX_SAMPLES:,}")
