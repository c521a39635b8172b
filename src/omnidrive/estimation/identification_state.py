"""State of the identification of the drive, and what a controller should use of it."""

from __future__ import annotations

from math import ceil, exp, prod, sqrt
from typing import NamedTuple

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.views import unsafe_array
from omnidrive.estimation.drive_estimate import (
    GAIN_ERROR,
    HYPOTHESES,
    LAG_ERROR,
    VALUES,
    YAW_LAG_ERROR,
    DriveSettings,
)
from omnidrive.estimation.drive_response import Motions
from omnidrive.robot.slip import Vector

LAG, YAW_LAG = 3, 4
"""Indices of the lag in x and y, and of what the lag in yaw exceeds it by; before them are the
gains of x, y and yaw."""
PARAMETERS = 5
"""Number of parameters that every hypothesis estimates."""
VARIANTS = 1 + PARAMETERS
"""Number of motions that every hypothesis predicts: for the estimates, and for each parameter."""

_DELAY, _APPLIED_YAW_LAG = 4, 6
"""Indices of the delay and of the lag in yaw in the parameters that a controller uses."""
_DISTURBANCE = 0.02
"""Standard deviation of the initial disturbance, m/s."""
_SIGNIFICANCE = 2.0
"""Number of standard errors up to which an estimate is not used."""


class DriveMemory(NamedTuple):
    """State of the identification; all arrays are changed in place, and zero at the start.

    They are consecutive parts of one vector, see :func:`memory_in`.

    The first index of most arrays is that of the hypothesis: one for every delay, in ascending
    order.
    """

    estimate: Float[Array, " 13"]
    """The fields of :class:`~.drive_estimate.DriveEstimate`, one after another."""
    delays: Float[Array, " delays"]
    parameters: Float[Array, "delays 5"]
    covariance: Float[Array, "delays 5 5"]
    pose: Float[Array, "delays 3"]
    states: Float[Array, "delays 3 axes"]
    state_covariance: Float[Array, "delays axes 3 3"]
    sensitivity: Float[Array, "delays 4 axes parameters"]
    innovations: Float[Array, "delays axes 3"]
    figures: Float[Array, "delays 6"]
    """These nine are the fields of :class:`Hypothesis`."""
    work: Float[Array, "8 parameters"]
    """Workspace of a correction."""
    drives: Float[Array, "variants 5"]
    poses: Float[Array, "variants 3"]
    headings: Float[Array, "variants 4"]
    motors: Float[Array, "variants 3"]
    twists: Float[Array, "variants 3"]
    disturbances: Float[Array, "variants 3"]
    """These six are the fields of :class:`~.drive_response.Motions`: the workspace of a prediction,
    with a variant for the estimates, and one for each parameter."""
    initial: Float[Array, " 5"]
    """Parameters before the first sample."""
    chosen: Float[Array, " 1"]
    """Index of the hypothesis in use."""
    commands: Float[Array, "commands 4"]
    """Earlier commands, the latest one first: body twist, and the time for which it was held."""


class Hypothesis(NamedTuple):
    """What is estimated for one delay; views of the arrays of a :class:`DriveMemory`."""

    delay: float
    """Delay of the commands, s."""
    parameters: Float[Array, " 5"]
    """Estimates: gains of x, y and yaw, lag in x and y (s), and that in yaw minus the former."""
    covariance: Float[Array, "5 5"]
    """Their covariance."""
    pose: Float[Array, " 3"]
    """Estimated pose in W; m, m, rad."""
    states: Float[Array, "3 axes"]
    """Twist of the motors, body twist and disturbance, in B; m/s, m/s, rad/s."""
    state_covariance: Float[Array, "axes 3 3"]
    """Of displacement, twist and disturbance of every axis for known parameters, in SI units."""
    sensitivity: Float[Array, "4 axes parameters"]
    """Derivatives of displacement (in B), twist of the motors, body twist and disturbance."""
    innovations: Float[Array, "axes 3"]
    """Of the last measurement, in B: innovation, and its variances for known parameters and by
    their errors."""
    figures: Float[Array, " 6"]
    """Innovation of every axis over its standard deviation; share of slipping wheels;
    logarithm of the likelihood, with forgetting; mean square of the innovations over their
    variance."""
    work: Float[Array, "8 parameters"]
    motions: Motions


@compiled
def hypothesis(memory: DriveMemory, k: int) -> Hypothesis:
    """Return what is estimated for delay ``k``."""
    return Hypothesis(
        memory.delays[k],
        memory.parameters[k],
        memory.covariance[k],
        memory.pose[k],
        memory.states[k],
        memory.state_covariance[k],
        memory.sensitivity[k],
        memory.innovations[k],
        memory.figures[k],
        memory.work,
        Motions(
            memory.drives,
            memory.poses,
            memory.headings,
            memory.motors,
            memory.twists,
            memory.disturbances,
        ),
    )


def command_count(delay: float, period: float) -> int:
    """Return the number of commands to remember, for a known delay and a sample time, s."""
    return ceil(delay / period) + HYPOTHESES + 1


_SHAPES = (
    (VALUES,),
    (HYPOTHESES,),
    (HYPOTHESES, PARAMETERS),
    (HYPOTHESES, PARAMETERS, PARAMETERS),
    (HYPOTHESES, 3),
    (HYPOTHESES, 3, 3),
    (HYPOTHESES, 3, 3, 3),
    (HYPOTHESES, 4, 3, PARAMETERS),
    (HYPOTHESES, 3, 3),
    (HYPOTHESES, 6),
    (8, PARAMETERS),
    (VARIANTS, 5),
    (VARIANTS, 3),
    (VARIANTS, 4),
    (VARIANTS, 3),
    (VARIANTS, 3),
    (VARIANTS, 3),
    (PARAMETERS,),
    (1,),
)
"""Shapes of the arrays of a memory but the last one."""
_BEGINS = tuple(sum(map(prod, _SHAPES[:k])) for k in range(len(_SHAPES) + 1))


def memory_size(commands: int) -> int:
    """Return the number of values in the memory for a number of commands."""
    return _BEGINS[-1] + 4 * commands


@compiled
def memory_in(values: Float[Array, " values"]) -> DriveMemory:
    """Return the memory in a vector of :func:`memory_size` values, which must outlive it.

    As one vector, it passes through the kernels of a controller as one array instead of twenty.
    """
    return DriveMemory(
        unsafe_array(values, _BEGINS[0], _SHAPES[0]),
        unsafe_array(values, _BEGINS[1], _SHAPES[1]),
        unsafe_array(values, _BEGINS[2], _SHAPES[2]),
        unsafe_array(values, _BEGINS[3], _SHAPES[3]),
        unsafe_array(values, _BEGINS[4], _SHAPES[4]),
        unsafe_array(values, _BEGINS[5], _SHAPES[5]),
        unsafe_array(values, _BEGINS[6], _SHAPES[6]),
        unsafe_array(values, _BEGINS[7], _SHAPES[7]),
        unsafe_array(values, _BEGINS[8], _SHAPES[8]),
        unsafe_array(values, _BEGINS[9], _SHAPES[9]),
        unsafe_array(values, _BEGINS[10], _SHAPES[10]),
        unsafe_array(values, _BEGINS[11], _SHAPES[11]),
        unsafe_array(values, _BEGINS[12], _SHAPES[12]),
        unsafe_array(values, _BEGINS[13], _SHAPES[13]),
        unsafe_array(values, _BEGINS[14], _SHAPES[14]),
        unsafe_array(values, _BEGINS[15], _SHAPES[15]),
        unsafe_array(values, _BEGINS[16], _SHAPES[16]),
        unsafe_array(values, _BEGINS[17], _SHAPES[17]),
        unsafe_array(values, _BEGINS[18], _SHAPES[18]),
        unsafe_array(values, _BEGINS[19], ((len(values) - _BEGINS[19]) // 4, 4)),
    )


@compiled
def initial_error(parameter: int) -> float:
    """Return the standard deviation of a parameter before the first sample."""
    if parameter == YAW_LAG:
        return YAW_LAG_ERROR
    return GAIN_ERROR if parameter < LAG else LAG_ERROR


@compiled
def initialize(memory: DriveMemory, drive: Float[Array, " 5"], period: float) -> None:
    """Forget everything but the initial parameters, for a new run.

    Args:
        memory: Changed in place.
        drive: Gains of x, y and yaw, lag (s) and delay (s) before the first sample.
        period: Sample time, s.
    """
    memory.chosen[0] = 0.0
    for i in range(YAW_LAG):
        memory.initial[i] = drive[i]
    memory.initial[YAW_LAG] = 0.0
    for k in range(HYPOTHESES):
        memory.delays[k] = drive[_DELAY] + k * period
        h = hypothesis(memory, k)
        h.covariance[:] = 0.0
        h.figures[:] = 0.0
        for i in range(PARAMETERS):
            h.parameters[i] = memory.initial[i]
            h.covariance[i, i] = initial_error(i) ** 2


@compiled
def restart(memory: DriveMemory, pose: Vector, twist: Vector) -> None:
    """Start at a known pose (W) with a known steady twist (B); the parameters remain."""
    for k in range(len(memory.commands)):
        for a in range(3):
            memory.commands[k, a] = twist[a] / memory.initial[a]
        memory.commands[k, 3] = 0.0
    for k in range(HYPOTHESES):
        restart_hypothesis(hypothesis(memory, k), pose, twist)


@compiled
def restart_hypothesis(h: Hypothesis, pose: Vector, twist: Vector) -> None:
    """Start as :func:`restart` does."""
    h.states[:] = 0.0
    h.state_covariance[:] = 0.0
    h.sensitivity[:] = 0.0
    for a in range(3):
        h.pose[a] = pose[a]
        h.states[0, a] = h.states[1, a] = twist[a]
        h.state_covariance[a, 2, 2] = _DISTURBANCE**2


@compiled
def apply_parameters(memory: DriveMemory, drive: Float[Array, " drive"]) -> None:
    """Set the gains, the lag (s) and the delay (s) that a controller should use.

    The delay is that of the chosen hypothesis. Gains and lag differ from the initial ones only as
    far as the difference is significant: it is multiplied by ``max(0, 1 - (c error /
    difference)^2)`` with its standard error, as in the positive-part estimator of James & Stein
    ("Estimation with quadratic loss", Proc. 4th Berkeley Symposium, 1961).
    """
    chosen, initial = int(memory.chosen[0]), memory.initial
    p, cov = memory.parameters[chosen], memory.covariance[chosen]
    for i in range(YAW_LAG):
        drive[i] = _significant(p[i], cov[i, i], initial[i])
    drive[_DELAY] = memory.delays[chosen]
    yaw_lag = max(p[LAG] + p[YAW_LAG], 0.0)
    drive[_APPLIED_YAW_LAG] = _significant(yaw_lag, yaw_lag_variance(cov), initial[LAG])


@compiled
def _significant(value: float, variance: float, initial: float) -> float:
    """Return the initial value, plus the significant part of the difference from it."""
    difference = value - initial
    bound, square = _SIGNIFICANCE * _SIGNIFICANCE * variance, difference * difference
    share = 1.0 - bound / square if square > bound else 0.0
    return float(initial + share * difference)


@compiled
def yaw_lag_variance(covariance: Float[Array, "5 5"]) -> float:
    """Return the variance of the lag in yaw."""
    sides = covariance[LAG, LAG] + covariance[YAW_LAG, YAW_LAG]
    return float(max(sides + 2.0 * covariance[LAG, YAW_LAG], 0.0))


@compiled
def update_estimate(memory: DriveMemory) -> None:
    """Fill in :attr:`DriveMemory.estimate`: that of the chosen delay, and its standard errors."""
    out, chosen = memory.estimate, int(memory.chosen[0])
    delays, parameters, scores = memory.delays, memory.parameters, memory.figures[:, 4]
    lag, delay, best = parameters[chosen, LAG], delays[chosen], scores[chosen]
    for k in range(HYPOTHESES):
        best = max(best, scores[k])
    total, by_delay, by_sum = 0.0, 0.0, 0.0
    for k in range(HYPOTHESES):
        weight = exp(scores[k] - best)
        total += weight
        by_delay += weight * (delays[k] - delay) ** 2
        difference = parameters[k, LAG] + delays[k] - lag - delay
        by_sum += weight * (memory.covariance[k, LAG, LAG] + difference * difference)
    cov, period = memory.covariance[chosen], delays[1] - delays[0]
    for i in range(YAW_LAG):
        out[i], out[6 + i] = parameters[chosen, i], sqrt(cov[i, i])
    out[4], out[5] = delay, max(lag + parameters[chosen, YAW_LAG], 0.0)
    out[10] = sqrt(by_delay / total + period * period / 12.0)  # of a uniform distribution
    out[11] = sqrt(yaw_lag_variance(cov))
    out[12] = sqrt(by_sum / total)


@compiled
def limit_parameters(
    settings: DriveSettings, h: Hypothesis, change: Float[Array, " parameters"]
) -> None:
    """Add the change to the parameters, within the bounds; the change is corrected accordingly.

    A parameter at its bound changes the others by its covariances with them: the projection in the
    metric of the covariance.
    """
    cov, p = h.covariance, h.parameters
    for i in range(PARAMETERS):
        excess = _clip(settings, i, p[i] + change[i]) - (p[i] + change[i])
        if excess != 0.0 and cov[i, i] > 0.0:
            for j in range(PARAMETERS):
                change[j] += cov[j, i] / cov[i, i] * excess
    for i in range(PARAMETERS):
        new = _clip(settings, i, p[i] + change[i])
        change[i] = new - p[i]
        p[i] = new


@compiled
def _clip(settings: DriveSettings, parameter: int, value: float) -> float:
    """Return a parameter within its bounds."""
    if parameter < LAG:
        return min(max(value, settings.min_gain), settings.max_gain)
    low = 0.0 if parameter == LAG else -settings.max_lag
    return min(max(value, low), settings.max_lag)


@compiled
def forget(settings: DriveSettings, h: Hypothesis, dt: float) -> None:
    """Forget information: its matrix P^-1 decays towards the inverse of the initial covariance."""
    cov, old, share = h.covariance, h.work[3:], min(dt / settings.memory, 0.5)
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            old[i, j] = cov[i, j]
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            kept = 0.0
            for k in range(PARAMETERS):
                kept += old[i, k] * old[k, j] / initial_error(k) ** 2
            cov[i, j] += share * (old[i, j] - kept)
