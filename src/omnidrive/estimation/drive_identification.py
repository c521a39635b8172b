"""Recursive identification of drive gains, lag and delay, from commands and measured poses.

Model of every axis of B (x, y, yaw): the commanded twist u takes effect after the delay D and, with
the gain g, through the lag T of the motors. Their twist m, with a disturbance d, which is constant
in W as the force of a slope is, moves the robot as in :class:`~.drive_response.DriveModel`::

    T dm/dt = g u(t - D) - m

Displacement, body twist and disturbance of every axis are the states of a Kalman filter. The three
gains, T and D have a filter of their own, whose regressors are the sensitivities of the pose that
the first filter predicts (Friedland, "Treatment of bias in recursive filtering", IEEE Trans.
Autom. Control 14, 1969): the recursive prediction error method (Ljung, "System Identification",
2nd ed. 1999, section 11.4) for an innovations model. The sensitivities are difference quotients
over a standard deviation of a parameter, because the derivatives vanish at the friction limit,
although a lag delays the slip (Norgaard, Poulsen & Ravn, "New developments in state estimation for
nonlinear systems", Automatica 36, 2000).

Old information is forgotten exponentially towards the prior knowledge, so that the covariance stays
bounded without excitation (Salgado, Goodwin & Middleton, "Modified least squares algorithm
incorporating exponential resetting and forgetting", Int. J. Control 47, 1988). The gain of an axis
along which the robot hardly moves is not corrected.
"""

from __future__ import annotations

from math import cos, isfinite, sin, sqrt

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.estimation.drive_memory import (
    DELAY,
    LAG,
    PARAMETERS,
    DriveMemory,
    DriveSettings,
    initial_error,
    restart,
)
from omnidrive.estimation.drive_response import (
    LINEAR,
    SLIPPING,
    WATCHED,
    DriveModel,
    Motion,
    axis_slopes,
    inverse_lags,
    respond,
    unit_of,
)
from omnidrive.geometry import wrap
from omnidrive.robot.slip import Vector

_LEAST_STEP = 0.005
"""Least step of the difference quotients by lag and delay, s."""
_VELOCITY = 0.003
"""Standard deviation of the velocity that the model does not explain, m/s."""
_RIPPLE, _TURN_RIPPLE = 0.005, 0.05
"""Likewise per unit of speed and of yaw rate times the radius of gyration: rollers and their rows
change the effective radii."""
_RIPPLE_TIME = 0.05
"""Time for which such an error lasts, s."""
_ACCELERATION = 0.15
"""Standard deviation of the acceleration that the model does not explain, m/s^2."""
_SLIP_ACCELERATION = 6.0
"""Likewise with all wheels at the friction limit, m/s^2."""
_DRIFT = 0.005
"""Standard deviation of the change of the disturbance in a second, m/s."""
_MIN_VARIANCE = 1e-12
"""Least variance of a measured position, m^2."""
_MIN_SPEED, _MIN_SHARE = 0.02, 0.05
"""Least speed along an axis, m/s, and least share of the total speed, for its gain to be
corrected."""
_BOUND = 3.0
"""Standard deviations to which an innovation is limited before it changes the parameters."""
_GATE = 8.0
"""Standard deviations beyond which a measured pose is one of a robot that was moved."""
_LARGEST = 1e6
"""Largest sum of the absolute states, covariances and sensitivities, SI units; a robot with larger
ones does not exist."""
_UNKNOWN_TWIST = 1.0
"""Standard deviation of the twist after a restart, m/s."""

_REST = (0.0, 0.0, 0.0)
_wrap_angle = inlined(wrap)


@compiled
def identify(  # noqa: PLR0917
    model: DriveModel,
    settings: DriveSettings,
    memory: DriveMemory,
    command: Vector,
    dt: float,
    pose: Vector,
    variances: Vector,
    fresh: bool,
) -> None:
    """Update the estimates by one sample.

    Args:
        model: Response of the robot to the twist of its motors.
        settings: Bounds and forgetting.
        memory: Changed in place.
        command: Body twist that was commanded for the last ``dt`` seconds; the delay is not
            subtracted.
        dt: Time since the last sample, s; positive.
        pose: Measured pose in W, now; m, m, rad.
        variances: Of the pose along x, y and yaw of B; m^2, m^2, rad^2; not negative.
        fresh: Whether the pose is a new measurement; otherwise the motion is only predicted.
    """
    if not isfinite(command[0] + command[1] + command[2] + dt):
        return
    commands = memory.commands
    for k in range(len(commands) - 1, 0, -1):
        for j in range(4):
            commands[k, j] = commands[k - 1, j]
    commands[0, 0], commands[0, 1], commands[0, 2] = command
    commands[0, 3] = dt
    _predict(model, memory, dt)
    if fresh and isfinite(pose[0] + pose[1] + pose[2] + variances[0] + variances[1] + variances[2]):
        _correct(model, settings, memory, pose, variances, dt)
    if not _size(memory) < _LARGEST:
        restart(memory, pose if isfinite(pose[0] + pose[1] + pose[2]) else _REST, _REST)
        for a in range(3):
            memory.state_covariance[a, 1, 1] = (unit_of(model, a) * _UNKNOWN_TWIST) ** 2


@inlined
def _size(memory: DriveMemory) -> float:
    """Return the sum of the absolute states, covariances and sensitivities; NaN if one is NaN."""
    size = 0.0
    for a in range(3):
        for i in range(3):
            size += abs(memory.states[i, a])
            for j in range(3):
                size += abs(memory.state_covariance[a, i, j])
        for k in range(4):
            for i in range(PARAMETERS):
                size += abs(memory.sensitivity[k, a, i])
    return size


@inlined
def _step(memory: DriveMemory, parameter: int) -> float:
    """Return the step of the difference quotients by a parameter: its standard error."""
    least = _LEAST_STEP if parameter >= LAG else _MIN_VARIANCE
    return max(sqrt(memory.covariance[parameter, parameter]), least)


@inlined
def _predict(model: DriveModel, memory: DriveMemory, dt: float) -> None:
    """Predict pose, states, their covariances and their sensitivities over ``dt`` (s)."""
    p, pose, mode = memory.parameters, memory.pose, LINEAR
    start, gains, rates = _motion(memory, 0, 0.0), (p[0], p[1], p[2]), inverse_lags(model)
    commands = memory.commands
    end = respond(model, rates, gains, p[LAG], p[DELAY], start, commands, dt, WATCHED)
    if end.saturation > 0.0:
        mode = SLIPPING
        end = respond(model, rates, gains, p[LAG], p[DELAY], start, commands, dt, SLIPPING)
    _predict_covariances(model, rates, memory, end, dt)
    for i in range(PARAMETERS):
        _predict_sensitivities(model, rates, memory, i, end, dt, mode)
    pose[0] += end.displacement[0]
    pose[1] += end.displacement[1]
    pose[2] = end.displacement[2]
    for a in range(3):
        memory.states[0, a] = end.motors[a]
        memory.states[1, a] = end.twist[a]
        memory.states[2, a] = end.disturbance[a]
    memory.figures[3] = end.saturation


@inlined
def _motion(memory: DriveMemory, parameter: int, delta: float) -> Motion:
    """Return the estimated motion for a parameter that is larger by ``delta``."""
    states, sens, i = memory.states, memory.sensitivity, parameter
    return Motion(
        (0.0, 0.0, memory.pose[2] + delta * sens[0, 2, i]),
        (
            states[0, 0] + delta * sens[1, 0, i],
            states[0, 1] + delta * sens[1, 1, i],
            states[0, 2] + delta * sens[1, 2, i],
        ),
        (
            states[1, 0] + delta * sens[2, 0, i],
            states[1, 1] + delta * sens[2, 1, i],
            states[1, 2] + delta * sens[2, 2, i],
        ),
        (
            states[2, 0] + delta * sens[3, 0, i],
            states[2, 1] + delta * sens[3, 1, i],
            states[2, 2] + delta * sens[3, 2, i],
        ),
        0.0,
    )


@inlined
def _predict_sensitivities(  # noqa: PLR0917
    model: DriveModel,
    rates: Vector,
    memory: DriveMemory,
    parameter: int,
    end: Motion,
    dt: float,
    mode: int,
) -> None:
    """Predict the sensitivities to a parameter; ``end`` is the motion for the estimates."""
    p, sens, i = memory.parameters, memory.sensitivity, parameter
    delta = _step(memory, i)
    gains = (
        p[0] + (delta if i == 0 else 0.0),
        p[1] + (delta if i == 1 else 0.0),
        p[2] + (delta if i == 2 else 0.0),
    )
    lag, delay = p[LAG] + (delta if i == LAG else 0.0), p[DELAY] + (delta if i == DELAY else 0.0)
    start = _motion(memory, i, delta)
    other = respond(model, rates, gains, lag, delay, start, memory.commands, dt, mode)
    c, s = cos(memory.pose[2]), sin(memory.pose[2])
    x, y = sens[0, 0, i], sens[0, 1, i]
    dx = c * x - s * y + (other.displacement[0] - end.displacement[0]) / delta
    dy = s * x + c * y + (other.displacement[1] - end.displacement[1]) / delta
    c, s = cos(end.displacement[2]), sin(end.displacement[2])
    sens[0, 0, i], sens[0, 1, i] = c * dx + s * dy, c * dy - s * dx
    sens[0, 2, i] = (other.displacement[2] - end.displacement[2]) / delta
    for a in range(3):
        sens[1, a, i] = (other.motors[a] - end.motors[a]) / delta
        sens[2, a, i] = (other.twist[a] - end.twist[a]) / delta
        sens[3, a, i] = (other.disturbance[a] - end.disturbance[a]) / delta


@inlined
def _predict_covariances(
    model: DriveModel, rates: Vector, memory: DriveMemory, end: Motion, dt: float
) -> None:
    """Predict the covariance of the states of every axis.

    An acceleration that changes within the sample, with the variance q over the sample, adds
    q dt^2 / 3, q dt / 2 and q to the variance of displacement and twist. One that is constant in
    the sample would add q dt^2 / 4: exact poses would then make the estimated twist oscillate.
    """
    bx, by, bw = end.twist
    turning = abs(bw) / unit_of(model, 2)
    velocity = _VELOCITY + _RIPPLE * sqrt(bx * bx + by * by) + _TURN_RIPPLE * turning
    time = sqrt(dt * _RIPPLE_TIME)
    acceleration = _ACCELERATION + _SLIP_ACCELERATION * end.saturation
    slipping = _SLIP_ACCELERATION * end.saturation * time
    for a in range(3):
        p, unit = memory.state_covariance[a], unit_of(model, a)
        m, n, f, g = axis_slopes(rates[a], end.saturation, dt)
        # F P F^T with F = [[1, m, n], [0, f, g], [0, 0, 1]], from the columns of F P
        pp, pb, pd, bb, bd, dd = p[0, 0], p[0, 1], p[0, 2], p[1, 1], p[1, 2], p[2, 2]
        p_d = pd + m * bd + n * dd
        p_b = pb + m * bb + n * bd
        b_d = f * bd + g * dd
        free = acceleration * time  # the lag removes part of it
        by_pose = unit * (0.5 * n * free + 0.5 * dt * slipping)
        by_twist = unit * (g * free + slipping)
        p[0, 0] = pp + m * pb + n * pd + m * p_b + n * p_d + 4.0 / 3.0 * by_pose * by_pose
        p[0, 0] += (unit * velocity * time) ** 2
        p[0, 1] = f * p_b + g * p_d + by_pose * by_twist
        p[0, 2] = p_d
        p[1, 1] = f * (f * bb + g * bd) + g * b_d + by_twist * by_twist
        p[1, 2] = b_d
        p[2, 2] = dd + (unit * _DRIFT) ** 2 * dt
        p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]


@inlined
def _correct(  # noqa: PLR0917
    model: DriveModel,
    settings: DriveSettings,
    memory: DriveMemory,
    pose: Vector,
    variances: Vector,
    dt: float,
) -> None:
    """Correct parameters and states by a measured pose."""
    yaw = memory.pose[2]
    c, s = cos(yaw), sin(yaw)
    dx, dy = pose[0] - memory.pose[0], pose[1] - memory.pose[1]
    innovation = (c * dx + s * dy, c * dy - s * dx, _wrap_angle(pose[2] - yaw))
    if _is_moved(memory, innovation, variances):
        _move(memory, pose, innovation, variances, dt)
        return
    change, shift = memory.work[0], memory.work[1]
    change[:] = 0.0
    for a in range(3):
        _correct_parameters(model, memory, a, innovation[a], variances[a], change)
        shift[a] = _correct_states(memory, a, innovation[a], variances[a])
    _limit(settings, memory, change)
    sens, states = memory.sensitivity, memory.states
    for a in range(3):
        for i in range(PARAMETERS):
            shift[a] += sens[0, a, i] * change[i]
            states[0, a] += sens[1, a, i] * change[i]
            states[1, a] += sens[2, a, i] * change[i]
            states[2, a] += sens[3, a, i] * change[i]
    memory.pose[0] += c * shift[0] - s * shift[1]
    memory.pose[1] += s * shift[0] + c * shift[1]
    memory.pose[2] += shift[2]
    _forget(settings, memory, dt)


@inlined
def _is_moved(memory: DriveMemory, innovation: Vector, variances: Vector) -> bool:
    """Return whether an innovation is one of a robot that was moved by hand or by a collision."""
    moved = False
    for a in range(3):
        total = memory.state_covariance[a, 0, 0] + variances[a] + _MIN_VARIANCE
        for i in range(PARAMETERS):
            for j in range(PARAMETERS):
                sens = memory.sensitivity[0, a, i] * memory.sensitivity[0, a, j]
                total += sens * memory.covariance[i, j]
        moved = moved or abs(innovation[a]) > _GATE * sqrt(total)
    return moved


@inlined
def _move(
    memory: DriveMemory, pose: Vector, innovation: Vector, variances: Vector, dt: float
) -> None:
    """Continue at a measured pose with an unknown twist."""
    for a in range(3):
        p = memory.state_covariance[a]
        memory.pose[a] = pose[a]
        p[0, :] = 0.0
        p[:, 0] = 0.0
        p[0, 0] = variances[a]
        p[1, 1] += (innovation[a] / dt) ** 2
        memory.sensitivity[0, a, :] = 0.0


@inlined
def _correct_parameters(  # noqa: PLR0917
    model: DriveModel,
    memory: DriveMemory,
    axis: int,
    innovation: float,
    variance: float,
    change: Float[Array, " 5"],
) -> None:
    """Add the correction of the parameters by the displacement along an axis to ``change``.

    The gain of an axis without motion, and of a wrong prediction, is uncertain but not corrected
    (Schmidt's "consider" filter, with the covariance in Joseph's form).
    """
    cov, sens = memory.covariance, memory.sensitivity[0, axis]
    h, gains = memory.work[2], memory.work[3]
    total = memory.state_covariance[axis, 0, 0] + variance + _MIN_VARIANCE
    for i in range(PARAMETERS):
        h[i], gains[i] = 0.0, 0.0
        for j in range(PARAMETERS):
            h[i] += cov[i, j] * sens[j]
        total += sens[i] * h[i]
        innovation -= sens[i] * change[i]
    deviation = sqrt(total)
    memory.figures[axis] = innovation / deviation
    innovation = min(max(innovation, -_BOUND * deviation), _BOUND * deviation)
    vx, vy, rate = memory.states[1, 0], memory.states[1, 1], memory.states[1, 2]
    speed = sqrt(vx * vx + vy * vy) + abs(rate) / unit_of(model, 2)
    for i in range(PARAMETERS):
        along = abs(memory.states[1, i]) / unit_of(model, i) if i < LAG else 0.0
        if i >= LAG or along > _MIN_SPEED + _MIN_SHARE * speed:
            gains[i] = h[i] / total
            change[i] += gains[i] * innovation
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            cov[i, j] += gains[i] * gains[j] * total - gains[i] * h[j] - h[i] * gains[j]


@inlined
def _correct_states(memory: DriveMemory, axis: int, innovation: float, variance: float) -> float:
    """Correct twist and disturbance of an axis, as if the parameters were known.

    Returns:
        The correction of the displacement.
    """
    p, sens = memory.state_covariance[axis], memory.sensitivity
    total = p[0, 0] + variance + _MIN_VARIANCE
    row = (p[0, 0], p[0, 1], p[0, 2])
    gains = (row[0] / total, row[1] / total, row[2] / total)
    memory.states[1, axis] += gains[1] * innovation
    memory.states[2, axis] += gains[2] * innovation
    for i in range(PARAMETERS):
        by = sens[0, axis, i]
        sens[0, axis, i] -= gains[0] * by
        sens[2, axis, i] -= gains[1] * by
        sens[3, axis, i] -= gains[2] * by
    for i in range(3):
        for j in range(3):
            p[i, j] -= gains[i] * row[j]
    return gains[0] * innovation


@inlined
def _limit(settings: DriveSettings, memory: DriveMemory, change: Float[Array, " 5"]) -> None:
    """Add the change to the parameters, within the bounds; the change is corrected accordingly.

    A parameter at its bound changes the others by its covariances with them: the projection in the
    metric of the covariance.
    """
    cov, p = memory.covariance, memory.parameters
    for i in range(PARAMETERS):
        excess = _clip(settings, i, p[i] + change[i]) - (p[i] + change[i])
        if excess != 0.0 and cov[i, i] > 0.0:
            for j in range(PARAMETERS):
                change[j] += cov[j, i] / cov[i, i] * excess
    for i in range(PARAMETERS):
        new = _clip(settings, i, p[i] + change[i])
        change[i] = new - p[i]
        p[i] = new


@inlined
def _clip(settings: DriveSettings, parameter: int, value: float) -> float:
    """Return a parameter within its bounds."""
    if parameter < LAG:
        return min(max(value, settings.min_gain), settings.max_gain)
    largest = settings.max_lag if parameter == LAG else settings.max_delay
    return min(max(value, 0.0), largest)


@inlined
def _forget(settings: DriveSettings, memory: DriveMemory, dt: float) -> None:
    """Forget information: its matrix P^-1 decays towards the inverse of the initial covariance."""
    cov, old, share = memory.covariance, memory.work[3:], min(dt / settings.memory, 0.5)
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            old[i, j] = cov[i, j]
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            kept = 0.0
            for k in range(PARAMETERS):
                kept += old[i, k] * old[k, j] / initial_error(k) ** 2
            cov[i, j] += share * (old[i, j] - kept)
