"""The kinds of disturbances and faults, as data."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, pi
from typing import Annotated, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from omnidrive.choices import FaultKind
from omnidrive.parameter import TIME_TOLERANCE, Bounds

_StartTime = Annotated[float, Bounds(0.0, 36_000.0, "s")]
_Duration = Annotated[float, Bounds(0.001, 36_000.0, "s")]
_Bearing = Annotated[float, Bounds(-2.0 * pi, 2.0 * pi, "rad")]
_Metres = Annotated[float, Bounds(-1000.0, 1000.0, "m")]
_WheelIndex = Annotated[int, Bounds(0, 63, "")]


class _BaseFault(BaseModel):
    """A disturbance or fault that starts at a given time."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    at: _StartTime = 5.0
    """Start time; it acts from the first sample at or after it."""

    @property
    def _active_duration(self) -> float | None:
        """Duration, s; None if it acts until the end of the run or only once."""
        duration: float | None = getattr(self, "duration", None)
        return duration

    @property
    def active_span(self) -> tuple[float, float]:
        """Times s and e: it acts at s <= t < e, s."""
        duration = self._active_duration
        end = inf if duration is None else self.at + duration - TIME_TOLERANCE
        return self.at - TIME_TOLERANCE, end

    def is_active(self, t: float) -> bool:
        """Return whether it acts at ``t`` (s)."""
        start, end = self.active_span
        return start <= t < end


class Push(_BaseFault):
    """An impulse on the body through the origin of B."""

    kind: Literal["push"] = "push"
    speed: Annotated[float, Bounds(0.0, 10.0, "m/s")] = 0.5
    """Impulse over the robot's mass: the change of velocity of a robot that moves freely."""
    direction: _Bearing = 0.5 * pi
    """Bearing of the impulse in W."""


class Slope(_BaseFault):
    """An inclined floor."""

    kind: Literal["slope"] = "slope"
    angle: Annotated[float, Bounds(0.0, 0.5, "rad")] = 0.1
    """Inclination."""
    direction: _Bearing = 0.5 * pi
    """Bearing in W in which the floor rises."""
    duration: _Duration | None = None
    """Duration; None: until the end of the run."""


class PayloadShift(_BaseFault):
    """A point mass that is placed on the body at the height of its centre of mass."""

    kind: Literal["payload"] = "payload"
    share: Annotated[float, Bounds(0.001, 10.0, "1")] = 0.2
    """Mass as a share of the robot's mass."""
    x: Annotated[float, Bounds(-2.0, 2.0, "1")] = 0.5
    """Position in B, as a multiple of the mean distance of the wheels from the origin."""
    y: Annotated[float, Bounds(-2.0, 2.0, "1")] = 0.0
    """Position in B, as a multiple of the same distance."""
    duration: _Duration | None = None
    """Duration; None: until the end of the run."""


class SlipperyPatch(_BaseFault):
    """A disc of floor with its own friction."""

    kind: Literal["patch"] = "patch"
    friction: Annotated[float, Bounds(0.001, 10.0, "1")] = 0.1
    """Coulomb coefficient."""
    radius: Annotated[float, Bounds(0.01, 1000.0, "m")] = 1.0
    """Radius."""
    x: _Metres | None = None
    """Centre in W; None: the reference position at the start time."""
    y: _Metres | None = None
    """Centre in W; None: the reference position at the start time."""
    duration: _Duration | None = None
    """Duration; None: until the end of the run."""


class _WheelFault(_BaseFault):
    """A fault of one wheel."""

    wheel: _WheelIndex = 0
    """Index of the wheel, from 0."""
    duration: _Duration | None = None
    """Duration; None: until the end of the run."""


class DeadWheel(_WheelFault):
    """A motor without torque; its wheel turns freely."""

    kind: Literal["wheel-dead"] = "wheel-dead"


class LockedWheel(_WheelFault):
    """A wheel that does not turn."""

    kind: Literal["wheel-locked"] = "wheel-locked"


class WeakWheel(_WheelFault):
    """A motor whose torque limit is halved."""

    kind: Literal["wheel-weak"] = "wheel-weak"


class DeadEncoder(_WheelFault):
    """A wheel encoder that reports nothing; the motor still follows its commands."""

    kind: Literal["encoder-dead"] = "encoder-dead"


class PoseJump(_BaseFault):
    """A sudden displacement of the robot, as if it were lifted and put down."""

    kind: Literal["pose-jump"] = "pose-jump"
    distance: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.5
    """Distance."""
    direction: _Bearing = 0.5 * pi
    """Bearing of the displacement in W."""
    turn: _Bearing = 0.0
    """Rotation about the origin of B, counter-clockwise."""


class SilentSensor(_BaseFault):
    """No pose fixes are taken."""

    kind: Literal["sensor-silent"] = "sensor-silent"
    duration: _Duration | None = 1.0
    """Duration; None: until the end of the run."""


class PeriodJitter(_BaseFault):
    """Random sample times."""

    kind: Literal["period-jitter"] = "period-jitter"
    spread: Annotated[float, Bounds(0.0, 0.9, "1")] = 0.5
    """Largest deviation of a sample time from its nominal value, as a share of it; uniformly
    distributed."""
    duration: _Duration | None = None
    """Duration; None: until the end of the run."""


class SolverOverrun(_BaseFault):
    """Controllers miss their deadline: in every sample the previous command is held."""

    kind: Literal["solver-overrun"] = "solver-overrun"
    duration: _Duration | None = 2.0
    """Duration; None: until the end of the run."""


_AnyFault = (
    Push
    | Slope
    | PayloadShift
    | SlipperyPatch
    | DeadWheel
    | LockedWheel
    | WeakWheel
    | DeadEncoder
    | PoseJump
    | SilentSensor
    | PeriodJitter
    | SolverOverrun
)
Fault = Annotated[_AnyFault, Field(discriminator="kind")]

FAULTS: dict[FaultKind, type[_BaseFault]] = {
    each.model_fields["kind"].default: each for each in get_args(_AnyFault)
}
"""Every kind of fault by its name."""

PLANT_FAULTS = (
    "push",
    "slope",
    "payload",
    "patch",
    "wheel-dead",
    "wheel-locked",
    "wheel-weak",
    "pose-jump",
)
"""Kinds that act on the plant; the others act on sensors and timing."""


_ANY: TypeAdapter[Fault] = TypeAdapter(Fault)


def make_fault(kind: str, values: Mapping[str, object]) -> Fault:
    """Return a fault of a kind in :data:`FAULTS`.

    Raises:
        pydantic.ValidationError: A value is unknown, out of bounds or of the wrong type.
    """
    return _ANY.validate_python({**values, "kind": kind})


def default_faults(at: float) -> tuple[Fault, ...]:
    """Return one fault of every kind with start time ``at`` (s) and default values."""
    return tuple(make_fault(kind, {"at": at}) for kind in FAULTS)
