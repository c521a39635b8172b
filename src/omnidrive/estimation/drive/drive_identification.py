"""Recursive identification of drive gains, lag and delay, from commands and measured poses.

Model of every axis of B (x, y, yaw): the commanded twist u takes effect after the delay D and, with
the gain g, through the lag T of the motors; that in yaw is another one. Their twist m, with a
disturbance d, which is constant in W as the force of a slope is, moves the robot as in
:class:`~omnidrive.robot.drive_model.DriveModel`::

    T dm/dt = g u(t - D) - m

Hypotheses are compared: the known delay D, and one to four sample times more, each with parameters
of its own; and the known drive, whose parameters are not corrected. A continuous D
would have local minima, because a delay and a lag are alike to smooth motions and an oscillation
repeats itself. For each of them, displacement, body twist and disturbance of every axis are the
states of a Kalman filter. The three gains and two lags have a filter of their own, whose regressors
are the sensitivities of the pose that the first filter predicts (Friedland, "Treatment of bias in
recursive filtering", IEEE Trans. Autom. Control 14, 1969): the recursive prediction error method
(Ljung, "System Identification", 2nd ed. 1999, section 11.4) for an innovations model. The
sensitivities are difference quotients over a standard deviation of a parameter, because the
derivatives vanish at the friction limit, although a lag delays the slip (Norgaard, Poulsen & Ravn,
"New developments in state estimation for nonlinear systems", Automatica 36, 2000). The likelihoods
of the innovations choose the delay (Magill, "Optimal adaptive estimation of sampled stochastic
processes", IEEE Trans. Autom. Control 10, 1965).

Old information is forgotten exponentially towards the prior knowledge, so that the covariance stays
bounded without excitation (Salgado, Goodwin & Middleton, "Modified least squares algorithm
incorporating exponential resetting and forgetting", Int. J. Control 47, 1988). The gain of an axis
along which the robot hardly moves is not corrected.

The assumed variances are those of a right model. Where the innovations of the best hypothesis are
larger, all variances are, in proportion: evidence is compared with what no hypothesis explains.
"""

from __future__ import annotations

from math import cos, inf, isfinite, sin, sqrt
from typing import Any, NamedTuple

from omnidrive.compiled import compiled
from omnidrive.estimation.drive.drive_prediction import predict
from omnidrive.estimation.drive.hypothesis_choice import (
    SLIP_CAUTION,
    choose,
    compare,
    variance_scale,
)
from omnidrive.estimation.drive.identification_state import (
    GAINS,
    PARAMETERS,
    IdentificationMemory,
    apply_parameters,
    forget,
    initialize,
    limit_parameters,
    named,
    restart,
    restart_hypothesis,
    update_estimate,
)
from omnidrive.estimation.drive_estimate import DriveSettings
from omnidrive.geometry.kernels import wrap
from omnidrive.robot.drive_model import DriveModel, axis_unit, inverse_lags
from omnidrive.robot.slip import Vector

_MIN_VARIANCE = 1e-12
"""Least variance of a measured position, m^2."""
_MIN_SPEED, _MIN_SHARE = 0.01, 0.02
"""Least speed along an axis, m/s, and least share of the total speed, for its gain to be
corrected."""
_BOUND = 3.0
"""Standard deviations to which an innovation is limited before it changes the parameters."""
_SCALE_MEMORY, _LARGEST_SQUARE = 0.5, 25.0
"""Of the mean square of the innovations over their variance: time constant of the mean, s, and the
largest term."""
_LAG_TOLERANCE = 0.004
"""Standard deviation of the error of the lag of the model, s."""
_GATE = 24.0
"""Standard deviations beyond which a measured pose is one of a robot that was moved."""
_LARGEST = 1e6
"""Largest sum of the absolute states, covariances and sensitivities, SI units; a robot with larger
ones does not exist."""
_UNKNOWN_TWIST = 1.0
"""Standard deviation of the twist after a restart, m/s."""

_REST = (0.0, 0.0, 0.0)

CONTINUE, RESTART, START, APPROACH = 0, 1, 2, 3
"""Events of :func:`identify`."""


class DriveSample(NamedTuple):
    """What is known of a sample."""

    command: Vector
    """Body twist that was commanded for the last ``dt`` seconds; the delay is not subtracted."""
    dt: float
    """Time since the last sample, s; positive."""
    pose: Vector
    """Measured pose in W, now; m, m, rad."""
    twist: Vector
    """Body twist at a restart; m/s, m/s, rad/s."""
    variances: Vector
    """Of the pose along x, y and yaw of B; m^2, m^2, rad^2; not negative."""
    fresh: bool
    """Whether the pose is a new measurement; otherwise the motion is only predicted."""


@compiled
def identify(  # noqa: PLR0917
    event: int,
    model: DriveModel,
    settings: DriveSettings,
    known: Any,
    memory: IdentificationMemory,
    now: DriveSample,
) -> None:
    """Update the estimates by one sample.

    Args:
        event: :data:`CONTINUE`; :data:`APPROACH`, the same while a distant target is approached at
            the limit of acceleration, where parameters and delay are not corrected: wheels slip,
            and a wrong friction looks like a wrong gain; :data:`RESTART` at a known pose and steady
            twist, with the estimates of the parameters; or :data:`START` with the known parameters,
            and ``dt`` is the sample time.
        model: Response of the robot to the twist of its motors.
        settings: Bounds and forgetting.
        known: Parameters before the first sample, a record of
            :data:`~omnidrive.estimation.drive_estimate.DRIVE_PARAMETERS`.
        memory: Changed in place.
        now: The sample.
    """
    state, commands = memory.state[0], memory.commands
    if event == START:
        initialize(state, known[0], now.dt)
    if event in (START, RESTART):
        restart(state, commands, now.pose, now.twist)
    elif isfinite(now.command[0] + now.command[1] + now.command[2] + now.dt):
        _update(model, settings, state, commands, now, event == CONTINUE)
    update_estimate(state)
    apply_parameters(state)


@compiled
def _update(  # noqa: PLR0917
    model: DriveModel,
    settings: DriveSettings,
    state: Any,
    commands: Any,
    now: DriveSample,
    update_parameters: bool,
) -> None:
    """Predict and correct every hypothesis, and choose one; update parameters and delay, too."""
    dt, pose, variances, latest = now.dt, now.pose, now.variances, commands[0]
    for k in range(len(commands) - 1, 0, -1):
        commands[k] = commands[k - 1]
    latest.twist[0], latest.twist[1], latest.twist[2] = now.command
    latest.duration = dt
    measured = isfinite(pose[0] + pose[1] + pose[2] + variances[0] + variances[1] + variances[2])
    fresh = now.fresh and measured
    rates, excess = inverse_lags(model), inf
    for h in state.hypotheses:
        excess = min(excess, h.mean_square)
    scale = variance_scale(excess)
    for h in state.hypotheses:
        predict(model, rates, h, state.variants, commands, dt)
        if fresh:
            _correct(model, settings, h, state.work, pose, variances, dt, scale, update_parameters)
        if not _size(h) < _LARGEST:
            restart_hypothesis(h, pose if measured else _REST, _REST)
            for a in range(3):
                h.state_covariance[a, 1, 1] = (axis_unit(model, a) * _UNKNOWN_TWIST) ** 2
    if fresh:
        compare(state, dt, excess)
        choose(settings, state, not update_parameters)


@compiled
def _size(h: Any) -> float:
    """Return the sum of the absolute states, covariances and sensitivities; NaN if one is NaN."""
    size, sens = 0.0, h.sensitivity
    for a in range(3):
        size += abs(h.motors[a]) + abs(h.twist[a]) + abs(h.disturbance[a])
        for i in range(3):
            for j in range(3):
                size += abs(h.state_covariance[a, i, j])
        for i in range(PARAMETERS):
            size += abs(sens.displacement[a, i]) + abs(sens.motors[a, i])
            size += abs(sens.twist[a, i]) + abs(sens.disturbance[a, i])
    return size


@compiled
def _correct(  # noqa: PLR0917
    model: DriveModel,
    settings: DriveSettings,
    h: Any,
    work: Any,
    pose: Vector,
    variances: Vector,
    dt: float,
    scale: float,
    update_parameters: bool,
) -> None:
    """Correct the states, and with ``update_parameters`` the parameters, by a measured pose."""
    yaw = h.pose[2]
    c, s = cos(yaw), sin(yaw)
    dx, dy = pose[0] - h.pose[0], pose[1] - h.pose[1]
    innovation = (c * dx + s * dy, c * dy - s * dx, wrap(pose[2] - yaw))
    _record(h, innovation, variances, dt, scale, update_parameters)
    if _is_moved(h, innovation):
        _move(h, pose, innovation, variances, dt)
        return
    change, shift = work.change, work.shift
    change[:] = 0.0
    for a in range(3):
        if update_parameters:
            _correct_parameters(model, h, work, a, innovation[a])
        shift[a] = _correct_states(h, a, innovation[a], variances[a])
    limit_parameters(settings, h, change)
    sens = h.sensitivity
    for a in range(3):
        for i in range(PARAMETERS):
            shift[a] += sens.displacement[a, i] * change[i]
            h.motors[a] += sens.motors[a, i] * change[i]
            h.twist[a] += sens.twist[a, i] * change[i]
            h.disturbance[a] += sens.disturbance[a, i] * change[i]
    h.pose[0] += c * shift[0] - s * shift[1]
    h.pose[1] += s * shift[0] + c * shift[1]
    h.pose[2] += shift[2]
    forget(settings, h, work.old, dt)


@compiled
def _record(  # noqa: PLR0917
    h: Any,
    innovation: Vector,
    variances: Vector,
    dt: float,
    scale: float,
    update_parameters: bool,
) -> None:
    """Record innovations and their variances, from the states and from the parameters.

    What parameters could explain counts as unexplained where they are not corrected.
    """
    largest, recorded = 0.0, h.innovation
    for a in range(3):
        by_parameters, sens = 0.0, h.sensitivity.displacement[a]
        for i in range(PARAMETERS if update_parameters else 0):
            for j in range(PARAMETERS):
                by_parameters += sens[i] * sens[j] * h.covariance[i, j]
        known = h.state_covariance[a, 0, 0] + variances[a] + _MIN_VARIANCE
        recorded.value[a], recorded.by_parameters[a] = innovation[a], by_parameters
        by = named(sens)
        by_lag = by.lag + by.excess if a == 2 else by.lag
        recorded.variance[a] = (scale + SLIP_CAUTION * h.saturation) * known
        recorded.variance[a] += (_LAG_TOLERANCE * by_lag) ** 2
        largest = max(largest, innovation[a] ** 2 / (known + by_parameters))
    share = min(dt / _SCALE_MEMORY, 1.0)
    h.mean_square += share * (min(largest, _LARGEST_SQUARE) - h.mean_square)


@compiled
def _is_moved(h: Any, innovation: Vector) -> bool:
    """Return whether an innovation is one of a robot that was moved by hand or by a collision."""
    moved = False
    for a in range(3):
        total = h.innovation.variance[a] + h.innovation.by_parameters[a]
        moved = moved or abs(innovation[a]) > _GATE * sqrt(total)
    return moved


@compiled
def _move(h: Any, pose: Vector, innovation: Vector, variances: Vector, dt: float) -> None:
    """Continue at a measured pose with an unknown twist."""
    for a in range(3):
        p = h.state_covariance[a]
        h.pose[a] = pose[a]
        p[0, :] = 0.0
        p[:, 0] = 0.0
        p[0, 0] = variances[a]
        p[1, 1] += (innovation[a] / dt) ** 2
        h.sensitivity.displacement[a, :] = 0.0


@compiled
def _correct_parameters(model: DriveModel, h: Any, work: Any, axis: int, innovation: float) -> None:
    """Add the correction of the parameters by the displacement along an axis to ``work.change``.

    The gain of an axis without motion, and of a wrong prediction, is uncertain but not corrected
    (Schmidt's "consider" filter, with the covariance in Joseph's form).
    """
    cov, sens = h.covariance, h.sensitivity.displacement[axis]
    change, cross, gains = work.change, work.cross, work.gains
    total = h.innovation.variance[axis]
    for i in range(PARAMETERS):
        cross[i], gains[i] = 0.0, 0.0
        for j in range(PARAMETERS):
            cross[i] += cov[i, j] * sens[j]
        total += sens[i] * cross[i]
        innovation -= sens[i] * change[i]
    deviation = sqrt(total)
    innovation = min(max(innovation, -_BOUND * deviation), _BOUND * deviation)
    vx, vy, rate = h.twist
    speed = sqrt(vx * vx + vy * vy) + abs(rate) / axis_unit(model, 2)
    for i in range(PARAMETERS):
        moves = i >= GAINS  # the lags
        if not moves:
            moves = abs(h.twist[i]) / axis_unit(model, i) > _MIN_SPEED + _MIN_SHARE * speed
        if moves:
            gains[i] = cross[i] / total
            change[i] += gains[i] * innovation
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            cov[i, j] += gains[i] * gains[j] * total - gains[i] * cross[j] - cross[i] * gains[j]


@compiled
def _correct_states(h: Any, axis: int, innovation: float, variance: float) -> float:
    """Correct twist and disturbance of an axis, as if the parameters were known.

    Returns:
        The correction of the displacement.
    """
    p, sens = h.state_covariance[axis], h.sensitivity
    total = p[0, 0] + variance + _MIN_VARIANCE
    row = (p[0, 0], p[0, 1], p[0, 2])
    gains = (row[0] / total, row[1] / total, row[2] / total)
    h.twist[axis] += gains[1] * innovation
    h.disturbance[axis] += gains[2] * innovation
    for i in range(PARAMETERS):
        by = sens.displacement[axis, i]
        sens.displacement[axis, i] -= gains[0] * by
        sens.twist[axis, i] -= gains[1] * by
        sens.disturbance[axis, i] -= gains[2] * by
    for i in range(3):
        for j in range(3):
            p[i, j] -= gains[i] * row[j]
    correction: float = gains[0] * innovation
    return correction
