"""Accelerations that the wheels can produce together."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array


def acceleration_polytope(
    rim_jacobian: Float[Array, "wheels 3"],
    force_limits: Float[Array, " wheels"],
    inertia: Float[Array, " 3"],
) -> Float[Array, "faces 3"]:
    """Return the faces of the polytope of accelerations that the wheels can produce.

    The polytope is ``|faces @ (ax, ay, yaw acceleration)| <= 1``, with the acceleration of B in
    components of B. Each wheel exerts a force along its drive direction, forwards or backwards, of
    at most its limit. The wrenches (sums of the forces, and of their torques about the centre of B)
    form a zonotope, whose faces are spanned by pairs of wheels (McMullen, "On zonotopes", Trans.
    AMS 159, 1971). The centre of mass is taken to be the centre of B.

    Args:
        rim_jacobian: Rim speed of each wheel per unit of body twist, in 1, 1 and m/rad.
        force_limits: Largest force of each wheel, in N.
        inertia: Mass, mass and yaw inertia about the centre of B, in kg, kg and kg m^2.

    Returns:
        One row for each pair of opposite faces: their normal, scaled to the bound 1; in s^2/m,
        s^2/m and s^2/rad. Different pairs of wheels can yield the same row.
    """
    wrenches = force_limits[:, None] * rim_jacobian
    normals = np.array([np.cross(a, b) for a, b in combinations(rim_jacobian, 2)])
    # two wheels on one line of action span no face
    normals = normals[np.linalg.norm(normals, axis=1) > 1e-9 * np.abs(rim_jacobian[:, 2]).mean()]
    support = np.abs(normals @ wrenches.T).sum(axis=1)
    rows: Float[Array, "faces 3"] = normals * inertia / support[:, None]
    return rows
