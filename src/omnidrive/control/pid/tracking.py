"""Errors before and command after the channels of the tracking PID controller; pure functions."""

from __future__ import annotations

from math import cos, sin

from omnidrive.compiled import compilable
from omnidrive.control.pid.laws import saturate
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.geometry.kernels import to_world, twist_between, wrap

Vector = tuple[float, float, float]


@compilable
def mean_velocity(begin: Vector, middle: Vector, end: Vector) -> WorldTwist:
    """Return the mean of a velocity in an interval from three values of it (Simpson's rule)."""
    return WorldTwist(
        (begin[0] + 4.0 * middle[0] + end[0]) / 6.0,
        (begin[1] + 4.0 * middle[1] + end[1]) / 6.0,
        (begin[2] + 4.0 * middle[2] + end[2]) / 6.0,
    )


@compilable
def _in_body(yaw: float, x: float, y: float, turn: float) -> Vector:
    """Rotate a difference of poses, or of twists, from W to B, whose heading is ``yaw``."""
    c, s = cos(yaw), sin(yaw)
    return c * x + s * y, -s * x + c * y, turn


@compilable
def pose_error(pose: Pose, target: Pose) -> Vector:
    """Return the difference from ``pose`` to ``target`` in B; m, m, rad (wrapped)."""
    turn = wrap(target.yaw - pose.yaw)
    return _in_body(pose.yaw, target.x - pose.x, target.y - pose.y, turn)


@compilable
def rate_of_error(
    pose: Pose, previous: Pose, motion: WorldTwist, elapsed: float, dt: float
) -> Vector:
    """Return the mean rate of the error in B since the previous pose, without reference jumps.

    The time since then is a whole number of sample times, also if these vary a little.

    Args:
        pose: Pose of B in W.
        previous: Pose at the previous sample with a usable one.
        motion: Motion of the reference since then, in W.
        elapsed: Time since then, s.
        dt: Sample time, s.
    """
    time = dt * max(1, round(elapsed / dt))
    return _in_body(
        pose.yaw,
        motion.vx - (pose.x - previous.x) / time,
        motion.vy - (pose.y - previous.y) / time,
        motion.yaw_rate - wrap(pose.yaw - previous.yaw) / time,
    )


@compilable
def saturated(x: float, y: float, turn: float, limits: tuple[float, float]) -> BodyTwist:
    """Return corrections within the limits of speed (m/s) and yaw rate (rad/s).

    Those of x and y are saturated together, which keeps their direction.
    """
    velocity = saturate(complex(x, y), limits[0])
    return BodyTwist(velocity.real, velocity.imag, saturate(turn, limits[1]))


@compilable
def twist_of(pose: Pose, motion: WorldTwist, correction: BodyTwist, dt: float) -> BodyTwist:
    """Return the body twist whose arc ends where motion plus correction would lead in ``dt`` s."""
    added = to_world(correction, pose.yaw)
    goal = Pose(
        pose.x + dt * (motion.vx + added.vx),
        pose.y + dt * (motion.vy + added.vy),
        pose.yaw + dt * (motion.yaw_rate + added.yaw_rate),
    )
    return twist_between(pose, goal, dt)
