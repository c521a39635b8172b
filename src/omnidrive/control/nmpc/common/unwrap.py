"""Unwrapping of headings."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.geometry.kernels import wrap_angle


@compiled
def unwrap_near(headings: Float[Array, " n"], yaw: float) -> Float[Array, " n"]:
    """Unwrap ``headings``, so that the first is within half a turn of ``yaw``.

    All angles are in rad. Consecutive headings of the result differ by at most half a turn.
    """
    unwrapped = np.empty(len(headings))
    unwrapped[0] = yaw + wrap_angle(headings[0] - yaw)
    for k in range(1, len(headings)):
        unwrapped[k] = unwrapped[k - 1] + wrap_angle(headings[k] - headings[k - 1])
    return unwrapped
