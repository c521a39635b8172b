"""Everything that can go wrong in a run, as data."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from omnidrive.parameter import Bounds

Seconds = Annotated[float, Bounds(0.0, 36_000.0, "s")]
Lasting = Annotated[float, Bounds(0.001, 36_000.0, "s")]
_Bearing = Annotated[float, Bounds(-2.0 * pi, 2.0 * pi, "rad")]
_Metres = Annotated[float, Bounds(-1000.0, 1000.0, "m")]
_WheelIndex = Annotated[int, Bounds(0, 63, "")]


class _Event(BaseModel):
    """Something that begins at a time."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    at: Seconds = 5.0
    """When it begins: at the first sample from then on."""

    @property
    def lasts(self) -> float | None:
        """For how long, in s; None: to the end, or it is over at once."""
        duration: float | None = getattr(self, "duration", None)
        return duration

    def holds(self, t: float) -> bool:
        """Whether it has begun and not ended at ``t`` (s)."""
        return self.at - _ROUNDING <= t and (
            self.lasts is None or t < self.at + self.lasts - _ROUNDING
        )


_ROUNDING = 1e-9  # s; k times a sample time is seldom quite what was written


class Push(_Event):
    """A blow to the body, through its centre."""

    kind: Literal["push"] = "push"
    speed: Annotated[float, Bounds(0.0, 10.0, "m/s")] = 0.5
    """By which it would change that of a robot that is free to move: the impulse over its mass."""
    direction: _Bearing = 0.5 * pi
    """Bearing of the blow in W."""


class Slope(_Event):
    """The floor rises."""

    kind: Literal["slope"] = "slope"
    angle: Annotated[float, Bounds(0.0, 0.5, "rad")] = 0.1
    direction: _Bearing = 0.5 * pi
    """Bearing in W in which it rises."""
    duration: Lasting | None = None


class PayloadShift(_Event):
    """A load comes to lie on the body, beside its centre."""

    kind: Literal["payload"] = "payload"
    share: Annotated[float, Bounds(0.001, 10.0, "1")] = 0.2
    """Its mass as a part of the robot's."""
    x: Annotated[float, Bounds(-2.0, 2.0, "1")] = 0.5
    """Where it lies in B, as a multiple of the wheels' distance from the centre."""
    y: Annotated[float, Bounds(-2.0, 2.0, "1")] = 0.0
    """As ``x``."""
    duration: Lasting | None = None


class SlipperyPatch(_Event):
    """A disc of floor has a friction of its own."""

    kind: Literal["patch"] = "patch"
    friction: Annotated[float, Bounds(0.001, 10.0, "1")] = 0.1
    radius: Annotated[float, Bounds(0.01, 1000.0, "m")] = 1.0
    x: _Metres | None = None
    """Of its centre in W; None: where the robot shall be when it begins."""
    y: _Metres | None = None
    """As ``x``."""
    duration: Lasting | None = None


class _WheelFault(_Event):
    wheel: _WheelIndex = 0
    """Which, counted from 0."""
    duration: Lasting | None = None


class DeadWheel(_WheelFault):
    """A wheel's motor gives no torque; the wheel turns freely."""

    kind: Literal["wheel-dead"] = "wheel-dead"


class LockedWheel(_WheelFault):
    """A wheel does not turn."""

    kind: Literal["wheel-locked"] = "wheel-locked"


class WeakWheel(_WheelFault):
    """A wheel's motor gives half its torque at most."""

    kind: Literal["wheel-weak"] = "wheel-weak"


class DeadEncoder(_WheelFault):
    """A wheel's encoder stands still in what it tells; the motor goes on as it was told."""

    kind: Literal["encoder-dead"] = "encoder-dead"


class PoseJump(_Event):
    """The robot is carried elsewhere at once."""

    kind: Literal["pose-jump"] = "pose-jump"
    distance: Annotated[float, Bounds(0.0, 100.0, "m")] = 0.5
    direction: _Bearing = 0.5 * pi
    """Bearing in W."""
    turn: _Bearing = 0.0
    """Counter-clockwise, about its own centre."""


class SilentSensor(_Event):
    """No measurement of the pose arrives."""

    kind: Literal["sensor-silent"] = "sensor-silent"
    duration: Lasting | None = 1.0


class PeriodJitter(_Event):
    """Samples come too early or too late: each after a time drawn anew."""

    kind: Literal["period-jitter"] = "period-jitter"
    spread: Annotated[float, Bounds(0.0, 0.9, "1")] = 0.5
    """Largest deviation, as a part of the sample time; all up to it are as likely."""
    duration: Lasting | None = None


class SolverOverrun(_Event):
    """Every command comes too late for its sample: until the next one, that before it is held."""

    kind: Literal["solver-overrun"] = "solver-overrun"
    duration: Lasting | None = 2.0


Fault = Annotated[
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
    | SolverOverrun,
    Field(discriminator="kind"),
]

FAULTS: dict[str, type[_Event]] = {
    "push": Push,
    "slope": Slope,
    "payload": PayloadShift,
    "patch": SlipperyPatch,
    "wheel-dead": DeadWheel,
    "wheel-locked": LockedWheel,
    "wheel-weak": WeakWheel,
    "encoder-dead": DeadEncoder,
    "pose-jump": PoseJump,
    "sensor-silent": SilentSensor,
    "period-jitter": PeriodJitter,
    "solver-overrun": SolverOverrun,
}
"""Every kind by its name."""

ON_THE_PLANT = (
    "push",
    "slope",
    "payload",
    "patch",
    "wheel-dead",
    "wheel-locked",
    "wheel-weak",
    "pose-jump",
)
"""Kinds that act on the robot itself; the others act on sensors and timing."""


_ANY: TypeAdapter[Fault] = TypeAdapter(Fault)


def make_fault(kind: str, values: Mapping[str, object]) -> Fault:
    """A fault of one of :data:`FAULTS`.

    Raises:
        pydantic.ValidationError: A value has no meaning.
    """
    return _ANY.validate_python({**values, "kind": kind})


def default_faults(at: float) -> tuple[Fault, ...]:
    """One of every kind, beginning at ``at`` (s)."""
    return tuple(make_fault(kind, {"at": at}) for kind in FAULTS)
