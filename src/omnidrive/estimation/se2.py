"""Compiled kernels for motions of the plane, as vectors (x, y, yaw)."""

from __future__ import annotations

from math import cos, floor, pi, sin, tan

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


@compiled
def exponential(motion: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Pose that a motion leads to from the origin: :func:`omnidrive.geometry.move`."""
    turn = motion[2]
    half = 0.5 * turn
    if abs(turn) < 1e-4:
        along, across = 1.0 - turn * turn / 6.0, half * (1.0 - turn * turn / 12.0)
    else:
        along, across = sin(turn) / turn, sin(half) ** 2 / half
    return np.array(
        [along * motion[0] - across * motion[1], across * motion[0] + along * motion[1], turn]
    )


@compiled
def logarithm(pose: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Motion that leads from the origin to ``pose``: inverse of :func:`exponential`.

    It turns the short way.
    """
    turn = pose[2] - 2.0 * pi * floor((pose[2] + pi) / (2.0 * pi))
    half = 0.5 * turn
    along = 1.0 - half * half / 3.0 if abs(half) < 1e-4 else half / tan(half)
    return np.array([along * pose[0] + half * pose[1], along * pose[1] - half * pose[0], turn])


@compiled
def after(pose: Float[Array, " 3"], other: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """``pose`` composed with ``other``; the yaws add up, unwrapped."""
    c, s = cos(pose[2]), sin(pose[2])
    return np.array(
        [
            pose[0] + c * other[0] - s * other[1],
            pose[1] + s * other[0] + c * other[1],
            pose[2] + other[2],
        ]
    )


@compiled
def seen_from(pose: Float[Array, " 3"], other: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """``other`` in the frame of ``pose``: the inverse of ``pose``, composed with ``other``."""
    c, s = cos(pose[2]), sin(pose[2])
    dx, dy = other[0] - pose[0], other[1] - pose[1]
    return np.array([c * dx + s * dy, c * dy - s * dx, other[2] - pose[2]])


@compiled
def transport(motion: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """How an error of a pose, in its frame, is seen from the frame after ``motion``.

    The adjoint of the inverse motion (Sola, Deray & Atchuthan, "A micro Lie theory", 2018, eq. 31
    and, for the plane, eq. 159).
    """
    end = exponential(motion)
    c, s = cos(end[2]), sin(end[2])
    x, y = -c * end[0] - s * end[1], s * end[0] - c * end[1]  # translation of the inverse
    return np.array([[c, s, y], [-s, c, -x], [0.0, 0.0, 1.0]])


@compiled
def right_jacobian(motion: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """How an error of a motion shows in the frame at its end; to second order in the motion.

    The series ``I - ad / 2 + ad^2 / 6`` (Sola, Deray & Atchuthan, 2018, eq. 163 is its sum).
    """
    x, y, turn = motion[0], motion[1], motion[2]
    square = turn * turn / 6.0
    return np.array(
        [
            [1.0 - square, 0.5 * turn, -0.5 * y + x * turn / 6.0],
            [-0.5 * turn, 1.0 - square, 0.5 * x + y * turn / 6.0],
            [0.0, 0.0, 1.0],
        ]
    )
