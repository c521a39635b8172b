"""Compiled operations of the group SE(2).

Poses and motions are vectors (x, y, yaw) in m, m, rad. A motion is an element of the tangent space:
a constant twist in the moving frame, times its duration.
"""

from __future__ import annotations

from math import cos, floor, pi, sin, tan

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled


@compiled
def exponential(motion: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Return the pose reached from the origin by a motion along a circular arc or straight line.

    The same function as :func:`omnidrive.geometry.move` in unit time.
    """
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
    """Return the motion from the origin to ``pose``, the inverse of :func:`exponential`.

    The rotation of the motion is at least -pi and less than pi.
    """
    turn = pose[2] - 2.0 * pi * floor((pose[2] + pi) / (2.0 * pi))
    half = 0.5 * turn
    along = 1.0 - half * half / 3.0 if abs(half) < 1e-4 else half / tan(half)
    return np.array([along * pose[0] + half * pose[1], along * pose[1] - half * pose[0], turn])


@compiled
def compose(pose: Float[Array, " 3"], other: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Return the composition ``pose o other``; its yaw is the sum of both, not wrapped."""
    c, s = cos(pose[2]), sin(pose[2])
    return np.array(
        [
            pose[0] + c * other[0] - s * other[1],
            pose[1] + s * other[0] + c * other[1],
            pose[2] + other[2],
        ]
    )


@compiled
def relative_pose(pose: Float[Array, " 3"], other: Float[Array, " 3"]) -> Float[Array, " 3"]:
    """Return ``pose^-1 o other``: the pose ``other`` in the frame of ``pose``; yaw not wrapped."""
    c, s = cos(pose[2]), sin(pose[2])
    dx, dy = other[0] - pose[0], other[1] - pose[1]
    return np.array([c * dx + s * dy, c * dy - s * dx, other[2] - pose[2]])


@compiled
def inverse_adjoint(motion: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """Return the adjoint matrix of the inverse of ``Exp(motion)``.

    It transforms a small error of a pose, given in the frame of this pose, to the frame that the
    pose has after ``motion`` (Sola, Deray & Atchuthan, "A micro Lie theory", 2018, eq. 31; for
    SE(2), eq. 159).
    """
    end = exponential(motion)
    c, s = cos(end[2]), sin(end[2])
    x, y = -c * end[0] - s * end[1], s * end[0] - c * end[1]  # translation of the inverse
    return np.array([[c, s, y], [-s, c, -x], [0.0, 0.0, 1.0]])


@compiled
def right_jacobian(motion: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """Return the right Jacobian of :func:`exponential`, to second order in the motion.

    It transforms a small change of the motion to the change of the pose at the end, in the frame
    of this pose. Computed as ``I - ad / 2 + ad^2 / 6`` with ``ad``, the adjoint matrix of the
    motion as an element of the Lie algebra: the first terms of the series whose sum is eq. 163 of
    Sola, Deray & Atchuthan, 2018.
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
