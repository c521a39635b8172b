"""Parameters of the PID controllers in scenarios: gains of both channels, and the fuzzy system."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, TypeVar

from omnidrive.choices import PresetName
from omnidrive.components.fields import PresetDefaults
from omnidrive.control.pid.fuzzy_options import FuzzyOptions, IntervalFuzzyOptions
from omnidrive.control.pid.laws import (
    MemorylessParameters,
    SelfTuningParameters,
    TrackingParameters,
)
from omnidrive.control.pid.tuners import Preset, resolved_options
from omnidrive.errors import InvalidInput, suggestion
from omnidrive.parameter import Bounds

HEADING_BRAKING_SHARE = 0.1
"""Share of the yaw acceleration with which `recommended` turns to a distant heading: the position
needs most of the wheels' forces at the same time."""

Law = TypeVar("Law", MemorylessParameters, SelfTuningParameters, TrackingParameters)


@dataclass(frozen=True)
class ChannelOptions(PresetDefaults):
    """Gains of one channel of a PID controller. None: the value of the preset."""

    kp: Annotated[float, Bounds(0.0, 50.0, "1/s")] | None = None
    """Proportional gain."""
    ki: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] | None = None
    """Integral gain."""
    kd: Annotated[float, Bounds(0.0, 1.0, "1")] | None = None
    """Derivative gain."""
    tracking_time: Annotated[float, Bounds(0.01, 10.0, "s")] | None = None
    """Preset `paper`: time constant of the back-calculation of the integral."""
    filter_time: Annotated[float, Bounds(0.0, 10.0, "s")] | None = None
    """Preset `recommended`: time constant of the filter of the rate of the error."""
    braking_share: Annotated[float, Bounds(0.01, 1.0)] | None = None
    """Preset `recommended`: share of the acceleration that approaches a distant target."""

    def applied(self, law: Law, where: str, preset: str) -> Law:
        """Return the parameters of a law with the given values.

        Args:
            law: Parameters of the preset.
            where: Name of the channel, for messages.
            preset: Name of the preset, for messages.

        Raises:
            InvalidInput: The law of the preset has no such parameter.
        """
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        given = {name: value for name, value in given.items() if value is not None}
        for name in given:
            if name not in law._fields:
                known = [each.name for each in fields(self) if each.name in law._fields]
                raise InvalidInput(
                    f"{where}.{name}: the preset {preset} has no such parameter"
                    f"{suggestion(name, known, maximum=len(known))}"
                )
        return law._replace(**given)

    def resolved(self, law: Law, where: str, preset: str) -> ChannelOptions:
        """Return the options with every parameter of the law; arguments as of :meth:`applied`."""
        used = self.applied(law, where, preset)
        names = [each.name for each in fields(self) if each.name in used._fields]
        return replace(self, **{name: getattr(used, name) for name in names})


@dataclass(frozen=True)
class FuzzyChannelOptions(ChannelOptions):
    """Gains of one channel, and how the fuzzy system tunes them. None: the value of the preset."""

    tuning: Annotated[float, Bounds(0.0, 100.0, "1/s, 1/s^2, 1")] | None = None
    """Presets `paper` and `published-code`: scale from an output of the fuzzy system, within +-0.1,
    to the deviation of a gain."""
    error_gain: Annotated[float, Bounds(0.0, 10.0, "1/m or 1/rad")] | None = None
    """The same presets: scale from the error to the first input of the fuzzy system."""
    change_gain: Annotated[float, Bounds(0.0, 10.0, "s/m or s/rad")] | None = None
    """The same presets: scale from the rate of the error (`published-code`: its change per sample)
    to the second input."""
    kp_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s")] | None = None
    """Preset `recommended`: greatest deviation of the tuned kp."""
    ki_deviation: Annotated[float, Bounds(0.0, 50.0, "1/s^2")] | None = None
    """Preset `recommended`: greatest deviation of the tuned ki."""
    kd_deviation: Annotated[float, Bounds(0.0, 1.0, "1")] | None = None
    """Preset `recommended`: greatest deviation of the tuned kd."""
    error_range: Annotated[float, Bounds(1e-3, 100.0, "m or rad")] | None = None
    """Preset `recommended`: error at which the first input of the fuzzy system reaches 1."""
    rate_range: Annotated[float, Bounds(1e-3, 100.0, "m/s or rad/s")] | None = None
    """Preset `recommended`: rate of the error at which the second input reaches 1."""


Channels = tuple[ChannelOptions, ChannelOptions]
"""Options of the channels of position and heading."""


@dataclass(frozen=True)
class _Preset(PresetDefaults):
    """The preset of a PID controller."""

    preset: PresetName | None = None
    """Parameters from the text of the paper, from its published code, or recommended values. None:
    the preset of the scenario."""

    def plain(self) -> dict[str, Any]:
        """Return the preset, and the other parameters that have a value."""
        return {"preset": self.preset, **super().plain()}


@dataclass(frozen=True)
class PidOptions(_Preset):
    """Parameters of the PID controller with constant gains."""

    position: ChannelOptions = field(default_factory=ChannelOptions)
    """Channel of the position."""
    heading: ChannelOptions = field(default_factory=ChannelOptions)
    """Channel of the heading."""

    @property
    def channels(self) -> Channels:
        """Options of the channels of position and heading."""
        return self.position, self.heading

    def resolved(self, preset: PresetName) -> PidOptions:
        """Return the parameters with the values that a scenario with ``preset`` uses.

        Raises:
            InvalidInput: A parameter does not belong to the preset.
        """
        return replace(self, **_resolved(self.channels, self.preset or preset))


@dataclass(frozen=True)
class FuzzyPidOptions(_Preset):
    """Parameters of the PID controller that a type-1 fuzzy system tunes."""

    position: FuzzyChannelOptions = field(default_factory=FuzzyChannelOptions)
    """Channel of the position."""
    heading: FuzzyChannelOptions = field(default_factory=FuzzyChannelOptions)
    """Channel of the heading."""
    fuzzy: FuzzyOptions = field(default_factory=FuzzyOptions)
    """Membership functions and rules of the fuzzy system."""

    @property
    def channels(self) -> Channels:
        """Options of the channels of position and heading."""
        return self.position, self.heading

    def resolved(self, preset: PresetName) -> FuzzyPidOptions:
        """Return the parameters with the values that a scenario with ``preset`` uses.

        Raises:
            InvalidInput: A parameter does not belong to the preset.
        """
        chosen = self.preset or preset
        fuzzy = resolved_options(self.fuzzy, system_preset(chosen))
        return replace(self, **_resolved(self.channels, chosen), fuzzy=fuzzy)


@dataclass(frozen=True)
class IntervalFuzzyPidOptions(FuzzyPidOptions):
    """Parameters of the PID controllers that an interval type-2 or type-3 fuzzy system tunes."""

    fuzzy: IntervalFuzzyOptions = field(default_factory=IntervalFuzzyOptions)
    """Membership functions, footprint of uncertainty and rules of the fuzzy system."""


def system_preset(preset: PresetName) -> Preset:
    """Return the preset of the fuzzy system: `recommended` has that of the paper."""
    return "paper" if preset == "recommended" else preset


def _resolved(channels: Channels, preset: PresetName) -> dict[str, Any]:
    """Return the channels with all parameters of the laws of a preset."""
    position: Any
    heading: Any
    if preset == "recommended":
        position = TrackingParameters()
        heading = TrackingParameters(braking_share=HEADING_BRAKING_SHARE)
    else:
        law = SelfTuningParameters if preset == "paper" else MemorylessParameters
        position = heading = law()
    return {
        "preset": preset,
        "position": channels[0].resolved(position, "position", preset),
        "heading": channels[1].resolved(heading, "heading", preset),
    }
