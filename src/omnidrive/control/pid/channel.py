"""PID channels: one controlled quantity with its tuner, its parameters and its law.

The memory of a channel is a record within that of its controller. In kernels a channel is a
:class:`PackedChannel`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compilable
from omnidrive.control.compiled_law import floats_of
from omnidrive.control.pid.laws import (
    Gains,
    MemorylessParameters,
    SelfTuningParameters,
    SelfTuningState,
    TrackingParameters,
    TrackingState,
    fuzzy_inputs,
    low_pass,
    memoryless_law,
    mirror_to_negative,
    self_tuning_law,
    tracking_integral,
    tracking_law,
    tune_bounded_gains,
    tune_gains,
)
from omnidrive.control.pid.tuners import FuzzyTuner, PackedTuner, Tuner, gain_change, packed_tuner
from omnidrive.errors import InvalidInput
from omnidrive.parameter import bounds_of, check_bounds


class TuningRecord(NamedTuple):
    """Gains in use and inputs of the fuzzy system at one sample."""

    kp: float
    """Proportional gain in use; likewise ``ki`` and ``kd``. Units: :func:`tuning_units`."""
    ki: float
    kd: float
    error_input: float
    """Scaled error, before mirroring."""
    change_input: float
    """Scaled change of the error, before mirroring."""


Parameters = MemorylessParameters | SelfTuningParameters | TrackingParameters


def tuning_units(parameters: Parameters) -> dict[str, str]:
    """Return the unit of each field of :class:`TuningRecord` for these parameters."""
    bounds = bounds_of(type(parameters))
    return {
        name: bounds[name].unit or "1" if name in Gains._fields else "1"
        for name in TuningRecord._fields
    }


@runtime_checkable
class Channel(Protocol):
    """Maps one error to one command, once per sample time; a law of one's own, in Python."""

    @property
    def parameters(self) -> MemorylessParameters | SelfTuningParameters:
        """Gains and scales."""
        ...

    def reset(self) -> None:
        """Clear the memory."""
        ...

    def step(self, error: complex, magnitude: float) -> tuple[complex, TuningRecord]:
        """Return the command for an error.

        Args:
            error: Error in m (as a complex number for a vector) or rad.
            magnitude: Input of the tuner: length of a vector, or signed error of a coordinate.

        Returns:
            Command in m/s or rad/s, and the record of the tuning.
        """
        ...


@dataclass(frozen=True, slots=True)
class PidChannel:
    """One controlled quantity: its tuner, and its parameters, whose type determines the law.

    Attributes:
        tune: The fuzzy system.
        dt: Sample time in s.
        parameters: Gains, scales and limits.

    Raises:
        InvalidInput: A parameter is out of its range.
    """

    tune: Tuner
    dt: float
    parameters: Parameters

    def __post_init__(self) -> None:
        check_bounds(self.parameters)


class PackedChannel(NamedTuple):
    """A :class:`PidChannel` in kernels."""

    tune: PackedTuner
    dt: float
    parameters: Any


def packed_channel(channel: PidChannel | Channel) -> PackedChannel | None:
    """Return a channel for kernels; None: it or its tuner is not one of this package."""
    if not isinstance(channel, PidChannel):
        return None
    tune = packed_tuner(channel.tune)
    return None if tune is None else PackedChannel(tune, channel.dt, channel.parameters)


def inference_error(channel: PidChannel | Channel, record: TuningRecord) -> str:
    """Return the error of the fuzzy system of a channel in a sample; empty without one."""
    inputs = record.error_input, record.change_input
    if isinstance(channel, PidChannel) and isinstance(channel.tune, FuzzyTuner):
        is_mirrored = isinstance(channel.parameters, TrackingParameters)
        try:
            channel.tune(*(mirror_to_negative(*inputs) if is_mirrored else inputs))
        except InvalidInput as error:
            return str(error)
    return ""


SELF_TUNING_MEMORY = np.dtype(
    [("integral", "c16"), ("error", "c16"), ("magnitude", "f8"), ("started", "i8")], align=True
)
"""The fields of :class:`~.laws.SelfTuningState`, and whether there was a sample."""

TRACKING_MEMORY = floats_of(TrackingState)
"""The fields of :class:`~.laws.TrackingState`."""


@compilable
def memoryless_channel(
    channel: Any, memory: Any, error: complex, magnitude: float
) -> tuple[complex, TuningRecord]:
    """Return command and record; the previous error counts as zero: the change is the error."""
    p = channel.parameters
    inputs = (p.error_gain * magnitude, p.change_gain * magnitude)
    gains = tune_gains(p, gain_change(channel.tune, inputs[0], inputs[1]))
    return memoryless_law(gains, error), TuningRecord(
        gains.kp, gains.ki, gains.kd, inputs[0], inputs[1]
    )


@compilable
def self_tuning_channel(
    channel: Any, memory: Any, error: complex, magnitude: float
) -> tuple[complex, TuningRecord]:
    """Return command and record; ``memory`` is a record of :data:`SELF_TUNING_MEMORY`."""
    p, dt = channel.parameters, channel.dt
    if memory.started == 0:
        memory.error, memory.magnitude, memory.started = error, magnitude, 1
    inputs = (p.error_gain * magnitude, p.change_gain * ((magnitude - memory.magnitude) / dt))
    gains = tune_gains(p, gain_change(channel.tune, inputs[0], inputs[1]))
    before = SelfTuningState(memory.integral, memory.error, memory.magnitude)
    command, memory.integral = self_tuning_law(p, gains, before, error, dt)
    memory.error, memory.magnitude = error, magnitude
    return command, TuningRecord(gains.kp, gains.ki, gains.kd, inputs[0], inputs[1])


def own_channel(
    channel: Channel, memory: Any, error: complex, magnitude: float
) -> tuple[complex, TuningRecord]:
    """Return command and record of a channel that is not one of this package, in Python only."""
    return channel.step(error, magnitude)


def channel_law(channel: PidChannel | Channel) -> Callable[..., tuple[complex, TuningRecord]]:
    """Return the law of a channel of a :class:`~.FuzzyPidController`."""
    if not isinstance(channel, PidChannel):
        return own_channel
    is_memoryless = isinstance(channel.parameters, MemorylessParameters)
    return memoryless_channel if is_memoryless else self_tuning_channel


@compilable
def tracking_channel(  # noqa: PLR0917
    channel: Any, memory: Any, error: float, rate: float, missing: float, distance: float
) -> tuple[float, TuningRecord]:
    """Return the desired correction in m/s or rad/s, and the record of the tuning.

    Args:
        channel: A :class:`PidChannel` with :class:`~.laws.TrackingParameters`.
        memory: A record of :data:`TRACKING_MEMORY`.
        error: Reference minus pose, in m or rad.
        rate: Rate of the error, in m/s or rad/s.
        missing: Predicted minus measured mean velocity since the previous sample; m/s or rad/s.
        distance: Magnitude of the error; that of the vector for x and y.
    """
    p, dt = channel.parameters, channel.dt
    before = TrackingState(memory.integral, memory.missing, memory.rate, memory.distance)
    rate = low_pass(p.filter_time, before.rate, rate, dt)
    inputs = fuzzy_inputs(p, error, rate)
    mirrored = mirror_to_negative(inputs[0], inputs[1])
    gains = tune_bounded_gains(p, gain_change(channel.tune, mirrored[0], mirrored[1]))
    integral, filtered = tracking_integral(p, gains, before, distance, missing, dt)
    memory.integral, memory.missing = integral, filtered
    memory.rate, memory.distance = rate, distance
    correction = tracking_law(p, gains, integral, error, distance, rate, dt)
    return correction, TuningRecord(gains.kp, gains.ki, gains.kd, inputs[0], inputs[1])


@compilable
def write_tuning(records: tuple[TuningRecord, ...], details: Float[Array, " details"]) -> None:
    """Fill in the details of a command: the records of the channels, one after another."""
    i = 0
    for record in records:
        for value in record:
            details[i] = value
            i += 1
