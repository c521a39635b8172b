"""Poses and twists in the plane.

Frames: W is fixed to the world (x east, y north); B is fixed to the robot (x forward, y left).
Angles are in rad, counter-clockwise positive; all other quantities are in SI units.
"""

from __future__ import annotations

from math import cos, pi, sin, tan
from typing import NamedTuple, TypeVar

import numpy as np

from omnidrive.errors import InvalidInput


class Pose(NamedTuple):
    """Pose of B in W: x and y in m, yaw in rad."""

    x: float
    y: float
    yaw: float


class WorldTwist(NamedTuple):
    """Velocity of B with respect to W, expressed in W: m/s, m/s, rad/s."""

    vx: float
    vy: float
    yaw_rate: float


class BodyTwist(NamedTuple):
    """Velocity of B with respect to W, expressed in B: m/s, m/s, rad/s."""

    vx: float
    vy: float
    yaw_rate: float


Angle = TypeVar("Angle", float, np.ndarray)


def wrap(angle: Angle) -> Angle:
    """Return the angle in [-pi, pi) equal to ``angle`` modulo 2 pi; arrays element-wise."""
    wrapped = (angle + pi) % (2.0 * pi) - pi
    return wrapped - 2.0 * pi * (wrapped >= pi)  # rounding can yield exactly pi


def check_heading(name: str, yaw: float) -> None:
    """Raise :class:`~omnidrive.errors.InvalidInput` beyond two turns, as of a heading in degrees.

    Args:
        name: Name of the heading, for the message.
        yaw: Heading, in rad.
    """
    if abs(yaw) > 4.0 * pi:
        raise InvalidInput(
            f"{name} is {yaw:g} rad, more than two turns: headings are in rad, not degrees (90 "
            f"degrees are {0.5 * pi:.4f} rad); if it is meant, wrap it with omnidrive.wrap"
        )


def to_body(twist: WorldTwist, yaw: float) -> BodyTwist:
    """Transform a twist from W to B, whose heading is ``yaw`` (rad)."""
    c, s = cos(yaw), sin(yaw)
    return BodyTwist(c * twist.vx + s * twist.vy, -s * twist.vx + c * twist.vy, twist.yaw_rate)


def to_world(twist: BodyTwist, yaw: float) -> WorldTwist:
    """Transform a twist from B, whose heading is ``yaw`` (rad), to W."""
    c, s = cos(yaw), sin(yaw)
    return WorldTwist(c * twist.vx - s * twist.vy, s * twist.vx + c * twist.vy, twist.yaw_rate)


def compose(pose: Pose, other: Pose) -> Pose:
    """Return the pose ``other``, given in the frame of ``pose``, in the frame of that pose."""
    c, s = cos(pose.yaw), sin(pose.yaw)
    return Pose(
        pose.x + c * other.x - s * other.y, pose.y + s * other.x + c * other.y, pose.yaw + other.yaw
    )


def inverse(pose: Pose) -> Pose:
    """Return the pose of the parent in the child's frame."""
    c, s = cos(pose.yaw), sin(pose.yaw)
    return Pose(-c * pose.x - s * pose.y, s * pose.x - c * pose.y, -pose.yaw)


def move(pose: Pose, twist: BodyTwist, dt: float) -> Pose:
    """Return the pose after a constant ``twist`` over ``dt`` s: the exponential map of SE(2).

    The path is a circular arc (Sola, Deray & Atchuthan, "A micro Lie theory", 2018, eq. 156-158).
    The yaw is not wrapped.
    """
    turn = twist.yaw_rate * dt
    half = 0.5 * turn
    if abs(turn) < 1e-4:  # series of sin(a) / a and (1 - cos(a)) / a; error below 1e-17
        along, across = 1.0 - turn * turn / 6.0, half * (1.0 - turn * turn / 12.0)
    else:  # 1 - cos(a) = 2 sin(a / 2)^2, without cancellation
        along, across = sin(turn) / turn, sin(half) ** 2 / half
    bx = (along * twist.vx - across * twist.vy) * dt
    by = (across * twist.vx + along * twist.vy) * dt
    c, s = cos(pose.yaw), sin(pose.yaw)
    return Pose(pose.x + c * bx - s * by, pose.y + s * bx + c * by, pose.yaw + turn)


def twist_between(pose: Pose, goal: Pose, dt: float) -> BodyTwist:
    """Return the constant body twist from ``pose`` to ``goal`` in ``dt`` s: the logarithm of SE(2).

    Inverse of :func:`move`, with the turn wrapped to [-pi, pi). Sola, Deray & Atchuthan, 2018,
    eq. 159-160, with the half-angle form V^-1 = (a/2) [[cot(a/2), 1], [-1, cot(a/2)]].
    """
    turn = wrap(goal.yaw - pose.yaw)
    half = 0.5 * turn
    along = 1.0 - half * half / 3.0 if abs(half) < 1e-4 else half / tan(half)
    dx, dy = goal.x - pose.x, goal.y - pose.y
    c, s = cos(pose.yaw), sin(pose.yaw)
    bx, by = c * dx + s * dy, -s * dx + c * dy
    return BodyTwist((along * bx + half * by) / dt, (along * by - half * bx) / dt, turn / dt)
