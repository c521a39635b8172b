"""One controlled quantity: a fuzzy system, a PID law and its memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.control.pid.laws import (
    GainChange,
    Gains,
    MemorylessParameters,
    PidState,
    SelfTuningParameters,
    TrackingParameters,
    TrackingState,
    filtered,
    fuzzy_inputs,
    memoryless_law,
    mirrored,
    self_tuning_law,
    tracking_drained,
    tracking_integral,
    tracking_law,
    tuned,
    tuned_within_reach,
)
from omnidrive.parameter import bounds_of

Tuner = Callable[[float, float], GainChange]
"""From the scaled size of the error and its scaled change to the changes of kp, ki and kd."""


def no_tuning(error: float, change: float) -> GainChange:
    """A :data:`Tuner` that leaves the gains where they are: a classical PID."""
    return (0.0, 0.0, 0.0)


class Tuning(NamedTuple):
    """What the fuzzy system did at one sample."""

    kp: float
    """Gain in use; likewise ``ki`` and ``kd``. Units: :func:`tuning_units`."""
    ki: float
    kd: float
    error_input: float
    """Scaled error, before any mirroring."""
    change_input: float
    """Scaled change of the error, likewise."""


Parameters = MemorylessParameters | SelfTuningParameters | TrackingParameters


def tuning_units(parameters: Parameters) -> dict[str, str]:
    """Unit of each field of :class:`Tuning` under these parameters."""
    bounds = bounds_of(type(parameters))
    return {
        name: bounds[name].unit or "1" if name in Gains._fields else "1" for name in Tuning._fields
    }


@runtime_checkable
class Channel(Protocol):
    """Turns one error into one command, once every sample time."""

    @property
    def parameters(self) -> MemorylessParameters | SelfTuningParameters:
        """Gains and scales."""
        ...

    def reset(self) -> None:
        """Forget the past."""
        ...

    def step(self, error: complex, size: float) -> tuple[complex, Tuning]:
        """Command in m/s or rad/s for an error in m or rad, and its size as the tuner sees it."""
        ...


@dataclass(frozen=True, slots=True)
class MemorylessChannel:
    """A :class:`Channel` around :func:`memoryless_law`.

    Attributes:
        tune: The fuzzy system.
        parameters: Gains and scales.
    """

    tune: Tuner
    parameters: MemorylessParameters

    def reset(self) -> None:
        """Do nothing: the law has no memory."""

    def step(self, error: complex, size: float) -> tuple[complex, Tuning]:
        """Command for this error; the last one counts as zero, so the change is all of it."""
        parameters = self.parameters
        inputs = (parameters.error_gain * size, parameters.change_gain * size)
        gains = tuned(parameters, self.tune(*inputs))
        return memoryless_law(gains, error), Tuning(*gains, *inputs)


@dataclass(slots=True)
class SelfTuningChannel:
    """A :class:`Channel` around :func:`self_tuning_law`.

    Attributes:
        tune: The fuzzy system.
        dt: Sample time in s.
        parameters: Gains, scales and limits.
    """

    tune: Tuner
    dt: float
    parameters: SelfTuningParameters
    _state: PidState | None = field(default=None, init=False)

    def reset(self) -> None:
        """Forget the past."""
        self._state = None

    def step(self, error: complex, size: float) -> tuple[complex, Tuning]:
        """Command for this error."""
        parameters, state = self.parameters, self._state
        if state is None:
            state = PidState(0.0, error, size)
        rate = (size - state.size) / self.dt
        inputs = (parameters.error_gain * size, parameters.change_gain * rate)
        gains = tuned(parameters, self.tune(*inputs))
        command, integral = self_tuning_law(parameters, gains, state, error, self.dt)
        self._state = PidState(integral, error, size)
        return command, Tuning(*gains, *inputs)


_REST = TrackingState(0.0, 0.0)


@dataclass(slots=True)
class TrackingChannel:
    """One coordinate of a :class:`TrackingPidController`, around :func:`tracking_law`.

    Attributes:
        tune: The fuzzy system.
        dt: Sample time in s.
        parameters: Gains, ranges and limits.
    """

    tune: Tuner
    dt: float
    parameters: TrackingParameters
    _state: TrackingState = field(default=_REST, init=False)

    def reset(self) -> None:
        """Forget the past."""
        self._state = _REST

    def step(self, error: float, rate: float) -> tuple[float, Tuning]:
        """Correction wanted, in m/s or rad/s, for an error in m or rad and its rate."""
        parameters, state, dt = self.parameters, self._state, self.dt
        rate = filtered(parameters.filter_time, state.rate, rate, dt)
        inputs = fuzzy_inputs(parameters, error, rate)
        gains = tuned_within_reach(parameters, self.tune(*mirrored(*inputs)))
        integral = tracking_integral(parameters, gains.ki, state.integral, error, dt)
        self._state = TrackingState(integral, rate)
        return tracking_law(gains, integral, error, rate, dt), Tuning(*gains, *inputs)

    def lose(self, missing: float) -> None:
        """Be told how much was cut from the correction: as given minus as wanted."""
        integral, rate = self._state
        integral = tracking_drained(self.parameters, integral, missing, self.dt)
        self._state = TrackingState(integral, rate)
