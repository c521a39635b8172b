"""Recursive identification of drive gains, lag and delay, from commands and measured poses.

Model of every axis of B (x, y, yaw): the commanded twist u takes effect after the delay D and, with
the gain g, through the lag T of the motors; that in yaw is another one. Their twist m, with a
disturbance d, which is constant in W as the force of a slope is, moves the robot as in
:class:`~.drive_response.DriveModel`::

    T dm/dt = g u(t - D) - m

Several delays D are compared: the known one, and one and two sample times more. A continuous D
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

from math import cos, isfinite, log, sin, sqrt
from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive_estimate import HYPOTHESES, DriveSettings
from omnidrive.estimation.drive_prediction import predict
from omnidrive.estimation.drive_response import DriveModel, inverse_lags, unit_of
from omnidrive.estimation.identification_state import (
    LAG,
    PARAMETERS,
    DriveMemory,
    Hypothesis,
    apply_parameters,
    forget,
    hypothesis,
    initialize,
    limit_parameters,
    memory_in,
    restart,
    restart_hypothesis,
    update_estimate,
)
from omnidrive.geometry.kernels import wrap
from omnidrive.robot.slip import Vector

_MIN_VARIANCE = 1e-12
"""Least variance of a measured position, m^2."""
_MIN_SPEED, _MIN_SHARE = 0.01, 0.02
"""Least speed along an axis, m/s, and least share of the total speed, for its gain to be
corrected."""
_BOUND = 3.0
"""Standard deviations to which an innovation is limited before it changes the parameters."""
_SCALE_MEMORY, _LARGEST_SQUARE, _CAUTION = 0.5, 25.0, 4.0
"""Of the mean square of the innovations over their variance: time constant of the mean, s; largest
term; and the factor of the variances over the mean, because innovations that no hypothesis explains
are not independent of each other."""
_SLIP_CAUTION = 30.0
"""Factor of the variances with all wheels at the friction limit, in addition: a wrong friction
lasts for the whole slip, so that its innovations are not independent of each other either."""
_GATE = 24.0
"""Standard deviations beyond which a measured pose is one of a robot that was moved."""
_LARGEST_EVIDENCE = 64.0
"""Largest square of an innovation over its variance in a likelihood."""
_CHANGE = 3.0
"""Logarithm of the likelihood ratio above which another delay is chosen."""
_LIKELIHOOD_MEMORY = 5.0
"""Time constant with which the likelihoods are forgotten, s."""
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
    known: Float[Array, " 5"],
    values: Float[Array, " values"],
    now: DriveSample,
    drive: Float[Array, " drive"],
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
        known: Gains of x, y and yaw, lag (s) and delay (s) before the first sample.
        values: The memory, see :func:`~.identification_state.memory_in`; changed in place.
        now: The sample.
        drive: Output; what a controller should use: gains, lag in x and y, delay, one value that
            is left as it is, and the lag in yaw.
    """
    memory = memory_in(values)
    if event == START:
        initialize(memory, known, now.dt)
    if event in (START, RESTART):
        restart(memory, now.pose, now.twist)
    elif isfinite(now.command[0] + now.command[1] + now.command[2] + now.dt):
        _update(model, settings, memory, now, event == CONTINUE)
    update_estimate(memory)
    apply_parameters(memory, drive)


@compiled
def _update(
    model: DriveModel,
    settings: DriveSettings,
    memory: DriveMemory,
    now: DriveSample,
    update_parameters: bool,
) -> None:
    """Predict and correct every hypothesis, and choose one; update parameters and delay, too."""
    commands, dt, pose, variances = memory.commands, now.dt, now.pose, now.variances
    for k in range(len(commands) - 1, 0, -1):
        for j in range(4):
            commands[k, j] = commands[k - 1, j]
    commands[0, 0], commands[0, 1], commands[0, 2] = now.command
    commands[0, 3] = dt
    measured = isfinite(pose[0] + pose[1] + pose[2] + variances[0] + variances[1] + variances[2])
    fresh = now.fresh and measured
    rates, excess = inverse_lags(model), memory.figures[0, 5]
    for k in range(HYPOTHESES):
        excess = min(excess, memory.figures[k, 5])
    scale = max(1.0, _CAUTION * excess)
    for k in range(HYPOTHESES):
        h = hypothesis(memory, k)
        predict(model, rates, h, commands, dt)
        if fresh:
            _correct(model, settings, h, pose, variances, dt, scale, update_parameters)
        if not _size(h) < _LARGEST:
            restart_hypothesis(h, pose if measured else _REST, _REST)
            for a in range(3):
                h.state_covariance[a, 1, 1] = (unit_of(model, a) * _UNKNOWN_TWIST) ** 2
    if fresh and update_parameters:
        _compare(memory, dt, scale, min(excess, 1.0))
        _choose(settings, memory)


@compiled
def _compare(memory: DriveMemory, dt: float, scale: float, unexplained: float) -> None:
    """Update the likelihoods of the delays by the latest innovations.

    The variance that wheel slip adds is that of the hypothesis with most slip: it is an upper
    bound, so that its logarithm must not decide. The caution with slip is needed only as far as no
    hypothesis explains the slip: one that does so has the right friction.

    Args:
        memory: Changed in place.
        dt: Time since the last sample, s.
        scale: Factor of the variances without slip.
        unexplained: Mean square of the innovations of the best hypothesis over their variance, up
            to 1.
    """
    innovations, figures = memory.innovations, memory.figures
    for k in range(HYPOTHESES):
        figures[k, 4] *= max(1.0 - dt / _LIKELIHOOD_MEMORY, 0.0)
    for a in range(3):
        largest = 0.0
        for k in range(HYPOTHESES):
            slips = _SLIP_CAUTION * figures[k, 3]
            share = (scale + unexplained * slips) / (scale + slips)
            largest = max(largest, share * innovations[k, a, 1])
        for k in range(HYPOTHESES):
            total = largest + innovations[k, a, 2]
            square = min(innovations[k, a, 0] ** 2 / total, _LARGEST_EVIDENCE)
            figures[k, 4] -= 0.5 * (square + log(total / largest))


@compiled
def _choose(settings: DriveSettings, memory: DriveMemory) -> None:
    """Choose the delay that explains the motion far better than the present one, if any does."""
    scores, chosen = memory.figures[:, 4], int(memory.chosen[0])
    best = scores[chosen] + _CHANGE
    for k in range(HYPOTHESES):
        if scores[k] > best and memory.delays[k] <= settings.max_delay:
            chosen, best = k, scores[k]
    memory.chosen[0] = chosen


@compiled
def _size(h: Hypothesis) -> float:
    """Return the sum of the absolute states, covariances and sensitivities; NaN if one is NaN."""
    size = 0.0
    for a in range(3):
        for i in range(3):
            size += abs(h.states[i, a])
            for j in range(3):
                size += abs(h.state_covariance[a, i, j])
        for k in range(4):
            for i in range(PARAMETERS):
                size += abs(h.sensitivity[k, a, i])
    return size


@compiled
def _correct(  # noqa: PLR0917
    model: DriveModel,
    settings: DriveSettings,
    h: Hypothesis,
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
    change, shift = h.work[0], h.work[1]
    change[:] = 0.0
    for a in range(3):
        if update_parameters:
            _correct_parameters(model, h, a, innovation[a], change)
        shift[a] = _correct_states(h, a, innovation[a], variances[a])
    limit_parameters(settings, h, change)
    sens, states = h.sensitivity, h.states
    for a in range(3):
        for i in range(PARAMETERS):
            shift[a] += sens[0, a, i] * change[i]
            states[0, a] += sens[1, a, i] * change[i]
            states[1, a] += sens[2, a, i] * change[i]
            states[2, a] += sens[3, a, i] * change[i]
    h.pose[0] += c * shift[0] - s * shift[1]
    h.pose[1] += s * shift[0] + c * shift[1]
    h.pose[2] += shift[2]
    forget(settings, h, dt)


@compiled
def _record(  # noqa: PLR0917
    h: Hypothesis,
    innovation: Vector,
    variances: Vector,
    dt: float,
    scale: float,
    update_parameters: bool,
) -> None:
    """Record innovations and their variances, from the states and from the parameters.

    What parameters could explain counts as unexplained where they are not corrected.
    """
    largest = 0.0
    for a in range(3):
        by_parameters = 0.0
        for i in range(PARAMETERS):
            for j in range(PARAMETERS):
                sens = h.sensitivity[0, a, i] * h.sensitivity[0, a, j]
                by_parameters += sens * h.covariance[i, j]
        h.innovations[a, 0] = innovation[a]
        known = h.state_covariance[a, 0, 0] + variances[a] + _MIN_VARIANCE
        h.innovations[a, 1] = (scale + _SLIP_CAUTION * h.figures[3]) * known
        h.innovations[a, 2] = by_parameters
        largest = max(
            largest, innovation[a] ** 2 / (known + (by_parameters if update_parameters else 0.0))
        )
    share = min(dt / _SCALE_MEMORY, 1.0)
    h.figures[5] += share * (min(largest, _LARGEST_SQUARE) - h.figures[5])


@compiled
def _is_moved(h: Hypothesis, innovation: Vector) -> bool:
    """Return whether an innovation is one of a robot that was moved by hand or by a collision."""
    moved = False
    for a in range(3):
        total = h.innovations[a, 1] + h.innovations[a, 2]
        moved = moved or abs(innovation[a]) > _GATE * sqrt(total)
    return moved


@compiled
def _move(h: Hypothesis, pose: Vector, innovation: Vector, variances: Vector, dt: float) -> None:
    """Continue at a measured pose with an unknown twist."""
    for a in range(3):
        p = h.state_covariance[a]
        h.pose[a] = pose[a]
        p[0, :] = 0.0
        p[:, 0] = 0.0
        p[0, 0] = variances[a]
        p[1, 1] += (innovation[a] / dt) ** 2
        h.sensitivity[0, a, :] = 0.0


@compiled
def _correct_parameters(
    model: DriveModel,
    h: Hypothesis,
    axis: int,
    innovation: float,
    change: Float[Array, " parameters"],
) -> None:
    """Add the correction of the parameters by the displacement along an axis to ``change``.

    The gain of an axis without motion, and of a wrong prediction, is uncertain but not corrected
    (Schmidt's "consider" filter, with the covariance in Joseph's form).
    """
    cov, sens = h.covariance, h.sensitivity[0, axis]
    ph, gains = h.work[2], h.work[3]
    total = h.innovations[axis, 1]
    for i in range(PARAMETERS):
        ph[i], gains[i] = 0.0, 0.0
        for j in range(PARAMETERS):
            ph[i] += cov[i, j] * sens[j]
        total += sens[i] * ph[i]
        innovation -= sens[i] * change[i]
    deviation = sqrt(total)
    h.figures[axis] = innovation / deviation
    innovation = min(max(innovation, -_BOUND * deviation), _BOUND * deviation)
    vx, vy, rate = h.states[1, 0], h.states[1, 1], h.states[1, 2]
    speed = sqrt(vx * vx + vy * vy) + abs(rate) / unit_of(model, 2)
    for i in range(PARAMETERS):
        along = abs(h.states[1, i]) / unit_of(model, i) if i < LAG else 0.0
        if i >= LAG or along > _MIN_SPEED + _MIN_SHARE * speed:
            gains[i] = ph[i] / total
            change[i] += gains[i] * innovation
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            cov[i, j] += gains[i] * gains[j] * total - gains[i] * ph[j] - ph[i] * gains[j]


@compiled
def _correct_states(h: Hypothesis, axis: int, innovation: float, variance: float) -> float:
    """Correct twist and disturbance of an axis, as if the parameters were known.

    Returns:
        The correction of the displacement.
    """
    p, sens = h.state_covariance[axis], h.sensitivity
    total = p[0, 0] + variance + _MIN_VARIANCE
    row = (p[0, 0], p[0, 1], p[0, 2])
    gains = (row[0] / total, row[1] / total, row[2] / total)
    h.states[1, axis] += gains[1] * innovation
    h.states[2, axis] += gains[2] * innovation
    for i in range(PARAMETERS):
        by = sens[0, axis, i]
        sens[0, axis, i] -= gains[0] * by
        sens[2, axis, i] -= gains[1] * by
        sens[3, axis, i] -= gains[2] * by
    for i in range(3):
        for j in range(3):
            p[i, j] -= gains[i] * row[j]
    correction: float = gains[0] * innovation
    return correction
