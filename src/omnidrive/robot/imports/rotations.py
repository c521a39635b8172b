"""Rotation matrices of robot descriptions."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array

Matrix = Float[Array, "3 3"]
Vector = Float[Array, " 3"]


def about(axis: int, angle: float) -> Matrix:
    """Return the rotation about x (0), y (1) or z (2) by ``angle``, rad."""
    c, s = cos(angle), sin(angle)
    matrix = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


def from_quaternion(w: float, x: float, y: float, z: float) -> Matrix:
    """Return the rotation of a quaternion, which need not have the length 1."""
    norm = w * w + x * x + y * y + z * z
    if not norm > 0.0:
        return np.eye(3)
    s = 2.0 / norm
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ]
    )


def from_z(direction: Vector) -> Matrix:
    """Return the smallest rotation that turns z towards ``direction``."""
    length = float(np.linalg.norm(direction))
    x, y, z = direction / length if length > 0.0 else (0.0, 0.0, 1.0)
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    return from_quaternion(1.0 + z, -y, x, 0.0)
