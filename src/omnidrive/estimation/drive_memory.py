"""What the identification of the drive knows: settings, estimates and their memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import ceil
from types import MappingProxyType
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot import Robot
from omnidrive.robot.slip import Vector

LAG = 3
"""Index of the lag; before it are the gains of x, y and yaw."""
PARAMETERS = 4
"""Number of parameters that every hypothesis estimates."""
HYPOTHESES = 3
"""Number of delays that are compared: whole sample times in addition to the known delay."""

_GAIN_ERROR, _LAG_ERROR = 0.07, 0.07
"""Standard deviations of the parameters before the first sample; 1, s."""
_DISTURBANCE = 0.02
"""Standard deviation of the initial disturbance, m/s."""
_SIGNIFICANCE = 1.5
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
    gain_errors: Vector = (_GAIN_ERROR, _GAIN_ERROR, _GAIN_ERROR)
    lag_error: float = _LAG_ERROR
    delay_error: float = 0.0
    """From the probabilities of the compared delays and the distance between them."""
    sum_error: float = _LAG_ERROR
    """Of the sum of lag and delay: smooth motions do not distinguish the two."""

    @property
    def excited(self) -> tuple[bool, bool, bool, bool]:
        """Whether the motion sufficed to estimate the gains, and the sum of lag and delay."""
        x, y, yaw = (error < _EXCITED * _GAIN_ERROR for error in self.gain_errors)
        return x, y, yaw, self.sum_error < _EXCITED * _LAG_ERROR


class Hypothesis(NamedTuple):
    """What is estimated for one delay; all arrays are changed in place."""

    delay: float
    """Delay of the commands, s."""
    parameters: Float[Array, " 4"]
    """Estimates: gains of x, y and yaw, and the lag in s."""
    covariance: Float[Array, "4 4"]
    """Their covariance."""
    pose: Float[Array, " 3"]
    """Estimated pose in W; m, m, rad."""
    states: Float[Array, "3 axes"]
    """Twist of the motors, body twist and disturbance, in B; m/s, m/s, rad/s."""
    state_covariance: Float[Array, "axes 3 3"]
    """Of displacement, twist and disturbance of every axis for known parameters, in SI units."""
    sensitivity: Float[Array, "4 axes parameters"]
    """Derivatives of displacement (in B), twist of the motors, body twist and disturbance."""
    work: Float[Array, "8 parameters"]
    """Workspace of a correction."""
    innovations: Float[Array, "axes 3"]
    """Of the last measurement, in B: innovation, and its variances for known parameters and by
    their errors."""
    figures: Float[Array, " 5"]
    """Innovation of every axis over its standard deviation; share of slipping wheels; logarithm of
    the likelihood, with forgetting."""


class DriveMemory(NamedTuple):
    """What the identification knows; all arrays are changed in place."""

    hypotheses: tuple[Hypothesis, Hypothesis, Hypothesis]
    """One for every delay, in ascending order."""
    commands: Float[Array, "commands 4"]
    """Earlier commands, the latest one first: body twist, and the time for which it was held."""
    initial: Float[Array, " 4"]
    """Parameters before the first sample."""
    chosen: Int[Array, " 1"]
    """Index of the hypothesis in use."""


def drive_memory(
    settings: DriveSettings, period: float, initial: DriveEstimate | None = None
) -> DriveMemory:
    """Return the memory of the identification at the start.

    Args:
        settings: Bounds and forgetting.
        period: Sample time, s.
        initial: Parameters to start from; its standard errors are not used. None: gains 1, no lag
            and no delay.

    Raises:
        InvalidInput: A setting is outside its domain, or an initial value outside the bounds.
    """
    check_sample_time(period)
    check_bounds(settings)
    initial = initial or DriveEstimate()
    for name, value, low, high in (
        *(("gain", gain, settings.min_gain, settings.max_gain) for gain in initial.gains),
        ("lag", initial.lag, 0.0, settings.max_lag),
        ("delay", initial.delay, 0.0, settings.max_delay),
    ):
        if not low <= value <= high:
            raise InvalidInput(f"the {name} is {value:g}, outside the bounds {low:g} to {high:g}")
    first, second, third = (initial.delay + k * period for k in range(HYPOTHESES))
    memory = DriveMemory(
        (_hypothesis(first), _hypothesis(second), _hypothesis(third)),
        np.zeros((ceil(third / period) + 2, 4)),
        np.array([*initial.gains, initial.lag], dtype=float),
        np.zeros(1, dtype=np.int64),
    )
    initialize(memory)
    return memory


def _hypothesis(delay: float) -> Hypothesis:
    return Hypothesis(
        float(delay),
        np.zeros(PARAMETERS),
        np.zeros((PARAMETERS, PARAMETERS)),
        np.zeros(3),
        np.zeros((3, 3)),
        np.zeros((3, 3, 3)),
        np.zeros((4, 3, PARAMETERS)),
        np.zeros((8, PARAMETERS)),
        np.zeros((3, 3)),
        np.zeros(5),
    )


@inlined
def initial_error(parameter: int) -> float:
    """Return the standard deviation of a parameter before the first sample."""
    return _GAIN_ERROR if parameter < LAG else _LAG_ERROR


@compiled
def initialize(memory: DriveMemory) -> None:
    """Forget everything but the initial parameters, for a new run."""
    memory.chosen[0] = 0
    for h in memory.hypotheses:
        h.covariance[:] = 0.0
        h.figures[:] = 0.0
        for i in range(PARAMETERS):
            h.parameters[i] = memory.initial[i]
            h.covariance[i, i] = initial_error(i) ** 2
    restart(memory, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@inlined
def restart(memory: DriveMemory, pose: Vector, twist: Vector) -> None:
    """Start at a known pose (W) with a known steady twist (B); the parameters remain."""
    for k in range(len(memory.commands)):
        for a in range(3):
            memory.commands[k, a] = twist[a] / memory.initial[a]
        memory.commands[k, 3] = 0.0
    for h in memory.hypotheses:
        restart_hypothesis(h, pose, twist)


@inlined
def restart_hypothesis(h: Hypothesis, pose: Vector, twist: Vector) -> None:
    """Start as :func:`restart` does."""
    h.states[:] = 0.0
    h.state_covariance[:] = 0.0
    h.sensitivity[:] = 0.0
    for a in range(3):
        h.pose[a] = pose[a]
        h.states[0, a] = h.states[1, a] = twist[a]
        h.state_covariance[a, 2, 2] = _DISTURBANCE**2


@inlined
def applied_parameters(memory: DriveMemory) -> tuple[Vector, float, float]:
    """Return the gains, the lag (s) and the delay (s) that a controller should use.

    The delay is that of the chosen hypothesis. Gains and lag differ from the initial ones only as
    far as the difference is significant: it is multiplied by ``max(0, 1 - (c error /
    difference)^2)`` with its standard error, as in the positive-part estimator of James & Stein
    ("Estimation with quadratic loss", Proc. 4th Berkeley Symposium, 1961).
    """
    h, initial = memory.hypotheses[memory.chosen[0]], memory.initial
    return (
        (_significant(h, initial, 0), _significant(h, initial, 1), _significant(h, initial, 2)),
        _significant(h, initial, LAG),
        h.delay,
    )


@inlined
def _significant(h: Hypothesis, initial: Float[Array, " 4"], parameter: int) -> float:
    difference = h.parameters[parameter] - initial[parameter]
    bound = _SIGNIFICANCE * _SIGNIFICANCE * h.covariance[parameter, parameter]
    square = difference * difference
    share = 1.0 - bound / square if square > bound else 0.0
    return float(initial[parameter] + share * difference)


def drive_estimate(memory: DriveMemory) -> DriveEstimate:
    """Return the estimates for the chosen delay, and their standard errors."""
    h = memory.hypotheses[int(memory.chosen[0])]
    x, y, yaw, lag = h.parameters.tolist()
    *gain_errors, lag_error = np.sqrt(np.diag(h.covariance)).tolist()
    delays = np.array([each.delay for each in memory.hypotheses])
    lags = np.array([each.parameters[LAG] for each in memory.hypotheses])
    variances = np.array([each.covariance[LAG, LAG] for each in memory.hypotheses])
    scores = np.array([each.figures[4] for each in memory.hypotheses])
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    distance = (delays[1] - delays[0]) ** 2 / 12.0  # variance of a uniform distribution
    delay_error = np.sqrt(weights @ (delays - h.delay) ** 2 + distance)
    sum_error = np.sqrt(weights @ (variances + (lags + delays - lag - h.delay) ** 2))
    x_error, y_error, yaw_error = gain_errors
    return DriveEstimate(
        (x, y, yaw),
        lag,
        h.delay,
        (x_error, y_error, yaw_error),
        lag_error,
        float(delay_error),
        float(sum_error),
    )


def known_drive(robot: Robot, delay: float = 0.0) -> DriveEstimate:
    """Return the parameters of a robot file, and a delay, s, to start from."""
    return DriveEstimate(robot.drive_gain, robot.motor_lag, delay)


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
        "drive_gain_x_error": "1",
        "drive_gain_y_error": "1",
        "drive_gain_yaw_error": "1",
        "drive_lag_error": "s",
        "drive_delay_error": "s",
    }
)
"""Names and units of :func:`drive_details`: estimates, and ``..._error``, their standard errors."""


def drive_details(estimate: DriveEstimate) -> tuple[float, ...]:
    """Return the columns of an estimate for the log of a run; names in :data:`DRIVE_UNITS`."""
    return (
        *estimate.gains,
        estimate.lag,
        estimate.delay,
        *estimate.gain_errors,
        estimate.lag_error,
        estimate.delay_error,
    )
