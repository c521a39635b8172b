"""PID laws with gains tuned by a fuzzy system, as pure functions.

The presets `paper` and `published-code` steer to a waypoint. Their error is a complex number, so
that one law applies to a vector of the plane, ``e_x + i e_y``, and to a single coordinate, whose
imaginary part is zero. The input of the fuzzy system is the magnitude of the error: the length
of a vector, the signed value of a coordinate.

The preset `recommended` corrects a feedforward, one signed coordinate of B at a time.

Kernels call the same functions (:func:`~omnidrive.compiled.compilable`).
"""

from __future__ import annotations

from math import expm1, inf, sqrt
from typing import Annotated, NamedTuple, TypeVar

from omnidrive.compiled import compilable
from omnidrive.parameter import Bounds

GainChange = tuple[float, float, float]
"""Changes of kp, ki and kd from a fuzzy system, each within +-:data:`MAX_GAIN_CHANGE`."""

MAX_GAIN_CHANGE = 0.1
"""Greatest output of the fuzzy system."""

FASTEST = 100.0
"""Speed in m/s and rad/s that no robot reaches: a pose that causes a greater one is an outlier."""


Quantity = TypeVar("Quantity", float, complex)


class Gains(NamedTuple):
    """Gains of one PID law."""

    kp: float
    """Proportional gain in 1/s."""
    ki: float
    """Integral gain in 1/s^2."""
    kd: float
    """Derivative gain, dimensionless."""


class MemorylessParameters(NamedTuple):
    """Parameters of :func:`memoryless_law`; published values."""

    error_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 0.5
    """Scale from the error's magnitude to the first input of the fuzzy system."""
    change_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 1.0
    """Scale from the change of the magnitude per sample to the second input."""
    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 4.0
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 3.0
    kd: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 0.0
    tuning: Annotated[float, Bounds(0.0, 100.0, "1/s")] = 10.0
    """Scale from an output of the fuzzy system to the change of a gain."""


class SelfTuningParameters(NamedTuple):
    """Parameters of :func:`self_tuning_law`; published values where the law is published."""

    error_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 0.5
    """Scale from the error's magnitude to the first input of the fuzzy system."""
    change_gain: Annotated[float, Bounds(0.0, 10.0, "s/m or s/rad")] = 0.1
    """Scale from the rate of the magnitude to the second input.

    0.1 s/m equals the published 1/m per sample of 0.1 s."""
    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 4.0
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 3.0
    kd: Annotated[float, Bounds(0.0, 1.0, "")] = 0.0
    tuning: Annotated[float, Bounds(0.0, 100.0, "1/s, 1/s^2, 1")] = 10.0
    """Scale from an output of the fuzzy system to the deviation of a gain."""
    limit: Annotated[float, Bounds(0.01, 20.0, "m/s or rad/s")] = 1.5
    """Greatest magnitude of the command: the speed limit of the paper's predictive controller."""
    tracking_time: Annotated[float, Bounds(0.01, 10.0, "s")] = 0.5
    """Time constant of the integral's back-calculation under saturation."""


class SelfTuningState(NamedTuple):
    """Memory of :func:`self_tuning_law` between samples."""

    integral: complex
    """Integral part of the command, in m/s or rad/s."""
    error: complex
    """Previous error, in m or rad."""
    magnitude: float
    """Previous magnitude of the error, in m or rad."""


@compilable
def tune_gains(
    parameters: MemorylessParameters | SelfTuningParameters, change: GainChange
) -> Gains:
    """Return non-negative gains K = K0 + dK (Zhao, Tomizuka & Isaka 1993).

    The fuzzy outputs, within +-0.1, are multiplied by ``parameters.tuning``; nan gives nan.
    """
    dkp, dki, dkd = change
    return Gains(
        max(parameters.kp + parameters.tuning * dkp, 0.0),
        max(parameters.ki + parameters.tuning * dki, 0.0),
        max(parameters.kd + parameters.tuning * dkd, 0.0),
    )


@compilable
def memoryless_law(gains: Gains, error: complex) -> complex:
    """Return the command of the incremental PID at its first sample: (kp + ki + kd) error.

    The published code never stored the updated controller, so that every sample was its first.
    """
    return (gains.kp + gains.ki + gains.kd) * error


@compilable
def self_tuning_law(
    parameters: SelfTuningParameters,
    gains: Gains,
    state: SelfTuningState,
    error: complex,
    dt: float,
) -> tuple[complex, complex]:
    """PID in positional form with back-calculation (Astrom & Hagglund 2006).

    ``u = kp e + integral(ki e dt) + kd de/dt``, saturated to ``parameters.limit`` in its
    direction; the difference to the desired command corrects the integral. The gain ki is inside
    the integral, so that its tuning causes no step in the command. It stays as it is while
    the desired command exceeds :data:`FASTEST`: an outlier leaves nothing in it.

    Args:
        parameters: Limit and tracking time.
        gains: Gains at this sample.
        state: Memory of the previous sample; at the first one, its error is this sample's error.
        error: Goal minus pose, in m or rad.
        dt: Sample time in s.

    Returns:
        The command in m/s or rad/s, and the integral part for the next sample.
    """
    integral = state.integral + gains.ki * dt * error
    desired = gains.kp * error + integral + gains.kd / dt * (error - state.error)
    command = saturate(desired, parameters.limit)
    if abs(desired) > FASTEST:
        return command, state.integral
    return command, back_calculate(parameters.tracking_time, integral, command - desired, dt)


@compilable
def saturate(desired: Quantity, limit: float) -> Quantity:
    """Return ``desired`` limited to the magnitude ``limit``, with its direction unchanged."""
    magnitude = abs(desired)
    return desired * (limit / magnitude) if magnitude > limit else desired


@compilable
def back_calculate(
    tracking_time: float, integral: Quantity, saturation_error: Quantity, dt: float
) -> Quantity:
    """Return the integral part after saturation: back-calculation (Astrom & Hagglund 2006).

    Args:
        tracking_time: Time constant of the integral's correction, in s.
        integral: Integral part before saturation, in the unit of the command.
        saturation_error: Saturated minus desired command.
        dt: Sample time in s.
    """
    return integral + min(1.0, dt / tracking_time) * saturation_error


class TrackingParameters(NamedTuple):
    """Parameters of the preset `recommended` for each axis: x and y (m, m/s), heading (rad, rad/s).

    Each gain is tuned within its deviation, such as ``kp +- kp_deviation``. The last three are by
    default those of a robot that executes every command exactly; ``robot_parameters`` in
    :mod:`omnidrive.control.pid.presets` derives them from a robot.
    """

    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of errors."""
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 7.5
    """Integral gain; a disturbance is compensated with the time constant ``kp / ki``."""
    kd: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.03
    """Derivative gain; damps a robot with delay, and costs effort with noise."""
    kp_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 0.5
    """Greatest deviation of the tuned kp."""
    ki_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 0.5
    """Greatest deviation of the tuned ki."""
    kd_deviation: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.03
    """Greatest deviation of the tuned kd."""
    error_range: Annotated[float, Bounds(1e-3, 100.0, "m or rad")] = 0.05
    """Error at which the first input of the fuzzy system reaches the end of its range, 1. Beyond it
    the integral part decays: a step, an outlier, a robot without grip."""
    rate_range: Annotated[float, Bounds(1e-3, 100.0, "m/s or rad/s")] = 1.0
    """Rate of the error at which the second input reaches 1."""
    filter_time: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.1
    """Time constant of the low-pass filter of that rate."""
    braking_share: Annotated[float, Bounds(0.01, 1.0)] = 0.55
    """Share of the acceleration with which the robot approaches a distant target."""
    limit: Annotated[float, Bounds(1e-6, inf, "m/s or rad/s")] = inf
    """Greatest correction, added to the feedforward."""
    acceleration: Annotated[float, Bounds(1e-6, inf, "m/s^2 or rad/s^2")] = inf
    """Acceleration that the robot reaches in every direction."""
    lag: Annotated[float, Bounds(0.0, inf, "s")] = 0.0
    """Time constant of the robot's response to commands, by which the feedforward leads."""


class TrackingState(NamedTuple):
    """Memory of :func:`tracking_law` between samples."""

    integral: float
    """Integral part of the correction, in m/s or rad/s."""
    missing: float
    """Low-pass filtered missing motion, in m/s or rad/s; see :func:`tracking_integral`."""
    rate: float
    """Filtered rate of the error, in m/s or rad/s."""
    distance: float
    """Magnitude of the error at the previous sample, in m or rad."""


@compilable
def low_pass(filter_time: float, last: float, value: float, dt: float) -> float:
    """Return the output of a first-order low-pass filter; stable for every ``dt``.

    Backward Euler (Astrom & Hagglund 2006).

    Args:
        filter_time: Time constant in s.
        last: Output at the previous sample.
        value: Input at this sample, in the unit of ``last``.
        dt: Sample time in s.
    """
    return last + dt / (filter_time + dt) * (value - last)


@compilable
def fuzzy_inputs(parameters: TrackingParameters, error: float, rate: float) -> tuple[float, float]:
    """Return error and rate divided by their ranges, clamped to [-1, 1]."""
    scaled_error, scaled_rate = error / parameters.error_range, rate / parameters.rate_range
    return min(max(scaled_error, -1.0), 1.0), min(max(scaled_rate, -1.0), 1.0)


@compilable
def mirror_to_negative(error: float, change: float) -> tuple[float, float]:
    """Return both inputs of the fuzzy system, mirrored so that the error is not positive.

    The paper's rule table is odd: an error of the other sign gives the opposite changes of the
    gains, so that left and right would be controlled differently. For negative errors, a large
    error raises kp and lowers ki.
    """
    return (-error, -change) if (error, change) > (0.0, 0.0) else (error, change)


@compilable
def tune_bounded_gains(parameters: TrackingParameters, change: GainChange) -> Gains:
    """Return non-negative gains within their deviations: K = K0 + dK (Zhao et al. 1993).

    A fuzzy output of +-:data:`MAX_GAIN_CHANGE` gives the full deviation.
    """
    dkp, dki, dkd = change
    return Gains(
        max(parameters.kp + parameters.kp_deviation / MAX_GAIN_CHANGE * dkp, 0.0),
        max(parameters.ki + parameters.ki_deviation / MAX_GAIN_CHANGE * dki, 0.0),
        max(parameters.kd + parameters.kd_deviation / MAX_GAIN_CHANGE * dkd, 0.0),
    )


@compilable
def tracking_integral(  # noqa: PLR0917
    parameters: TrackingParameters,
    gains: Gains,
    state: TrackingState,
    distance: float,
    missing: float,
    dt: float,
) -> tuple[float, float]:
    """Return the integral part and the filtered missing motion at this sample.

    PI control by automatic reset (Astrom & Hagglund 2006, section 3.5): the integral part is not a
    sum of errors, but the low-pass filtered difference between the motion that the commands should
    have caused and the measured one. With ``v = u + d`` and ``u = kp e + i``, the filter
    ``T di/dt = (u - v) - i`` of the time constant ``T = kp / ki`` integrates ``ki e``. Unlike a sum
    of errors, it is zero while a robot without disturbance approaches its target, so that a step
    causes no overshoot, and it follows the saturated command, so that it does not wind up. Two
    filters in series with half the time constant each pass less noise than one.

    While this distance or the previous one exceeds the range of the error, no motion counts as
    missing and the integral part decays: a large error comes from a jump of the reference or an
    outlier (conditional integration, ibid.), and a held integral would keep what noise left in it.

    Args:
        parameters: Range of the error.
        gains: Gains at this sample; kp = 0 means no integral part.
        state: Memory of the previous sample.
        distance: Magnitude of the error, in m or rad; that of the vector for x and y.
        missing: Predicted minus measured mean velocity since the previous sample, in m/s or rad/s.
        dt: Sample time in s.
    """
    if gains.kp <= 0.0:
        return 0.0, 0.0
    if max(distance, state.distance) > parameters.error_range:
        missing = 0.0
    share = -expm1(-2.0 * gains.ki / gains.kp * dt)
    filtered = state.missing + share * (missing - state.missing)
    return state.integral + share * (filtered - state.integral), filtered


@compilable
def braking(slope: float, distance: float, acceleration: float) -> float:
    """Return the factor of proportional control that lets a robot brake in time; at most 1.

    Proportional control ``slope * distance`` decelerates by ``slope^2 distance``. Where that
    exceeds the acceleration a, the speed is ``sqrt(2 a (distance - a / (2 slope^2)))``, which
    decelerates by a and continues the line without a step in its slope: the proximate time-optimal
    servomechanism (Workman, thesis, Stanford 1987; Franklin, Powell & Workman, "Digital Control of
    Dynamic Systems", 3rd ed. 1998).

    Args:
        slope: Speed per distance of proportional control, in 1/s; not negative.
        distance: Distance to the target, in m or rad; not negative.
        acceleration: a, in m/s^2 or rad/s^2; infinite for no limit.
    """
    if slope * slope * distance <= acceleration:
        return 1.0
    speed = sqrt(2.0 * acceleration * (distance - 0.5 * acceleration / (slope * slope)))
    return speed / (slope * distance)


@compilable
def tracking_law(  # noqa: PLR0917
    parameters: TrackingParameters,
    gains: Gains,
    integral: float,
    error: float,
    distance: float,
    rate: float,
    dt: float,
) -> float:
    """Return the correction ``(1 - exp(-kp dt)) / dt e + integral + kd de/dt`` of a feedforward.

    The proportional part, held for ``dt``, leaves the error ``exp(-kp dt) e`` as the continuous law
    does, and so applies to every sample time. It is reduced at large distances by :func:`braking`.

    Args:
        parameters: Acceleration and the share for braking.
        gains: Gains at this sample.
        integral: Integral part at this sample, in m/s or rad/s.
        error: Reference minus pose, in m or rad.
        distance: Magnitude of the error; that of the vector for x and y.
        rate: Filtered rate of the error, in m/s or rad/s.
        dt: Sample time in s.
    """
    slope = -expm1(-gains.kp * dt) / dt
    factor = braking(slope, distance, parameters.braking_share * parameters.acceleration)
    return factor * slope * error + integral + gains.kd * rate
