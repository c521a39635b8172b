"""What the PID controllers have in common: channels, whose tuners may be those of the user."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

from omnidrive.control.compiled_law import CompiledLaw, in_python
from omnidrive.control.controller import Command
from omnidrive.control.law_controller import LawController
from omnidrive.control.pid.channel import (
    Channel,
    TuningRecord,
    inference_error,
    packed_channel,
    tuning_units,
)
from omnidrive.estimation import State


class ChannelController(LawController):
    """A :class:`~.law_controller.LawController` with channels; abstract."""

    axes: ClassVar[tuple[str, ...]]
    """Names of the attributes that hold the channels."""

    @abstractmethod
    def law_of(self, *channels: Any) -> CompiledLaw:
        """Return the law with these channels, of kernels or of Python."""

    @property
    def channels(self) -> list[Any]:
        """The channels, in the order of :attr:`axes`."""
        return [getattr(self, axis) for axis in self.axes]

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Units of the gains in use and of the fuzzy inputs, per channel."""
        return {
            f"{name}_{axis}": unit
            for axis, channel in zip(self.axes, self.channels, strict=True)
            for name, unit in tuning_units(channel.parameters).items()
        }

    def reset(self, state: State) -> None:
        """Clear the memory."""
        super().reset(state)
        for each in self.channels:
            if isinstance(each, Channel):
                each.reset()

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law for compiled loops; None for other channels or tuners than ours."""
        packed = [packed_channel(each) for each in self.channels]
        return None if None in packed else self.law_of(*packed)

    def law_in_python(self) -> CompiledLaw:
        """Return the law for channels or tuners of the user."""
        return in_python(self.law_of(*self.channels))

    def failure(self, command: Command) -> str:
        """Return the error of the first fuzzy system that has one, else as other controllers."""
        records = zip(*[iter(command.details)] * len(TuningRecord._fields), strict=True)
        reasons = map(inference_error, self.channels, map(TuningRecord._make, records))
        return next(filter(None, reasons), super().failure(command))
