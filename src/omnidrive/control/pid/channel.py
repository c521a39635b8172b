"""One controlled quantity: a fuzzy system, a PID law and its memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from omnidrive.control.pid.laws import (
    MemorylessParameters,
    PidState,
    SelfTuningParameters,
    memoryless_law,
    self_tuning_law,
    tuned,
)
from omnidrive.control.pid.type1 import GainChange

Tuner = Callable[[float, float], GainChange]
"""From the scaled size of the error and its scaled change to the changes of kp, ki and kd."""


@runtime_checkable
class Channel(Protocol):
    """Turns one error into one command, once every sample time."""

    def reset(self) -> None:
        """Forget the past."""
        ...

    def step(self, error: complex, size: float) -> complex:
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

    def step(self, error: complex, size: float) -> complex:
        """Command for this error; the last one counts as zero, so the change is all of it."""
        parameters = self.parameters
        change = self.tune(parameters.error_gain * size, parameters.change_gain * size)
        return memoryless_law(tuned(parameters, change), error)


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

    def step(self, error: complex, size: float) -> complex:
        """Command for this error."""
        parameters, state = self.parameters, self._state
        if state is None:
            state = PidState(0.0, error, size)
        rate = (size - state.size) / self.dt
        change = self.tune(parameters.error_gain * size, parameters.change_gain * rate)
        command, integral = self_tuning_law(
            parameters, tuned(parameters, change), state, error, self.dt
        )
        self._state = PidState(integral, error, size)
        return command
