"""Errors before and command after the channels of the tracking PID controller; pure functions."""

from __future__ import annotations

from math import cos, expm1, sin
from typing import NamedTuple

from omnidrive.compiled import compilable
from omnidrive.control.pid.laws import FASTEST, saturate
from omnidrive.geometry import BodyTwist, Pose, WorldTwist
from omnidrive.geometry.kernels import to_world, twist_between, wrap

Vector = tuple[float, float, float]


class Pair(NamedTuple):
    """A number for translation and one for rotation."""

    translation: float
    rotation: float


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
def time_between(before: float, t: float, dt: float) -> float:
    """Return the time since the previous sample, s; ``dt``, the sample time, if it is not later."""
    return t - before if t > before else dt


@compilable
def whole_samples(elapsed: float, dt: float) -> float:
    """Return the time since the previous pose as a whole number of sample times, s.

    The sample times of a run may vary a little.
    """
    return dt * max(1, round(elapsed / dt))


@compilable
def rate_of_error(pose: Pose, previous: Pose, motion: WorldTwist, elapsed: float) -> Vector:
    """Return the mean rate of the error in B since the previous pose, without reference jumps.

    It is zero at an outlier: a rate that no robot reaches, which would stay in the low-pass filter.

    Args:
        pose: Pose of B in W.
        previous: Pose at the previous sample with a usable one.
        motion: Motion of the reference since then, in W.
        elapsed: Time since then, s; see :func:`whole_samples`.
    """
    vx = motion.vx - (pose.x - previous.x) / elapsed
    vy = motion.vy - (pose.y - previous.y) / elapsed
    yaw_rate = motion.yaw_rate - wrap(pose.yaw - previous.yaw) / elapsed
    if max(abs(vx), abs(vy)) > FASTEST:
        return 0.0, 0.0, 0.0
    return _in_body(pose.yaw, vx, vy, yaw_rate)


@compilable
def lead(  # noqa: PLR0917
    motion: WorldTwist, begin: Vector, end: Vector, lags: Pair, maximum: Pair, dt: float
) -> WorldTwist:
    """Return the mean command that moves a robot with a first-order lag as ``motion``.

    ``v = lag dv/dt + response``, averaged over a sample: the lag times the change of the velocity.

    Args:
        motion: Mean velocity of the reference in the sample, in W.
        begin: Its velocity at the begin of the sample, in W; m/s, m/s, rad/s.
        end: Likewise at the end.
        lags: Pair of translation and rotation, s.
        maximum: Greatest accelerations that are led, m/s^2 and rad/s^2: a jump is not.
        dt: Sample time, s.
    """
    along = saturate(complex(end[0] - begin[0], end[1] - begin[1]), maximum.translation * dt)
    turn = saturate(end[2] - begin[2], maximum.rotation * dt)
    return WorldTwist(
        motion.vx + lags.translation / dt * along.real,
        motion.vy + lags.translation / dt * along.imag,
        motion.yaw_rate + lags.rotation / dt * turn,
    )


@compilable
def _lagged(lag: float, command: float, before: float, dt: float) -> tuple[float, float]:
    """Return mean and end of the response to a constant command, from the response ``before``."""
    if lag <= 0.0:
        return command, command
    fallen = -expm1(-dt / lag)
    change = command - before
    return command - change * fallen * lag / dt, before + change * fallen


@compilable
def missing_motion(  # noqa: PLR0917
    pose: Pose,
    previous: Pose,
    command: BodyTwist,
    response: BodyTwist,
    lags: Pair,
    maximum: Pair,
    dt: float,
) -> tuple[Vector, BodyTwist]:
    """Return the predicted minus the measured mean twist of a sample, and the predicted twist.

    The prediction is a first-order lag of the robot's velocity in W, because most of the lag is due
    to its mass; both twists are in the frame halfway between the two headings. A prediction that
    needs more than the greatest accelerations is reduced to them, and the difference is zero: the
    wheels slip, and what they miss does not last. A command that no robot executes, as for a
    position that is wrong by kilometres, predicts rest.

    Args:
        pose: Pose of B in W at the end of the sample.
        previous: Pose at its begin.
        command: Command during the sample.
        response: Twist predicted for its begin.
        lags: Lags of translation and rotation, s.
        maximum: Greatest accelerations, m/s^2 and rad/s^2.
        dt: Duration of the sample, s.

    Returns:
        The difference in m/s, m/s and rad/s, and the twist predicted for the end of the sample.
    """
    fastest = max(abs(command.vx), abs(command.vy), abs(response.vx), abs(response.vy))
    if max(fastest, abs(command.yaw_rate), abs(response.yaw_rate)) > FASTEST:
        return (0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
    turn = wrap(pose.yaw - previous.yaw)
    x, y, _ = _in_body(0.5 * turn, response.vx, response.vy, 0.0)
    mean_x, end_x = _lagged(lags.translation, command.vx, x, dt)
    mean_y, end_y = _lagged(lags.translation, command.vy, y, dt)
    mean_turn, end_turn = _lagged(lags.rotation, command.yaw_rate, response.yaw_rate, dt)
    change = complex(end_x - x, end_y - y)
    reached = saturate(change, maximum.translation * dt)
    turned = saturate(end_turn - response.yaw_rate, maximum.rotation * dt)
    x, y, _ = _in_body(0.5 * turn, x + reached.real, y + reached.imag, 0.0)
    predicted = BodyTwist(x, y, response.yaw_rate + turned)
    if reached != change or turned != end_turn - response.yaw_rate:
        return (0.0, 0.0, 0.0), predicted
    measured = twist_between(previous, Pose(pose.x, pose.y, previous.yaw + turn), dt)
    missing = (mean_x - measured.vx, mean_y - measured.vy, mean_turn - measured.yaw_rate)
    return missing, predicted


@compilable
def saturated(x: float, y: float, turn: float, limits: Pair) -> BodyTwist:
    """Return corrections within the limits of speed (m/s) and yaw rate (rad/s).

    Those of x and y are saturated together, which keeps their direction.
    """
    velocity = saturate(complex(x, y), limits.translation)
    return BodyTwist(velocity.real, velocity.imag, saturate(turn, limits.rotation))


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
