"""PID laws with gains tuned by a fuzzy system, as pure functions.

The presets `paper` and `published-code` steer to a waypoint. Their error is a complex number, so
that one law applies to a vector of the plane, ``e_x + i e_y``, and to a single coordinate, whose
imaginary part is zero. The input of the fuzzy system is the magnitude of the error: the length
of a vector, the signed value of a coordinate.

The preset `recommended` corrects a feedforward, one signed coordinate of B at a time.

Kernels call the same functions (:func:`~omnidrive.compiled.compilable`).
"""

from __future__ import annotations

from math import expm1
from typing import Annotated, NamedTuple, TypeVar

from omnidrive.compiled import compilable
from omnidrive.parameter import Bounds

GainChange = tuple[float, float, float]
"""Changes of kp, ki and kd from a fuzzy system, each within +-:data:`MAX_GAIN_CHANGE`."""

MAX_GAIN_CHANGE = 0.1
"""Greatest output of the fuzzy system."""


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

    The fuzzy outputs, within +-0.1, are multiplied by ``parameters.tuning``.
    """
    dkp, dki, dkd = change
    return Gains(
        max(0.0, parameters.kp + parameters.tuning * dkp),
        max(0.0, parameters.ki + parameters.tuning * dki),
        max(0.0, parameters.kd + parameters.tuning * dkd),
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
    the integral, so that its tuning causes no step in the command.

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

    Chosen on the paper's scenario (`mujoco-rollers`, with and without noise, with one sample of
    delay) where the results are insensitive to them, not where one result is best. Each gain is
    tuned within its deviation, such as ``kp +- kp_deviation``.
    """

    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Decay rate of errors, as in the feedforward controller. At 6 1/s and one sample of delay, the
    overshoot of the step response is half as large again; at 4 1/s tracking is a tenth worse."""
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 1.0
    """Removes constant errors within seconds; 2 1/s^2 gives no improvement."""
    kd: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.05
    """Damps a robot with delay; with 0.2, noise costs a quarter more control effort."""
    kp_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 1.0
    """Greatest deviation of the tuned kp: 4 to 6 1/s."""
    ki_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 1.0
    """Greatest deviation of the tuned ki: 0 to 2 1/s^2."""
    kd_deviation: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.05
    """Greatest deviation of the tuned kd: 0 to 0.1."""
    error_range: Annotated[float, Bounds(1e-3, 100.0, "m or rad")] = 0.05
    """Error at which the first input of the fuzzy system reaches the end of its range, 1.

    The integral is held beyond it. Wide enough for the errors of a good run; with 0.1 the start
    from rest winds up the integral, and ME increases by half a millimetre."""
    rate_range: Annotated[float, Bounds(1e-3, 100.0, "m/s or rad/s")] = 1.0
    """Rate of the error at which the second input reaches 1."""
    filter_time: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.1
    """Time constant of the low-pass filter of that rate."""
    limit: Annotated[float, Bounds(0.01, 20.0, "m/s or rad/s")] = 1.5
    """Greatest correction, added to the feedforward; it prevents oscillation of the step response.

    The speed limit of the paper's predictive controller."""
    tracking_time: Annotated[float, Bounds(0.01, 10.0, "s")] = 0.5
    """Time constant of the integral's back-calculation under saturation."""


class TrackingState(NamedTuple):
    """Memory of :func:`tracking_law` between samples."""

    integral: float
    """Integral part of the correction, in m/s or rad/s."""
    rate: float
    """Filtered rate of the error, in m/s or rad/s."""


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
        max(0.0, parameters.kp + parameters.kp_deviation / MAX_GAIN_CHANGE * dkp),
        max(0.0, parameters.ki + parameters.ki_deviation / MAX_GAIN_CHANGE * dki),
        max(0.0, parameters.kd + parameters.kd_deviation / MAX_GAIN_CHANGE * dkd),
    )


@compilable
def tracking_integral(
    parameters: TrackingParameters, ki: float, integral: float, error: float, dt: float
) -> float:
    """Return the integral part: it increases by ``ki e dt`` while the error is within its range.

    The integral is meant for small, constant errors. Large errors come from the start, a jump of
    the reference or an outlier; integrating them would cause overshoot (conditional integration,
    Astrom & Hagglund 2006).
    """
    return integral + ki * dt * error if abs(error) <= parameters.error_range else integral


@compilable
def tracking_law(gains: Gains, integral: float, error: float, rate: float, dt: float) -> float:
    """Return the correction ``(1 - exp(-kp dt)) / dt e + integral + kd de/dt`` of a feedforward.

    The proportional part, held for ``dt``, leaves the error ``exp(-kp dt) e`` as the continuous law
    does, and so applies to every sample time.

    Args:
        gains: Gains at this sample.
        integral: Integral part at this sample, in m/s or rad/s.
        error: Reference minus pose, in m or rad.
        rate: Filtered rate of the error, in m/s or rad/s.
        dt: Sample time in s.
    """
    return -expm1(-gains.kp * dt) / dt * error + integral + gains.kd * rate


@compilable
def back_calculate_bounded(
    parameters: TrackingParameters, integral: float, saturation_error: float, dt: float
) -> float:
    """As :func:`back_calculate`, but towards zero and never past it.

    A correction saturates mostly because of its proportional part, which must not reverse the sign
    of the integral.
    """
    full = back_calculate(parameters.tracking_time, integral, saturation_error, dt)
    return min(max(full, min(integral, 0.0)), max(integral, 0.0))
