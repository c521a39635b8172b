"""Controls, and all that a solver wants to know of where they lead."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


class Point(NamedTuple):
    """Controls and what they lead to; the kernels of :mod:`unicycle` fill it in."""

    controls: Float[Array, "stages 2"]
    """v_k and yaw rate; m/s, rad/s."""
    states: Float[Array, "points 3"]
    """x_k, their roll-out; m, m, rad."""
    courses: Float[Array, "stages 2"]
    """dt (cos yaw_k, sin yaw_k), in s: what a speed of 1 m/s moves the position by."""
    costates: Float[Array, "points 3"]
    """dJ/dx_k with the later controls held."""
    gradient: Float[Array, "stages 2"]
    """dJ/du_k."""
    free: Bool[Array, "stages 2"]
    """False where a control stands at a limit and the gradient pushes it outward."""


@compiled
def blank_point(stages: int) -> Point:
    """Room for a point; its values are arbitrary."""
    return Point(
        np.empty((stages, 2)),
        np.empty((stages + 1, 3)),
        np.empty((stages, 2)),
        np.empty((stages + 1, 3)),
        np.empty((stages, 2)),
        np.empty((stages, 2), dtype=np.bool_),
    )
