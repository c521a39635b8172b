"""PID channels: one controlled quantity with its tuner, its law and its memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.control.pid.laws import (
    GainChange,
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
from omnidrive.parameter import bounds_of, check_bounds

Tuner = Callable[[float, float], GainChange]
"""Maps the scaled error and its scaled change to the changes of kp, ki and kd."""


def no_tuning(error: float, change: float) -> GainChange:
    """Return zero changes, a :data:`Tuner` for constant gains: a classical PID."""
    return (0.0, 0.0, 0.0)


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
    """Maps one error to one command, once per sample time."""

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
class MemorylessChannel:
    """A :class:`Channel` with :func:`memoryless_law`.

    Attributes:
        tune: The fuzzy system.
        parameters: Gains and scales.

    Raises:
        InvalidInput: A parameter is out of its range.
    """

    tune: Tuner
    parameters: MemorylessParameters

    def __post_init__(self) -> None:
        check_bounds(self.parameters)

    def reset(self) -> None:
        """Do nothing: the law has no memory."""

    def step(self, error: complex, magnitude: float) -> tuple[complex, TuningRecord]:
        """Return the command; the previous error counts as zero: the change equals the error."""
        parameters = self.parameters
        inputs = (parameters.error_gain * magnitude, parameters.change_gain * magnitude)
        gains = tune_gains(parameters, self.tune(*inputs))
        return memoryless_law(gains, error), TuningRecord(*gains, *inputs)


@dataclass(slots=True)
class SelfTuningChannel:
    """A :class:`Channel` with :func:`self_tuning_law`.

    Attributes:
        tune: The fuzzy system.
        dt: Sample time in s.
        parameters: Gains, scales and limits.

    Raises:
        InvalidInput: A parameter is out of its range.
    """

    tune: Tuner
    dt: float
    parameters: SelfTuningParameters
    _state: SelfTuningState | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_bounds(self.parameters)

    def reset(self) -> None:
        """Clear the memory."""
        self._state = None

    def step(self, error: complex, magnitude: float) -> tuple[complex, TuningRecord]:
        """Return the command for an error."""
        parameters, state = self.parameters, self._state
        if state is None:
            state = SelfTuningState(0.0, error, magnitude)
        rate = (magnitude - state.magnitude) / self.dt
        inputs = (parameters.error_gain * magnitude, parameters.change_gain * rate)
        gains = tune_gains(parameters, self.tune(*inputs))
        command, integral = self_tuning_law(parameters, gains, state, error, self.dt)
        self._state = SelfTuningState(integral, error, magnitude)
        return command, TuningRecord(*gains, *inputs)


_INITIAL = TrackingState(0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class TrackingChannel:
    """One coordinate of a :class:`TrackingPidController`, with :func:`tracking_law`.

    Attributes:
        tune: The fuzzy system.
        dt: Sample time in s.
        parameters: Gains, ranges and limits.

    Raises:
        InvalidInput: A parameter is out of its range.
    """

    tune: Tuner
    dt: float
    parameters: TrackingParameters
    _state: TrackingState = field(default=_INITIAL, init=False)

    def __post_init__(self) -> None:
        check_bounds(self.parameters)

    def reset(self) -> None:
        """Clear the memory."""
        self._state = _INITIAL

    def step(
        self, error: float, rate: float, missing: float, distance: float
    ) -> tuple[float, TuningRecord]:
        """Return the desired correction in m/s or rad/s.

        Args:
            error: Reference minus pose, in m or rad.
            rate: Rate of the error, in m/s or rad/s.
            missing: Predicted minus measured mean velocity since the previous sample; m/s or rad/s.
            distance: Magnitude of the error; that of the vector for x and y.
        """
        parameters, state, dt = self.parameters, self._state, self.dt
        rate = low_pass(parameters.filter_time, state.rate, rate, dt)
        inputs = fuzzy_inputs(parameters, error, rate)
        gains = tune_bounded_gains(parameters, self.tune(*mirror_to_negative(*inputs)))
        integral, filtered = tracking_integral(parameters, gains, state, distance, missing, dt)
        self._state = TrackingState(integral, filtered, rate, distance)
        correction = tracking_law(parameters, gains, integral, error, distance, rate, dt)
        return correction, TuningRecord(*gains, *inputs)
