"""Response of a robot to commanded twists, with gains, lag, delay and wheel slip, as a kernel."""

from __future__ import annotations

from math import ceil, cos, exp, sin, sqrt
from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.robot.slip import Vector

_STEP = 0.025
"""Largest integration step, s: the input of the slip model is constant within it."""
_SLIP_STEP = 0.3
"""Likewise while wheels are at the friction limit, as a share of the lag in translation."""
_MAX_STEPS = 30
"""Integration steps in a sample at the friction limit."""
_MIN_LAG = 1e-5
"""In s; shorter lags have the same effect."""
_ROUNDING = 1e-9
"""Share of an integration step by which a step may be longer."""

LINEAR, WATCHED, SLIPPING = 0, 1, 2
"""Modes of :func:`respond`: no wheel slips; the same, and the saturation tells whether one would;
wheels slip at the friction limit."""


class DriveModel(NamedTuple):
    """Motion of a robot with slipping wheels under the twist m that its motors follow.

    Displacement s, body twist b and disturbance d, in B; w is the yaw rate::

        f_i = clip(rim_jacobian_i @ (stiffness (m + d - b)), -max_force, max_force)
        inertia (db/dt + w x b) = rim_jacobian^T f

    The fields are those of :class:`~omnidrive.control.nmpc.holonomic.slip_model.SlipModel`.
    """

    rim_jacobian: Float[Array, "wheels 3"]
    """Rim velocities per unit of body twist; 1, 1 and m/rad."""
    inertia: Float[Array, " 3"]
    """Mass in kg, twice, and yaw inertia in kg m^2."""
    stiffness: Float[Array, " 3"]
    """Force per slip velocity in translation, twice, and in rotation, in N s/m."""
    max_force: float
    """Friction limit of a wheel, in N; infinite: no wheel slips."""


class Motion(NamedTuple):
    """State of a response; the vectors are along x, y and yaw."""

    displacement: Vector
    """Displacement in W since the start, m, m; and the yaw, rad."""
    motors: Vector
    """Twist m that the motors follow, in B; m/s, m/s, rad/s."""
    twist: Vector
    """Body twist, likewise."""
    disturbance: Vector
    """Disturbance, likewise; constant in W."""
    saturation: float
    """Mean share of wheels at the friction limit since the start; see :data:`WATCHED`."""


@compiled
def unit_of(model: DriveModel, axis: int) -> float:
    """Return 1, for the yaw axis the inverse radius of gyration, in rad/m."""
    return sqrt(model.inertia[0] / model.inertia[2]) if axis == 2 else 1.0


@compiled
def inverse_lags(model: DriveModel) -> Vector:
    """Return the inverse time constants below the friction limit, 1/s."""
    x, y, yaw = _squares(model.rim_jacobian)
    stiffness, inertia = model.stiffness, model.inertia
    fastest = 1.0 / _MIN_LAG
    return (
        min(stiffness[0] * x / inertia[0], fastest),
        min(stiffness[1] * y / inertia[1], fastest),
        min(stiffness[2] * yaw / inertia[2], fastest),
    )


@compiled
def _squares(jacobian: Float[Array, "wheels 3"]) -> Vector:
    x, y, yaw = 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        x += jacobian[i, 0] ** 2
        y += jacobian[i, 1] ** 2
        yaw += jacobian[i, 2] ** 2
    return x, y, yaw


@compiled
def respond(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    gains: Vector,
    lag: float,
    yaw_lag: float,
    delay: float,
    start: Motion,
    commands: Float[Array, "commands 4"],
    dt: float,
    mode: int,
) -> Motion:
    """Return the motion after ``dt`` seconds.

    Args:
        model: Response to the twist of the motors.
        rates: :func:`inverse_lags` of the model.
        gains: Ratio of the twist that the motors follow to the commanded one, for every axis.
        lag: Time constant with which the motors follow in x and y, s.
        yaw_lag: Likewise in yaw, s.
        delay: Time from a command until it takes effect, s.
        start: The motion at the start; its displacement is zero besides the yaw.
        commands: Earlier commands, the latest one first: body twist, and the time for which it was
            held, s. The latest one ends now.
        dt: In s.
        mode: :data:`LINEAR`, :data:`WATCHED` or :data:`SLIPPING`.
    """
    lag, yaw_lag, motion = max(lag, _MIN_LAG), max(yaw_lag, _MIN_LAG), start
    step = min(_STEP, max(_SLIP_STEP / rates[0], dt / _MAX_STEPS)) if mode == SLIPPING else _STEP
    begin, row = 0.0, 0
    for k in range(len(commands)):  # the command that acts at the start
        begin -= commands[k, 3]
        row = k
        if begin + delay <= -dt:
            break
    first = -dt
    for k in range(row, -1, -1):
        begin += commands[k, 3]
        end = min(begin + delay, 0.0)
        if end - first > _ROUNDING * dt:
            goal = (gains[0] * commands[k, 0], gains[1] * commands[k, 1], gains[2] * commands[k, 2])
            steps = ceil((end - first) / step - _ROUNDING)
            span = (end - first) / steps
            motion = _hold(model, rates, motion, goal, lag, yaw_lag, span, steps, mode)
            first = end
    x, y, yaw = motion.displacement
    ox, oy, ow = motion.disturbance
    turn = yaw - start.displacement[2]
    c, s = cos(turn), sin(turn)
    return Motion(
        (x, y, yaw),
        motion.motors,
        motion.twist,
        (c * ox + s * oy, c * oy - s * ox, ow),
        motion.saturation / dt,
    )


@compiled
def _hold(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    motion: Motion,
    goal: Vector,
    lag: float,
    yaw_lag: float,
    h: float,
    steps: int,
    mode: int,
) -> Motion:
    """Return the motion after some steps of ``h`` (s) with a constant goal of the motors.

    Without slip the body twist is exact for the mean of the motors' twist in every step. The
    saturation is its integral over time.
    """
    (x, y, yaw), (mx, my, mw), (bx, by, bw), disturbance, saturation = motion
    decay = exp(-h / lag)
    share = lag / h * (1.0 - decay)
    yaw_decay = exp(-h / yaw_lag)
    yaw_share = yaw_lag / h * (1.0 - yaw_decay)
    ex, ey, ew = exp(-h * rates[0]), exp(-h * rates[1]), exp(-h * rates[2])
    qx, qy = (1.0 - ex) / (h * rates[0]), (1.0 - ey) / (h * rates[1])
    qw = (1.0 - ew) / (h * rates[2])
    c, s = cos(yaw), sin(yaw)
    for _ in range(steps):
        input_x = goal[0] + share * (mx - goal[0]) + disturbance[0]
        input_y = goal[1] + share * (my - goal[1]) + disturbance[1]
        input_w = goal[2] + yaw_share * (mw - goal[2]) + disturbance[2]
        mx = goal[0] + decay * (mx - goal[0])
        my = goal[1] + decay * (my - goal[1])
        mw = goal[2] + yaw_decay * (mw - goal[2])
        cx, cy = input_x + bw * by / rates[0], input_y - bw * bx / rates[1]
        ax, ay, aw = cx + qx * (bx - cx), cy + qy * (by - cy), input_w + qw * (bw - input_w)
        nx, ny, nw = cx + ex * (bx - cx), cy + ey * (by - cy), input_w + ew * (bw - input_w)
        if mode == WATCHED:
            if _peak(model, (input_x - bx, input_y - by, input_w - bw)) >= model.max_force:
                saturation += h
        elif mode == SLIPPING:
            slip = (input_x - ax, input_y - ay, input_w - aw)
            slipping, fx, fy, fw = _limited_wrench(model, slip)
            if slipping > 0.0:
                saturation += slipping * h
                inertia = model.inertia
                nx, ny = bx + h * (fx / inertia[0] + bw * by), by + h * (fy / inertia[1] - bw * bx)
                nw = bw + h * fw / inertia[2]
                ax, ay, aw = 0.5 * (bx + nx), 0.5 * (by + ny), 0.5 * (bw + nw)
        # turn by half an angle, move, turn by the other half; by the Cayley transform
        tangent = 0.25 * h * aw
        square = 1.0 / (1.0 + tangent * tangent)
        p, q = (1.0 - tangent * tangent) * square, 2.0 * tangent * square
        c, s = c * p - s * q, s * p + c * q
        x, y, yaw = x + h * (c * ax - s * ay), y + h * (s * ax + c * ay), yaw + h * aw
        c, s = c * p - s * q, s * p + c * q
        bx, by, bw = nx, ny, nw
    return Motion((x, y, yaw), (mx, my, mw), (bx, by, bw), disturbance, saturation)


@compiled
def _peak(model: DriveModel, slip: Vector) -> float:
    """Return the largest force of a wheel, N, that a slip velocity calls for."""
    jacobian, peak = model.rim_jacobian, 0.0
    fx, fy = model.stiffness[0] * slip[0], model.stiffness[1] * slip[1]
    fw = model.stiffness[2] * slip[2]
    for i in range(len(jacobian)):
        peak = max(peak, abs(jacobian[i, 0] * fx + jacobian[i, 1] * fy + jacobian[i, 2] * fw))
    return peak


@compiled
def _limited_wrench(model: DriveModel, slip: Vector) -> tuple[float, float, float, float]:
    """Return the share of slipping wheels, and the wrench of all wheels; N, N, N m."""
    jacobian, limit = model.rim_jacobian, model.max_force
    fx, fy = model.stiffness[0] * slip[0], model.stiffness[1] * slip[1]
    fw = model.stiffness[2] * slip[2]
    slipping, gx, gy, gw = 0.0, 0.0, 0.0, 0.0
    for i in range(len(jacobian)):
        x, y, yaw = jacobian[i, 0], jacobian[i, 1], jacobian[i, 2]
        force = x * fx + y * fy + yaw * fw
        if abs(force) >= limit:
            force = limit if force > 0.0 else -limit
            slipping += 1.0 / len(jacobian)
        gx, gy, gw = gx + x * force, gy + y * force, gw + yaw * force
    return slipping, gx, gy, gw


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
