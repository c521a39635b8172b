"""Sampled motion with accelerations, and its use of limits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.reference.limits import LimitRows
from omnidrive.reference.piecewise_path import rotate_into_body


class Motion(NamedTuple):
    """Poses of B in W, and their first and second derivatives with respect to time.

    x and y in m, yaw in rad; m/s and rad/s; m/s^2 and rad/s^2.
    """

    poses: Float[Array, "n 3"]
    twists: Float[Array, "n 3"]
    accelerations: Float[Array, "n 3"]


def limit_shares(motion: Motion, limits: tuple[LimitRows, ...]) -> dict[str, Float[Array, " n"]]:
    """Return the use of each limit at each sample, as a share of the limit, by name.

    The body twist is R^T v. Its derivative, on which the acceleration of the wheels depends, is
    R^T a - yaw_rate z x R^T v with z up.
    """
    yaw = motion.poses[:, 2]
    twist, acceleration = (rotate_into_body(each, yaw) for each in motion[1:])
    rate = acceleration.copy()
    rate[:, 0] += twist[:, 2] * twist[:, 1]
    rate[:, 1] -= twist[:, 2] * twist[:, 0]
    vectors = {"speed": twist, "twist rate": rate, "acceleration": acceleration}
    shares = {}
    for group in limits:
        values = group.rows @ vectors[group.kind].T
        shares[group.name] = (
            np.linalg.norm(values, axis=0) if group.euclidean else np.abs(values).max(axis=0)
        )
    return shares
