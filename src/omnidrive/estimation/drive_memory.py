"""What the identification of the drive knows: settings, estimates and their memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil, exp, hypot, prod, sqrt
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled
from omnidrive.compiled.unsafe_views import unsafe_array
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds, check_bounds
from omnidrive.robot import Robot
from omnidrive.robot.slip import Vector

LAG, YAW_LAG = 3, 4
"""Indices of the lag in x and y, and of what the lag in yaw exceeds it by; before them are the
gains of x, y and yaw."""
PARAMETERS = 5
"""Number of parameters that every hypothesis estimates."""
HYPOTHESES = 3
"""Number of delays that are compared: whole sample times in addition to the known delay."""

_DELAY, _APPLIED_YAW_LAG = 4, 6
"""Indices of the delay and of the lag in yaw in the parameters that a controller uses."""
_GAIN_ERROR, _LAG_ERROR, _YAW_LAG_ERROR = 0.07, 0.07, 0.015
"""Standard deviations of the parameters before the first sample; 1, s, s."""
_DISTURBANCE = 0.02
"""Standard deviation of the initial disturbance, m/s."""
_SIGNIFICANCE = 2.0
"""Number of standard errors up to which an estimate is not used."""
_EXCITED = 0.5
"""Share of the initial standard error below which a parameter is excited."""


class DriveSettings(NamedTuple):
    """Bounds of the identified parameters, and forgetting."""

    min_gain: Annotated[float, Bounds(0.1, 1.0)] = 0.7
    """Least gain of an axis."""
    max_gain: Annotated[float, Bounds(1.0, 2.0)] = 1.3
    """Largest gain of an axis."""
    max_lag: Annotated[float, Bounds(0.0, 1.0, "s")] = 0.3
    """Largest lag in addition to that of the model."""
    max_delay: Annotated[float, Bounds(0.0, 1.0, "s")] = 0.2
    """Largest delay of the commands, that of the model included."""
    memory: Annotated[float, Bounds(1.0, 1e6, "s")] = 30.0
    """Time constant with which old information is forgotten."""


class DriveEstimate(NamedTuple):
    """Identified parameters of the drive, with their standard errors."""

    gains: Vector = (1.0, 1.0, 1.0)
    """Ratio of the steady twist to the commanded one along x, y and yaw."""
    lag: float = 0.0
    """Lag of the motors in addition to that of the model, s."""
    delay: float = 0.0
    """Delay of the commands, that of the model included, s."""
    yaw_lag: float = 0.0
    """As ``lag``, in yaw; ``lag`` is that in x and y."""
    gain_errors: Vector = (_GAIN_ERROR, _GAIN_ERROR, _GAIN_ERROR)
    lag_error: float = _LAG_ERROR
    delay_error: float = 0.0
    """From the probabilities of the compared delays and the distance between them."""
    yaw_lag_error: float = hypot(_LAG_ERROR, _YAW_LAG_ERROR)
    sum_error: float = _LAG_ERROR
    """Of the sum of lag and delay: smooth motions do not distinguish the two."""

    @property
    def excited(self) -> tuple[bool, bool, bool, bool]:
        """Whether the motion sufficed to estimate the gains, and the sum of lag and delay."""
        x, y, yaw = (error < _EXCITED * _GAIN_ERROR for error in self.gain_errors)
        return x, y, yaw, self.sum_error < _EXCITED * _LAG_ERROR


class DriveMemory(NamedTuple):
    """What the identification knows; all arrays are changed in place, and zero at the start.

    They are consecutive parts of one vector, see :func:`memory_in`.

    The first index of most arrays is that of the hypothesis: one for every delay, in ascending
    order.
    """

    estimate: Float[Array, " 13"]
    """The fields of :class:`DriveEstimate`, one after another."""
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
    )


def command_count(delay: float, period: float) -> int:
    """Return the number of commands to remember, for a known delay and a sample time, s."""
    return ceil(delay / period) + HYPOTHESES + 1


_SHAPES = (
    (13,),
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

    As one vector, it passes through the kernels of a controller as one array instead of fourteen.
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
        unsafe_array(values, _BEGINS[13], ((len(values) - _BEGINS[13]) // 4, 4)),
    )


def check_start(settings: DriveSettings, initial: DriveEstimate) -> None:
    """Check settings, and that they allow the initial parameters.

    Raises:
        InvalidInput: A setting is outside its domain, or an initial value outside the bounds.
    """
    check_bounds(settings)
    for name, value, low, high in (
        *(("gain", gain, settings.min_gain, settings.max_gain) for gain in initial.gains),
        ("lag", initial.lag, 0.0, settings.max_lag),
        ("delay", initial.delay, 0.0, settings.max_delay),
    ):
        if not low <= value <= high:
            raise InvalidInput(
                f"the {name} before adaptation is {value:g}, outside its bounds {low:g} to {high:g}"
            )


@compiled
def initial_error(parameter: int) -> float:
    """Return the standard deviation of a parameter before the first sample."""
    if parameter == YAW_LAG:
        return _YAW_LAG_ERROR
    return _GAIN_ERROR if parameter < LAG else _LAG_ERROR


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


def drive_estimate(values: Float[Array, " values"]) -> DriveEstimate:
    """Return the estimates for the chosen delay, and their standard errors.

    Args:
        values: Those of :attr:`DriveMemory.estimate`, with which the memory begins.
    """
    x, y, yaw, lag, delay, yaw_lag, *errors = values[: _BEGINS[1]].tolist()
    by_x, by_y, by_yaw, by_lag, by_delay, by_yaw_lag, by_sum = errors
    return DriveEstimate(
        (x, y, yaw), lag, delay, yaw_lag, (by_x, by_y, by_yaw), by_lag, by_delay, by_yaw_lag, by_sum
    )


def logged_drive(details: Mapping[str, Float[Array, " rows"]]) -> DriveEstimate | None:
    """Return the last estimates in the details of a run; None: it has none.

    The columns are those of :data:`DRIVE_UNITS`.
    """
    if not details.keys() >= DRIVE_UNITS.keys():
        return None
    table = np.column_stack([details[name] for name in DRIVE_UNITS])
    finite = np.flatnonzero(np.isfinite(table).all(axis=1))
    return drive_estimate(table[finite[-1]]) if len(finite) else None


def known_drive(robot: Robot, delay: float = 0.0) -> DriveEstimate:
    """Return the parameters of a robot file, and a delay, s, to start from."""
    return DriveEstimate(robot.drive_gain, robot.motor_lag, delay, robot.motor_lag)


def identified_robot(robot: Robot, estimate: DriveEstimate) -> Robot:
    """Return a robot with the identified gains and motor lag, for its file.

    What the motion did not determine (:attr:`DriveEstimate.excited`) is unchanged. The delay is no
    parameter of a robot.
    """
    *moving, answering = estimate.excited
    pairs = zip(moving, estimate.gains, robot.drive_gain, strict=True)
    x, y, yaw = (found if excited else known for excited, found, known in pairs)
    lag = estimate.lag if answering else robot.motor_lag
    return replace(robot, drive_gain=(x, y, yaw), motor_lag=lag)


DRIVE_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "drive_gain_x": "1",
        "drive_gain_y": "1",
        "drive_gain_yaw": "1",
        "drive_lag": "s",
        "drive_delay": "s",
        "drive_yaw_lag": "s",
        "drive_gain_x_error": "1",
        "drive_gain_y_error": "1",
        "drive_gain_yaw_error": "1",
        "drive_lag_error": "s",
        "drive_delay_error": "s",
        "drive_yaw_lag_error": "s",
        "drive_lag_and_delay_error": "s",
    }
)
"""Columns of the log of a run and their units: :attr:`DriveMemory.estimate`. ``..._error`` are
standard errors; the last one is that of the sum of lag and delay."""
