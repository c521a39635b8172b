"""Commanded twist that yields a desired motion in spite of slip and lags."""

from __future__ import annotations

from math import inf

from omnidrive.compiled import compiled
from omnidrive.geometry import BodyTwist
from omnidrive.robot.drive_model import DriveModel, lags, peak_at_rim, slips
from omnidrive.robot.slip import Vector
from omnidrive.robot.slip_response import slip_response

CORRECTIONS = (6, 6)
"""Corrections of the commanded twist, in translation and of the yaw rate: each leaves about
lag / dt of the error without slip."""
_SHORT_STEP = 2.0
"""Sample time over the longest lag up to which the command only compensates the lag: with a
shorter sample time the commands that reach the desired twist within one step oscillate."""
_BISECTIONS = 8


def slip_compensation(
    model: DriveModel,
    desired: BodyTwist,
    initial: BodyTwist,
    dt: float,
    *,
    may_spin: bool = True,
) -> tuple[BodyTwist, BodyTwist]:
    """Return the commanded twist that moves the robot for ``dt`` as the desired twist would.

    Args:
        model: The model.
        desired: Constant twist that leads to the desired pose.
        initial: Twist at the start of the step.
        dt: In s.
        may_spin: Whether wheels may spin, see :func:`compensate`.

    Returns:
        The commanded twist, as near as the wheels allow; and the twist at the end of the step.
    """
    start = _vector(initial)
    mean = _vector(desired)
    commanded = compensate(model, mean, mean, start, float(dt), CORRECTIONS, may_spin)
    _, final = slip_response(model, start, commanded, float(dt))
    return BodyTwist(*commanded), BodyTwist(*final)


def _vector(twist: BodyTwist) -> Vector:
    return float(twist.vx), float(twist.vy), float(twist.yaw_rate)


@compiled
def compensate(  # noqa: PLR0917
    model: DriveModel,
    desired: Vector,
    end: Vector,
    initial: Vector,
    dt: float,
    corrections: tuple[int, int],
    may_spin: bool,
) -> Vector:
    """Return the commanded twist of :func:`slip_compensation`.

    It is found by corrections with the remaining error of the motion.

    Args:
        model: The model.
        desired: Constant twist that leads to the desired pose.
        end: Planned twist at the end of the step, for the acceleration in a short one.
        initial: Twist at the start of the step.
        dt: In s.
        corrections: Their number, in translation and of the yaw rate; the latter is not larger.
        may_spin: Whether a wheel may still spin at the end of a step if the robot cannot reach the
            desired twist: the wheels then push during the whole step, but odometry accumulates
            errors.
    """
    commanded = desired
    tau = lags(model)
    if dt < _SHORT_STEP * max(tau[0], tau[1], tau[2]):
        # of the centripetal acceleration; a lag alone is one of the body twist, see lag_response
        rate = desired[2] if model.max_force < inf else 0.0
        commanded = (
            desired[0] + tau[0] * ((end[0] - initial[0]) / dt - rate * desired[1]),
            desired[1] + tau[1] * ((end[1] - initial[1]) / dt + rate * desired[0]),
            desired[2] + tau[2] * (end[2] - initial[2]) / dt,
        )
        commanded = _saturate(model, commanded)
    else:
        translations, rotations = corrections
        for k in range(translations):
            mean, _ = slip_response(model, initial, commanded, dt)
            commanded = (
                commanded[0] + desired[0] - mean[0],
                commanded[1] + desired[1] - mean[1],
                commanded[2] + (desired[2] - mean[2] if k < rotations else 0.0),
            )
            commanded = _saturate(model, commanded)
    if may_spin:
        return commanded
    _, final = slip_response(model, initial, commanded, dt)
    if not slips(model, commanded, final):
        return commanded
    return _without_spin(model, commanded, initial, dt)


@compiled
def predict_change(
    model: DriveModel, change: Vector, initial: Vector, dt: float
) -> tuple[Vector, Vector]:
    """Return what a command that differs from the initial twist by ``change`` causes in ``dt`` (s).

    Returns:
        The desired twist for which :func:`compensate` returns this command, and the final twist.
    """
    commanded = (initial[0] + change[0], initial[1] + change[1], initial[2] + change[2])
    mean, final = slip_response(model, initial, commanded, dt)
    tau = lags(model)
    if dt < _SHORT_STEP * max(tau[0], tau[1], tau[2]):
        mean = (
            initial[0] + change[0] / (1.0 + tau[0] / dt),
            initial[1] + change[1] / (1.0 + tau[1] / dt),
            initial[2] + change[2] / (1.0 + tau[2] / dt),
        )
    return mean, final


@compiled
def _without_spin(model: DriveModel, commanded: Vector, initial: Vector, dt: float) -> Vector:
    """Reduce the commanded change by bisection until no wheel spins at the end of the step.

    Where wheels spin even without a change, because the twist itself needs more centripetal force
    than friction, the command is returned as it is: nothing but the change ends such a motion.
    """
    low, high = 0.0, 1.0
    for k in range(_BISECTIONS + 1):
        middle = 0.5 * (low + high) if k > 0 else 0.0
        reduced = _interpolate(initial, commanded, middle)
        _, final = slip_response(model, initial, reduced, dt)
        if not slips(model, reduced, final):
            low = middle
        elif k > 0:
            high = middle
        else:
            return commanded
    return _interpolate(initial, commanded, low)


@compiled
def _interpolate(start: Vector, end: Vector, fraction: float) -> Vector:
    x, y, yaw = start
    return (
        x + fraction * (end[0] - x),
        y + fraction * (end[1] - y),
        yaw + fraction * (end[2] - yaw),
    )


@compiled
def _saturate(model: DriveModel, commanded: Vector) -> Vector:
    """Return the largest multiple of a twist, at most 1, within the maximum rim speed."""
    factor = model.max_rim_speed / max(
        model.max_rim_speed, peak_at_rim(model.rim_jacobian, commanded)
    )
    return factor * commanded[0], factor * commanded[1], factor * commanded[2]
