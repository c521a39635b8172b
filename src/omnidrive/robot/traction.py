"""What wheels can push together."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array


def traction_faces(
    rims: Float[Array, "wheels 3"], pushes: Float[Array, " wheels"], inertia: Float[Array, " 3"]
) -> Float[Array, "faces 3"]:
    """``|faces @ (ax, ay, yaw acceleration)| <= 1``: what the wheels can push, in B.

    Every wheel pushes along its direction, up to its push. All that they can do together is a
    zonotope of forces and torque; its faces are spanned by pairs of wheels (McMullen, "On
    zonotopes", Trans. AMS 159, 1971). Rows are in s^2/m, s^2/m and s^2/rad.

    Args:
        rims: Speed of every rim per unit of body twist, in 1, 1 and m/rad.
        pushes: Of every wheel at most, in N.
        inertia: Mass in kg, twice, and yaw inertia in kg m^2.
    """
    forces = pushes[:, None] * rims  # and torque, of each wheel's greatest push
    faces = np.array([np.cross(a, b) for a, b in combinations(rims, 2)])
    faces = faces[np.linalg.norm(faces, axis=1) > 1e-9 * np.abs(rims[:, 2]).mean()]
    reach = np.abs(faces @ forces.T).sum(axis=1)
    rows: Float[Array, "faces 3"] = faces * inertia / reach[:, None]
    return rows
