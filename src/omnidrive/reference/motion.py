"""Sampled motion with accelerations, and its use of limits."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.timing.limits import LimitRows
from omnidrive.reference.timing.piecewise_path import PathDerivatives, body_derivatives


class Motion(NamedTuple):
    """Poses of B in W, and their first and second derivatives with respect to time.

    x and y in m, yaw in rad; m/s and rad/s; m/s^2 and rad/s^2.
    """

    poses: Float[Array, "n 3"]
    twists: Float[Array, "n 3"]
    accelerations: Float[Array, "n 3"]


def limit_shares(motion: Motion, limits: tuple[LimitRows, ...]) -> dict[str, Float[Array, " n"]]:
    """Return the use of each limit at each sample, as a share of the limit, by name.

    With time as the parameter of the path, its derivatives in B are those that the limits concern.
    """
    twist, rate, acceleration = body_derivatives(PathDerivatives(*motion))
    vectors = {"speed": twist, "twist rate": rate, "acceleration": acceleration}
    return {group.name: group.shares(vectors[group.kind].T) for group in limits}
