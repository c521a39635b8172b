"""PID laws whose gains a fuzzy system tunes: pure functions of numbers.

An error is a complex number, so that one law serves a vector of the plane, ``e_x + i e_y``, and a
single coordinate, whose imaginary part is zero. The fuzzy system sees its size: the distance of a
vector, the signed value of a coordinate.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from omnidrive.control.pid.type1 import GainChange
from omnidrive.parameter import Bounds


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
    size = abs(wanted)
    command = wanted * (parameters.limit / size) if size > parameters.limit else wanted
    follow = min(1.0, dt / parameters.tracking_time)
    return command, integral + follow * (command - wanted)
