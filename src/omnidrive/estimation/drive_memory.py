"""What the identification of the drive knows: settings, estimates and their memory."""

from __future__ import annotations

from math import ceil, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled, inlined
from omnidrive.errors import InvalidInput
from omnidrive.parameter import Bounds, check_bounds, check_sample_time
from omnidrive.robot.slip import Vector

LAG, DELAY = 3, 4
"""Indices of the parameters after the three gains."""
PARAMETERS = 5
"""Number of parameters."""

_GAIN_ERROR, _LAG_ERROR, _DELAY_ERROR = 0.07, 0.05, 0.05
"""Standard deviations of the parameters before the first sample; 1, s, s."""
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
    delay_error: float = _DELAY_ERROR
    sum_error: float = sqrt(_LAG_ERROR**2 + _DELAY_ERROR**2)
    """Of the sum of lag and delay: smooth motions do not distinguish the two."""

    @property
    def excited(self) -> tuple[bool, bool, bool, bool, bool]:
        """Whether the motion sufficed to estimate each parameter, in the order of the fields."""
        x, y, yaw = (error < _EXCITED * _GAIN_ERROR for error in self.gain_errors)
        lag, delay = (
            self.lag_error < _EXCITED * _LAG_ERROR,
            self.delay_error < _EXCITED * _LAG_ERROR,
        )
        return x, y, yaw, lag, delay


class DriveMemory(NamedTuple):
    """What the identification knows; all arrays are changed in place.

    The index of a parameter is 0 to 2 for the gains of x, y and yaw, :data:`LAG` or :data:`DELAY`.
    """

    initial: Float[Array, " 5"]
    """Parameters before the first sample."""
    parameters: Float[Array, " 5"]
    """Estimates; 1, 1, 1, s, s."""
    covariance: Float[Array, "5 5"]
    """Their covariance."""
    commands: Float[Array, "commands 4"]
    """Earlier commands, the latest one first: body twist, and the time for which it was held."""
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
    figures: Float[Array, " 4"]
    """Innovation of every axis over its standard deviation; share of slipping wheels."""


def drive_memory(
    settings: DriveSettings, period: float, initial: DriveEstimate | None = None
) -> DriveMemory:
    """Return the memory of the identification at the start.

    Args:
        settings: Bounds and forgetting.
        period: Least time between two samples, s.
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
    rows = ceil((settings.max_delay + _DELAY_ERROR) / period) + 2
    memory = DriveMemory(
        np.array([*initial.gains, initial.lag, initial.delay], dtype=float),
        np.zeros(PARAMETERS),
        np.zeros((PARAMETERS, PARAMETERS)),
        np.zeros((rows, 4)),
        np.zeros(3),
        np.zeros((3, 3)),
        np.zeros((3, 3, 3)),
        np.zeros((4, 3, PARAMETERS)),
        np.zeros((8, PARAMETERS)),
        np.zeros(4),
    )
    initialize(memory)
    return memory


@inlined
def initial_error(parameter: int) -> float:
    """Return the standard deviation of a parameter before the first sample."""
    if parameter < LAG:
        return _GAIN_ERROR
    return _LAG_ERROR if parameter == LAG else _DELAY_ERROR


@compiled
def initialize(memory: DriveMemory) -> None:
    """Forget everything but the initial parameters, for a new run."""
    memory.covariance[:] = 0.0
    for i in range(PARAMETERS):
        memory.parameters[i] = memory.initial[i]
        memory.covariance[i, i] = initial_error(i) ** 2
    restart(memory, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@inlined
def restart(memory: DriveMemory, pose: Vector, twist: Vector) -> None:
    """Start at a known pose (W) with a known steady twist (B); the parameters remain."""
    memory.commands[:] = 0.0
    memory.states[:] = 0.0
    memory.state_covariance[:] = 0.0
    memory.sensitivity[:] = 0.0
    memory.figures[:] = 0.0
    for a in range(3):
        memory.pose[a] = pose[a]
        memory.states[0, a] = memory.states[1, a] = twist[a]
        memory.state_covariance[a, 2, 2] = _DISTURBANCE**2
        for k in range(len(memory.commands)):
            memory.commands[k, a] = twist[a] / memory.parameters[a]


@inlined
def applied_parameters(memory: DriveMemory) -> tuple[Vector, float, float]:
    """Return the gains, the lag (s) and the delay (s) that a controller should use.

    They differ from the initial ones only as far as the difference is significant: it is
    multiplied by ``max(0, 1 - (c error / difference)^2)`` with its standard error, as in the
    positive-part estimator of James & Stein ("Estimation with quadratic loss", Proc. 4th Berkeley
    Symposium, 1961). Lag and delay have one factor, that of their sum.
    """
    p, initial, cov = memory.parameters, memory.initial, memory.covariance
    variance = cov[LAG, LAG] + cov[DELAY, DELAY] + 2.0 * cov[LAG, DELAY]
    lag, delay = p[LAG] - initial[LAG], p[DELAY] - initial[DELAY]
    share = _significant_share(lag + delay, variance)
    return (
        (_significant(memory, 0), _significant(memory, 1), _significant(memory, 2)),
        initial[LAG] + share * lag,
        initial[DELAY] + share * delay,
    )


@inlined
def _significant(memory: DriveMemory, parameter: int) -> float:
    initial = memory.initial[parameter]
    difference = memory.parameters[parameter] - initial
    share = _significant_share(difference, memory.covariance[parameter, parameter])
    return float(initial + share * difference)


@inlined
def _significant_share(difference: float, variance: float) -> float:
    bound = _SIGNIFICANCE * _SIGNIFICANCE * variance
    square = difference * difference
    return 1.0 - bound / square if square > bound else 0.0


def drive_estimate(memory: DriveMemory) -> DriveEstimate:
    """Return the estimates and their standard errors."""
    x, y, yaw, lag, delay = memory.parameters.tolist()
    cov = memory.covariance
    errors = np.sqrt(np.diag(cov)).tolist()
    total = sqrt(max(float(cov[LAG:, LAG:].sum()), 0.0))
    return DriveEstimate((x, y, yaw), lag, delay, tuple(errors[:3]), errors[3], errors[4], total)
