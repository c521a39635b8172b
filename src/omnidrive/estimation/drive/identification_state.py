"""State of the identification of the drive, and what a controller should use of it."""

from __future__ import annotations

from math import ceil, exp, sqrt
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.estimation.drive_estimate import (
    DELAYS,
    DRIVE_ESTIMATE,
    DRIVE_PARAMETERS,
    GAIN_ERROR,
    LAG_ERROR,
    YAW_LAG_ERROR,
    DriveSettings,
)
from omnidrive.robot.drive_variants import SENT_COMMAND, VARIANT
from omnidrive.robot.slip import Vector

_DISTURBANCE = 0.02
"""Standard deviation of the initial disturbance, m/s."""
HYPOTHESES = 1 + DELAYS
"""Number of hypotheses: first that of the known drive, whose parameters are not corrected, then one
for each delay, in ascending order."""
KNOWN = 0
"""Hypothesis of the known drive; the next one has the same delay."""
_MAX_FORGETTING_PACE = 5.0
"""Most times that information is forgotten faster where it does not explain the motion."""
_SIGNIFICANCE = 2.0
"""Number of standard errors up to which an estimate is not used."""


class FilterParameters(NamedTuple):
    """Values of the parameters that every hypothesis estimates, in the order of its vectors."""

    gain_x: float
    """Gains of the axes: the first three parameters belong to x, y and yaw."""
    gain_y: float
    gain_yaw: float
    lag: float
    """Lag in x and y, s."""
    excess: float
    """Lag in yaw minus that in x and y, s."""


PARAMETERS = len(FilterParameters._fields)
"""Number of parameters that every hypothesis estimates."""
GAINS = 3
"""Number of gains: the first of them."""
_EXCESS = FilterParameters._fields.index("excess")
"""Index of the excess among them."""
INITIAL_ERRORS = FilterParameters(GAIN_ERROR, GAIN_ERROR, GAIN_ERROR, LAG_ERROR, YAW_LAG_ERROR)
"""Standard deviations of the parameters before the first sample."""

SENSITIVITY = np.dtype(
    [(name, "f8", (3, PARAMETERS)) for name in ("displacement", "motors", "twist", "disturbance")],
    align=True,
)
"""Derivatives by every parameter, for every axis: of the displacement in B, of the twist of the
motors, of the body twist and of the disturbance."""

INNOVATION = np.dtype(
    [("value", "f8", 3), ("variance", "f8", 3), ("by_parameters", "f8", 3)], align=True
)
"""Of the last measurement, for every axis of B: innovation; its variance for known parameters, and
that by their errors."""

HYPOTHESIS = np.dtype([
    ("delay", "f8"),
    ("parameters", "f8", PARAMETERS),
    ("covariance", "f8", (PARAMETERS, PARAMETERS)),
    ("pose", "f8", 3),
    ("motors", "f8", 3),
    ("twist", "f8", 3),
    ("disturbance", "f8", 3),
    ("state_covariance", "f8", (3, 3, 3)),
    ("sensitivity", SENSITIVITY),
    ("innovation", INNOVATION),
    ("saturation", "f8"),
    ("log_likelihood", "f8"),
    ("mean_square", "f8"),
], align=True)  # fmt: skip
"""What is estimated for one delay (s) of the commands: parameters and their covariance; pose in W;
twist of the motors, body twist and disturbance, in B; for every axis, the covariance of
displacement, twist and disturbance for known parameters, in SI units; sensitivities and innovation;
share of slipping wheels; logarithm of the likelihood, with forgetting; and mean square of the
innovations over their variance."""

WORKSPACE = np.dtype([
    ("change", "f8", PARAMETERS),
    ("shift", "f8", 3),
    ("cross", "f8", PARAMETERS),
    ("gains", "f8", PARAMETERS),
    ("old", "f8", (PARAMETERS, PARAMETERS)),
    ("variance", "f8", 3),
], align=True)  # fmt: skip
"""Of a correction: changes of the parameters and of the pose (in B); covariances of the parameters
with the innovation, and their Kalman gains; the covariance before forgetting; and variances of the
innovations that all hypotheses share."""

IDENTIFICATION = np.dtype([
    ("estimate", DRIVE_ESTIMATE),
    ("applied", DRIVE_PARAMETERS),
    ("hypotheses", HYPOTHESIS, HYPOTHESES),
    ("chosen", "i8"),
    ("is_confirmed", "i8"),
    ("initial", "f8", PARAMETERS),
    ("work", WORKSPACE),
    ("variants", VARIANT, 1 + PARAMETERS),
], align=True)  # fmt: skip
"""Estimates with their standard errors; parameters that a controller should use; the
hypotheses; index of the one in use, and whether it was once far better than all others; parameters
before the first sample; and workspaces of a correction and of a prediction, the latter with a
variant for the estimates, and one for each parameter."""


class IdentificationMemory(NamedTuple):
    """State of the identification; both arrays are changed in place, and zero at the start."""

    state: Any
    """One record of :data:`IDENTIFICATION`; empty: nothing is identified."""
    commands: Any
    """Earlier commands, the latest one first: records of
    :data:`~omnidrive.robot.drive_variants.SENT_COMMAND`."""


def identification_memory(commands: int) -> IdentificationMemory:
    """Return the memory for a number of commands; 0: nothing is identified."""
    return IdentificationMemory(
        np.zeros(min(commands, 1), IDENTIFICATION), np.zeros(commands, SENT_COMMAND)
    )


def command_count(delay: float, period: float) -> int:
    """Return the number of commands to remember, for a known delay and a sample time, s."""
    return ceil(delay / period) + DELAYS + 1


@compiled
def initialize(state: Any, known: Any, period: float) -> None:
    """Forget everything but the initial parameters, for a new run.

    Args:
        state: Changed in place.
        known: Parameters before the first sample, a record of
            :data:`~omnidrive.estimation.drive_estimate.DRIVE_PARAMETERS`.
        period: Sample time, s.
    """
    state.chosen, state.is_confirmed = KNOWN, 0
    (x, y, yaw), initial = known.gains, state.initial
    start = FilterParameters(x, y, yaw, known.lag, known.yaw_lag - known.lag)
    for i in range(PARAMETERS):
        initial[i] = start[i]
    for k in range(HYPOTHESES):
        h = state.hypotheses[k]
        h.delay = known.delay + max(k - KNOWN - 1, 0) * period
        h.covariance[:] = 0.0
        h.saturation = h.log_likelihood = h.mean_square = 0.0
        for i in range(PARAMETERS):
            h.parameters[i] = initial[i]
            if k != KNOWN:
                h.covariance[i, i] = INITIAL_ERRORS[i] ** 2


@compiled
def restart(state: Any, commands: Any, pose: Vector, twist: Vector) -> None:
    """Start at a known pose (W) with a known steady twist (B); the parameters remain."""
    for k in range(len(commands)):
        sent = commands[k]
        for a in range(3):
            sent.twist[a] = twist[a] / state.initial[a]
        sent.duration = 0.0
    for k in range(HYPOTHESES):
        restart_hypothesis(state.hypotheses[k], pose, twist)


@compiled
def restart_hypothesis(h: Any, pose: Vector, twist: Vector) -> None:
    """Start as :func:`restart` does."""
    sens = h.sensitivity
    h.state_covariance[:] = 0.0
    sens.displacement[:] = 0.0
    sens.motors[:] = 0.0
    sens.twist[:] = 0.0
    sens.disturbance[:] = 0.0
    for a in range(3):
        h.pose[a] = pose[a]
        h.motors[a] = h.twist[a] = twist[a]
        h.disturbance[a] = 0.0
        h.state_covariance[a, 2, 2] = _DISTURBANCE**2


@compiled
def named(parameters: Float[Array, " 5"]) -> FilterParameters:
    """Return the parameters in a vector by their names."""
    x, y, yaw, lag, excess = parameters
    return FilterParameters(x, y, yaw, lag, excess)


@compiled
def variances_of(covariance: Float[Array, "5 5"]) -> FilterParameters:
    """Return the variances of the parameters by their names."""
    return named(np.diag(covariance))


@compiled
def yaw_lag_variance(covariance: Float[Array, "5 5"]) -> float:
    """Return the variance of the lag in yaw, a sum of two parameters."""
    variances, with_lag = variances_of(covariance), named(covariance[_EXCESS]).lag
    return float(max(variances.lag + variances.excess + 2.0 * with_lag, 0.0))


@compiled
def apply_parameters(state: Any) -> None:
    """Set the parameters that a controller should use.

    The delay is that of the chosen hypothesis. Gains and lag differ from the initial ones only as
    far as the difference is significant: it is multiplied by ``max(0, 1 - (c error /
    difference)^2)`` with its standard error, as in the positive-part estimator of James & Stein
    ("Estimation with quadratic loss", Proc. 4th Berkeley Symposium, 1961).
    """
    h, applied, initial = state.hypotheses[state.chosen], state.applied, named(state.initial)
    p, variances = named(h.parameters), variances_of(h.covariance)
    for a in range(3):
        applied.gains[a] = _significant(p[a], variances[a], initial[a])
    applied.lag = _significant(p.lag, variances.lag, initial.lag)
    applied.delay = h.delay
    yaw_lag, known = max(p.lag + p.excess, 0.0), initial.lag + initial.excess
    applied.yaw_lag = _significant(yaw_lag, yaw_lag_variance(h.covariance), known)


@compiled
def _significant(value: float, variance: float, initial: float) -> float:
    """Return the initial value, plus the significant part of the difference from it."""
    difference = value - initial
    bound, square = _SIGNIFICANCE * _SIGNIFICANCE * variance, difference * difference
    share = 1.0 - bound / square if square > bound else 0.0
    return float(initial + share * difference)


@compiled
def update_estimate(state: Any) -> None:
    """Fill in the estimate: that of the chosen delay, and its standard errors."""
    out, hypotheses, chosen = (
        state.estimate,
        state.hypotheses,
        state.hypotheses[max(state.chosen, KNOWN + 1)],
    )
    p, variances, best = named(chosen.parameters), variances_of(chosen.covariance), -np.inf
    for h in hypotheses:
        best = max(best, h.log_likelihood)
    total, by_delay, by_sum = 0.0, 0.0, 0.0
    for h in hypotheses:
        weight = exp(h.log_likelihood - best)
        total += weight
        by_delay += weight * (h.delay - chosen.delay) ** 2
        difference = named(h.parameters).lag + h.delay - p.lag - chosen.delay
        by_sum += weight * (variances_of(h.covariance).lag + difference * difference)
    for a in range(3):
        out.gains[a], out.gain_errors[a] = p[a], sqrt(variances[a])
    out.lag, out.lag_error = p.lag, sqrt(variances.lag)
    period = hypotheses[KNOWN + 2].delay - hypotheses[KNOWN + 1].delay
    out.delay = chosen.delay
    out.delay_error = sqrt(by_delay / total + period * period / 12.0)  # of a uniform distribution
    out.yaw_lag = max(p.lag + p.excess, 0.0)
    out.yaw_lag_error = sqrt(yaw_lag_variance(chosen.covariance))
    out.sum_error = sqrt(by_sum / total)


@compiled
def limit_parameters(settings: DriveSettings, h: Any, change: Float[Array, " parameters"]) -> None:
    """Add the change to the parameters, within the bounds; the change is corrected accordingly.

    A parameter at its bound changes the others by its covariances with them: the projection in the
    metric of the covariance.
    """
    cov, p = h.covariance, h.parameters
    least, most, lag = settings.min_gain, settings.max_gain, settings.max_lag
    low = FilterParameters(least, least, least, 0.0, -lag)
    high = FilterParameters(most, most, most, lag, lag)
    for i in range(PARAMETERS):
        new = p[i] + change[i]
        excess = min(max(new, low[i]), high[i]) - new
        if excess != 0.0 and cov[i, i] > 0.0:
            for j in range(PARAMETERS):
                change[j] += cov[j, i] / cov[i, i] * excess
    for i in range(PARAMETERS):
        new = min(max(p[i] + change[i], low[i]), high[i])
        change[i] = new - p[i]
        p[i] = new


@compiled
def forgetting_pace(ratio: float) -> float:
    """Return how many times faster information is forgotten than where all is explained.

    ``ratio`` is a mean square of innovations over the one that is explained.
    """
    return float(min(max(ratio, 1.0), _MAX_FORGETTING_PACE))


@compiled
def forget(settings: DriveSettings, h: Any, old: Float[Array, "5 5"], dt: float) -> None:
    """Forget information: its matrix P^-1 decays towards the inverse of the initial covariance.

    ``old`` is a workspace.
    """
    cov, share = h.covariance, min(dt / settings.memory * forgetting_pace(h.mean_square), 0.5)
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            old[i, j] = cov[i, j]
    for i in range(PARAMETERS):
        for j in range(PARAMETERS):
            kept = 0.0
            for k in range(PARAMETERS):
                kept += old[i, k] * old[k, j] / INITIAL_ERRORS[k] ** 2
            cov[i, j] += share * (old[i, j] - kept)
