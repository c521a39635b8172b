"""PID laws whose gains a fuzzy system tunes: pure functions of numbers.

The presets `paper` and `published-code` steer to a waypoint. Their error is a complex number, so
that one law serves a vector of the plane, ``e_x + i e_y``, and a single coordinate, whose imaginary
part is zero. The fuzzy system sees its size: the distance of a vector, the signed value of a
coordinate.

The preset `recommended` corrects a feedforward, one signed coordinate of B at a time.
"""

from __future__ import annotations

from math import expm1
from typing import Annotated, NamedTuple, TypeVar

from omnidrive.parameter import Bounds

GainChange = tuple[float, float, float]
"""Changes of kp, ki and kd that a fuzzy system calls for, each in +-:data:`GREATEST_CHANGE`."""

GREATEST_CHANGE = 0.1
"""End of the range of the fuzzy outputs."""


Part = TypeVar("Part", float, complex)


class Gains(NamedTuple):
    """Gains of one PID law."""

    kp: float
    """Proportional, in 1/s."""
    ki: float
    """Integral, in 1/s^2."""
    kd: float
    """Derivative, without unit."""


class MemorylessParameters(NamedTuple):
    """Numbers of :func:`memoryless_law`; as published."""

    error_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 0.5
    """From the error's size to the first input of the fuzzy system."""
    change_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 1.0
    """From the change of size since the last sample to the second input."""
    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 4.0
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 3.0
    kd: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 0.0
    tuning: Annotated[float, Bounds(0.0, 100.0, "1/s")] = 10.0
    """From the output of the fuzzy system to the change of a gain."""


class SelfTuningParameters(NamedTuple):
    """Numbers of :func:`self_tuning_law`; as published where the law is."""

    error_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] = 0.5
    """From the error's size to the first input of the fuzzy system."""
    change_gain: Annotated[float, Bounds(0.0, 10.0, "s/m or s/rad")] = 0.1
    """From the rate of its size to the second input; per sample of 0.1 s it is 1, as published."""
    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 4.0
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 3.0
    kd: Annotated[float, Bounds(0.0, 1.0, "")] = 0.0
    tuning: Annotated[float, Bounds(0.0, 100.0, "1/s, 1/s^2, 1")] = 10.0
    """From the output of the fuzzy system to the distance of a gain from its middle."""
    limit: Annotated[float, Bounds(0.01, 20.0, "m/s or rad/s")] = 1.5
    """Greatest size of the command: the speed limit of the paper's predictive controller."""
    tracking_time: Annotated[float, Bounds(0.01, 10.0, "s")] = 0.5
    """Time in which the integral follows a command that was cut."""


class PidState(NamedTuple):
    """What :func:`self_tuning_law` remembers from one sample to the next."""

    integral: complex
    """Integral part of the command, in m/s or rad/s."""
    error: complex
    """Last error, in m or rad."""
    size: float
    """Last size of the error, as the fuzzy system sees it; in m or rad."""


def tuned(parameters: MemorylessParameters | SelfTuningParameters, change: GainChange) -> Gains:
    """Gains about their middle, none negative: K = K0 + dK (Zhao, Tomizuka & Isaka 1993).

    Their range is that of the fuzzy outputs, -0.1 to 0.1, times ``parameters.tuning``.
    """
    dkp, dki, dkd = change
    return Gains(
        max(0.0, parameters.kp + parameters.tuning * dkp),
        max(0.0, parameters.ki + parameters.tuning * dki),
        max(0.0, parameters.kd + parameters.tuning * dkd),
    )


def memoryless_law(gains: Gains, error: complex) -> complex:
    """Command of the incremental PID at its first sample, with no past: (kp + ki + kd) error.

    The published code never stored the controller it had updated, so every sample was its first.
    """
    return (gains.kp + gains.ki + gains.kd) * error


def self_tuning_law(
    parameters: SelfTuningParameters, gains: Gains, state: PidState, error: complex, dt: float
) -> tuple[complex, complex]:
    """PID in positional form with back-calculation (Astrom & Hagglund 2006).

    ``u = kp e + integral(ki e dt) + kd de/dt``, cut to ``parameters.limit`` without turning it;
    the part cut away drains the integral. The gain ki stands inside the integral: retuning it does
    not jolt the command.

    Args:
        parameters: Limit and tracking time.
        gains: Gains at this sample.
        state: What the last sample left; at the first, the error is its own past.
        error: Goal minus pose, in m or rad.
        dt: Sample time in s.

    Returns:
        The command in m/s or rad/s, and the integral part for the next sample.
    """
    integral = state.integral + gains.ki * dt * error
    wanted = gains.kp * error + integral + gains.kd / dt * (error - state.error)
    command = cut(wanted, parameters.limit)
    return command, drained(parameters.tracking_time, integral, command - wanted, dt)


def cut(wanted: Part, limit: float) -> Part:
    """``wanted`` made no greater than ``limit``, without turning it."""
    size = abs(wanted)
    return wanted * (limit / size) if size > limit else wanted


def drained(tracking_time: float, integral: Part, missing: Part, dt: float) -> Part:
    """Integral part of a command after it was cut: back-calculation (Astrom & Hagglund 2006).

    Args:
        tracking_time: Time in which the integral follows the cut command, in s.
        integral: Integral part before the cut, in the unit of the command.
        missing: The command as given minus as wanted.
        dt: Sample time in s.
    """
    return integral + min(1.0, dt / tracking_time) * missing


class TrackingParameters(NamedTuple):
    """Numbers of the preset `recommended`, for every axis: x and y (m, m/s), heading (rad, rad/s).

    Chosen on the paper's scenario (plant `rollers`, with and without noise, with a sample of delay)
    where the figures are flat, not where one of them is best. Each gain is ``middle +- reach``.
    """

    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 5.0
    """Rate at which errors decay, as in the feedforward controller. At 6 1/s a sample of delay lets
    the step response overshoot half as much again; at 4 1/s tracking is a tenth worse."""
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 1.0
    """Removes lasting errors in seconds; 2 1/s^2 gains nothing."""
    kd: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.05
    """Calms a late robot; 0.2 makes noise cost a quarter more effort."""
    kp_reach: Annotated[float, Bounds(0.0, 50.0, "1/s")] = 1.0
    """Greatest distance of the tuned kp from its middle: 4 to 6 1/s."""
    ki_reach: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] = 1.0
    """Likewise: 0 to 2 1/s^2."""
    kd_reach: Annotated[float, Bounds(0.0, 1.0, "1")] = 0.05
    """Likewise: 0 to 0.1."""
    error_range: Annotated[float, Bounds(1e-3, 100.0, "m or rad")] = 0.05
    """Error at which the first input of the fuzzy system reaches the end of its range, 1; beyond it
    the integral holds. Wide enough for what a good run shows; at 0.1 the start from rest winds the
    integral up, and ME grows by half a millimetre."""
    rate_range: Annotated[float, Bounds(1e-3, 100.0, "m/s or rad/s")] = 1.0
    """Rate of the error at which the second input does."""
    filter_time: Annotated[float, Bounds(0.0, 10.0, "s")] = 0.1
    """Time constant of the filter of that rate."""
    limit: Annotated[float, Bounds(0.01, 20.0, "m/s or rad/s")] = 1.5
    """Greatest correction, on top of the feedforward: the speed limit of the paper's predictive
    controller. It is what keeps a step response calm."""
    tracking_time: Annotated[float, Bounds(0.01, 10.0, "s")] = 0.5
    """Time in which the integral follows a correction that was cut."""


class TrackingState(NamedTuple):
    """What :func:`tracking_law` remembers from one sample to the next."""

    integral: float
    """Integral part of the correction, in m/s or rad/s."""
    rate: float
    """Filtered rate of the error, in m/s or rad/s."""


def filtered(filter_time: float, last: float, value: float, dt: float) -> float:
    """First-order filter, by backward Euler as in Astrom & Hagglund 2006: stable for every ``dt``.

    Args:
        filter_time: Time constant in s.
        last: Output at the last sample.
        value: Input at this one, in the unit of ``last``.
        dt: Sample time in s.
    """
    return last + dt / (filter_time + dt) * (value - last)


def fuzzy_inputs(parameters: TrackingParameters, error: float, rate: float) -> tuple[float, float]:
    """Error and its rate in parts of their ranges, clamped to [-1, 1]."""
    scaled_error, scaled_rate = error / parameters.error_range, rate / parameters.rate_range
    return min(max(scaled_error, -1.0), 1.0), min(max(scaled_rate, -1.0), 1.0)


def mirrored(error: float, change: float) -> tuple[float, float]:
    """Both inputs of the fuzzy system, seen from the side of negative errors.

    The paper's table is odd: an error of the other sign calls for the opposite change of gains, so
    left and right would be driven differently. On this side a great error raises kp and lowers ki.
    """
    return (-error, -change) if (error, change) > (0.0, 0.0) else (error, change)


def tuned_within_reach(parameters: TrackingParameters, change: GainChange) -> Gains:
    """Gains within reach of their middle, none negative: K = K0 + dK (Zhao et al. 1993)."""
    dkp, dki, dkd = change
    return Gains(
        max(0.0, parameters.kp + parameters.kp_reach / GREATEST_CHANGE * dkp),
        max(0.0, parameters.ki + parameters.ki_reach / GREATEST_CHANGE * dki),
        max(0.0, parameters.kd + parameters.kd_reach / GREATEST_CHANGE * dkd),
    )


def tracking_integral(
    parameters: TrackingParameters, ki: float, integral: float, error: float, dt: float
) -> float:
    """Integral part at this sample: it grows by ``ki e dt`` while the error is within its range.

    It is for small, lasting errors. A large one is the robot's start, a jump or a wild measurement,
    and what it left in the integral would have to be made up for by an error of the other sign
    (conditional integration, Astrom & Hagglund 2006).
    """
    return integral + ki * dt * error if abs(error) <= parameters.error_range else integral


def tracking_law(gains: Gains, integral: float, error: float, rate: float, dt: float) -> float:
    """Correction ``(1 - exp(-kp dt)) / dt e + integral + kd de/dt`` of a feedforward.

    The proportional part, held for ``dt``, leaves ``exp(-kp dt) e`` as the continuous law does, and
    so suits every sample time.

    Args:
        gains: Gains at this sample.
        integral: Integral part at this sample, in m/s or rad/s.
        error: Reference minus pose, in m or rad.
        rate: Filtered rate of the error, in m/s or rad/s.
        dt: Sample time in s.
    """
    return -expm1(-gains.kp * dt) / dt * error + integral + gains.kd * rate


def tracking_drained(
    parameters: TrackingParameters, integral: float, missing: float, dt: float
) -> float:
    """As :func:`drained`, towards zero and not past it.

    A correction is mostly cut because of its proportional part. The integral is not to make room
    for that by turning against it.
    """
    full = drained(parameters.tracking_time, integral, missing, dt)
    return min(max(full, min(integral, 0.0)), max(integral, 0.0))
