"""Response of a robot to commanded twists, with gains, lag, delay and wheel slip, as a kernel."""

from __future__ import annotations

from math import ceil, exp
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.robot.drive_model import DriveModel, limited_wrench, slips
from omnidrive.robot.slip import Vector, accelerate

_STEP = 0.025
"""Largest integration step, s: the input of the slip model is constant within it."""
_SLIP_STEP = 0.3
"""Likewise while wheels are at the friction limit, as a share of the lag in translation."""
_MAX_STEPS = 30
"""Integration steps in a sample at the friction limit."""
_MIN_LAG = 1e-5
"""In s; shorter lags have the same effect."""
_SETTLED = 40.0
"""Number of time constants after which the deviation from the goal is less than rounding."""
_ROUNDING = 1e-9
"""Share of an integration step by which a step may be longer."""


SENT_COMMAND = np.dtype([("twist", "f8", 3), ("duration", "f8")], align=True)
"""A commanded body twist (m/s, m/s, rad/s), and the time for which it was held, s."""

_HEADING = np.dtype([("cos", "f8"), ("sin", "f8")], align=True)

VARIANT = np.dtype([
    ("gains", "f8", 3),
    ("lag", "f8"),
    ("yaw_lag", "f8"),
    ("pose", "f8", 3),
    ("start", _HEADING),
    ("heading", _HEADING),
    ("motors", "f8", 3),
    ("twist", "f8", 3),
    ("disturbance", "f8", 3),
], align=True)  # fmt: skip
"""A drive and its motion: gains along x, y and yaw; lags of the motors in x and y, and in yaw, s;
pose in F (m, m, rad); cosine and sine of the yaw in F at the start, and now; twist that the motors
follow, body twist and disturbance (constant in W), in B (m/s, m/s, rad/s). F is the frame B of the
first variant at the start."""


@compiled
def respond_variants(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    variants: Any,
    delay: float,
    commands: Any,
    dt: float,
) -> float:
    """Continue the motions of all variants by ``dt`` seconds.

    The steps are the same for all variants, so that their differences contain no error of
    integration: they are short while wheels slip in the motion of the first one.

    Args:
        model: Response to the twist of the motors.
        rates: :func:`inverse_lags` of the model.
        variants: Drives, and their motions under the same commands at the start, with the pose
            of the first one at zero; records of :data:`VARIANT`, changed in place.
        delay: Time from a command until it takes effect, s.
        commands: Earlier commands, the latest one first; records of :data:`SENT_COMMAND`. The
            latest one ends now.
        dt: In s.

    Returns:
        Mean share of wheels at the friction limit, of the first variant.
    """
    short = min(_STEP, max(_SLIP_STEP / rates[0], dt / _MAX_STEPS))
    begin, row, saturation = 0.0, 0, 0.0
    for k in range(len(commands)):  # the command that acts at the start
        begin -= commands[k].duration
        row = k
        if begin + delay <= -dt:
            break
    first = -dt
    for k in range(row, -1, -1):
        begin += commands[k].duration
        end = min(begin + delay, 0.0)
        while end - first > _ROUNDING * dt:
            h = (end - first) / ceil((end - first) / _STEP - _ROUNDING)
            motors, _ = _motor_response(variants[0], commands[k].twist, h)
            bx, by, bw = variants[0].twist
            is_slipping = slips(model, motors, (bx, by, bw))
            if is_slipping:
                h = min(short, end - first)
            saturation += h * _step(model, rates, variants, commands[k].twist, h, is_slipping)
            first += h
        first = max(first, end)
    for v in variants:
        p = v.heading.cos * v.start.cos + v.heading.sin * v.start.sin
        q = v.heading.sin * v.start.cos - v.heading.cos * v.start.sin
        ox, oy, ow = v.disturbance
        _set(v.disturbance, p * ox + q * oy, p * oy - q * ox, ow)
    return saturation / dt


@compiled
def _motor_response(variant: Any, command: Float[Array, " 3"], h: float) -> tuple[Vector, Vector]:
    """Return the mean twist of the motors in ``h`` (s) plus the disturbance, and the final one."""
    gains, lag, yaw_lag = variant.gains, variant.lag, variant.yaw_lag
    gx, gy, gw = gains[0] * command[0], gains[1] * command[1], gains[2] * command[2]
    mx, my, mw = variant.motors
    ox, oy, ow = variant.disturbance
    decay, share = _decay(lag, h)
    yaw_decay, yaw_share = (decay, share) if yaw_lag == lag else _decay(yaw_lag, h)
    mx, my, mw = mx - gx, my - gy, mw - gw
    mean = (gx + share * mx + ox, gy + share * my + oy, gw + yaw_share * mw + ow)
    return mean, (gx + decay * mx, gy + decay * my, gw + yaw_decay * mw)


@compiled
def _step(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    variants: Any,
    command: Float[Array, " 3"],
    h: float,
    is_slipping: bool,
) -> float:
    """Continue the motions of all variants by ``h`` (s) with a constant command.

    Without slip the body twist is exact for the mean of the motors' twist in the step.

    Returns:
        Share of wheels at the friction limit, of the first variant.
    """
    ix, iy, iw = 1.0 / rates[0], 1.0 / rates[1], 1.0 / rates[2]
    ex, ey, ew = exp(-h * rates[0]), exp(-h * rates[1]), exp(-h * rates[2])
    qx, qy, qw = (1.0 - ex) * ix / h, (1.0 - ey) * iy / h, (1.0 - ew) * iw / h
    saturation, inertia = 0.0, model.inertia
    for i in range(len(variants)):
        v = variants[i]
        mean, motors = _motor_response(v, command, h)
        x, y, yaw = v.pose
        c, s = v.heading.cos, v.heading.sin
        bx, by, bw = v.twist
        cx, cy, cw = mean[0] + bw * by * ix, mean[1] - bw * bx * iy, mean[2]
        ax, ay, aw = cx + qx * (bx - cx), cy + qy * (by - cy), cw + qw * (bw - cw)
        nx, ny, nw = cx + ex * (bx - cx), cy + ey * (by - cy), cw + ew * (bw - cw)
        if is_slipping:
            wrench, slipping, _ = limited_wrench(model, mean, (ax, ay, aw))
            if slipping > 0:
                nx, ny, nw = accelerate((bx, by, bw), wrench, inertia, h)
                ax, ay, aw = 0.5 * (bx + nx), 0.5 * (by + ny), 0.5 * (bw + nw)
            if i == 0:
                saturation = slipping / len(model.rim_jacobian)
        # turn by half an angle, move, turn by the other half; by the Cayley transform
        tangent = 0.25 * h * aw
        square = 1.0 / (1.0 + tangent * tangent)
        p, q = (1.0 - tangent * tangent) * square, 2.0 * tangent * square
        c, s = c * p - s * q, s * p + c * q
        x, y, yaw = x + h * (c * ax - s * ay), y + h * (s * ax + c * ay), yaw + h * aw
        v.heading.cos, v.heading.sin = c * p - s * q, s * p + c * q
        _set(v.pose, x, y, yaw)
        _set(v.motors, motors[0], motors[1], motors[2])
        _set(v.twist, nx, ny, nw)
    return saturation


@compiled
def _decay(lag: float, h: float) -> tuple[float, float]:
    """Return the final and the mean deviation from the goal of a lag after ``h`` (s).

    As shares of the initial one.
    """
    x = h / max(lag, _MIN_LAG)
    decay = exp(-x) if x < _SETTLED else 0.0
    return decay, (1.0 - decay) / x


@compiled
def _set(vector: Float[Array, " 3"], x: float, y: float, yaw: float) -> None:
    """Set the elements of a vector."""
    vector[0], vector[1], vector[2] = x, y, yaw


@compiled
def axis_slopes(rate: float, saturation: float, dt: float) -> tuple[float, float, float, float]:
    """Return derivatives of the motion along an axis without coupling to the others.

    Slipping wheels do not drive.

    Args:
        rate: Inverse lag, 1/s.
        saturation: Mean share of wheels at the friction limit.
        dt: In s.

    Returns:
        Derivatives of the displacement by the initial twist (s) and by the disturbance (s), and of
        the final twist by the same.
    """
    x = max(dt * rate * (1.0 - saturation), _ROUNDING)
    final = exp(-x)
    mean = (1.0 - final) / x
    return dt * mean, dt * (1.0 - mean), final, 1.0 - final
