"""The interface of every controller."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum
from math import inf, isclose, isfinite
from numbers import Real
from typing import ClassVar, NamedTuple, Protocol, TypeVar, runtime_checkable

import numpy as np

from omnidrive.components.calls import call_fault
from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.errors import InvalidInput, kind_of, one_line
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference

_MAX_SAMPLES = 100_000
_ROUNDING = 1e-3


class Status(IntEnum):
    """How the controller computed its command."""

    OK = 0
    FALLBACK = 1
    """No converged solution in time, or no usable estimate or command in this sample; the command
    follows the best plan, the last estimate or the last command."""
    FAILED = 2
    """No usable command; the run ends and the robot must be stopped."""


_Values = TypeVar("_Values", bound="_WheelValues")


class _WheelValues(tuple[float, ...]):
    """One number per wheel in the order of the robot's mounts, with the wheel matrix's signs."""

    __slots__ = ()
    noun: ClassVar[str]

    def __new__(cls: type[_Values], values: Iterable[float]) -> _Values:
        """Take one value per wheel from a list, a tuple or an array."""
        return super().__new__(cls, map(float, values))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({list(self)})"


class WheelSpeeds(_WheelValues):
    """Speed of each wheel, rad/s, in the order of the robot's mounts.

    The signs are those of the wheel matrix: ``WheelSpeeds(robot.chassis.wheel_speeds(twist))`` are
    the speeds that produce ``twist`` without slip.
    """

    __slots__ = ()
    noun = "wheel speeds"


class WheelTorques(_WheelValues):
    """Torque of each motor at its wheel, N m, in the order of the robot's mounts.

    The signs are those of the wheel matrix J, so that without slip the torques exert the wrench
    ``J^T torques`` (force along x and y and moment about z, in B) on the robot: by the principle of
    virtual work, ``wrench . twist = torques . (J twist)``.
    """

    __slots__ = ()
    noun = "wheel torques"


CommandValue = BodyTwist | WheelSpeeds | WheelTorques
"""What a plant can be commanded to do."""


class Command(NamedTuple):
    """Body twist, wheel speeds or wheel torques to hold until the next sample.

    Every plant executes a body twist; ``capabilities`` of a plant tell whether it takes wheel
    speeds and wheel torques too.
    """

    value: CommandValue
    """Velocity of B in B (m/s, m/s, rad/s), or speeds (rad/s) or torques (N m) of the wheels."""
    status: Status = Status.OK
    details: tuple[float, ...] = ()
    """Internal quantities for the log, in the order of :class:`DetailedController`'s
    ``detail_units``."""
    message: str = ""
    """Reason of the status ``FAILED``, in the first line; more lines, such as a traceback, may
    follow. May be empty."""

    @property
    def twist(self) -> BodyTwist | None:
        """The body twist; None for a command of wheel speeds or torques."""
        return self.value if isinstance(self.value, BodyTwist) else None


STOP = BodyTwist(0.0, 0.0, 0.0)
"""The twist of a robot at rest."""


def failed_command(message: str) -> Command:
    """Return zero twist with the status ``FAILED`` and this reason."""
    return Command(STOP, Status.FAILED, message=message)


@runtime_checkable
class Controller(Protocol):
    """Maps state estimates to commands, once per sample.

    ``reset`` and then any number of ``step`` calls is one run. Two runs with the same inputs give
    the same commands: ``reset`` clears all memory, and there is no other source of state.

    Optional members:

    - ``prepare()``: compile or factorise before the first sample, see
      :class:`PreparableController`;
    - ``dt``: sample time for which the controller is built, s; a loop of another one is refused;
    - ``detail_units``: see :class:`DetailedController`;
    - ``with_reduced_drive(drive)``: see :class:`ReducibleController`;
    - ``compiled_law()``: for batches, see :class:`~.compiled_law.CompilableController`;
    - ``retime(reference)``: see :class:`RetimingController`;
    - ``command_limits(reference)``: see :class:`LimitedController`.
    """

    def reset(self, state: State) -> None:
        """Clear all memory; the robot is at rest in ``state``."""
        ...

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command to hold on [t, t + dt), t in s, for the state estimated at ``t``."""
        ...


def check_controller(controller: object, dt: float) -> None:
    """Check an object that is to control a robot in a loop with a sample time of ``dt`` (s).

    Raises:
        InvalidInput: It is a class, has no ``reset`` or ``step``, one of them takes other
            arguments, or it is built for another sample time.
    """
    if isinstance(controller, type):
        raise InvalidInput(
            f"the controller is the class {controller.__name__}: pass an object, such as "
            f"{controller.__name__}()"
        )
    needed = ("reset", "step")
    missing = [name for name in needed if not callable(getattr(controller, name, None))]
    if missing:
        raise InvalidInput(
            f"a controller needs the methods reset(state) and step(t, state, reference): "
            f"{type(controller).__name__} has no {' and no '.join(missing)}"
        )
    calls = {"reset": ("state",), "step": ("t", "state", "reference")}
    for name, arguments in calls.items():
        fault = call_fault(getattr(controller, name), arguments, unbound=False)
        if fault:
            raise InvalidInput(f"{type(controller).__name__}: {one_line(fault)}")
    built_for = getattr(controller, "dt", None)
    if isinstance(built_for, Real) and not isclose(built_for, dt, rel_tol=1e-6):
        raise InvalidInput(
            f"the controller is built for a sample time of {built_for:g} s, but the loop runs with "
            f"dt={dt:g} s: build the controller with dt={dt:g}, or simulate with dt={built_for:g}"
        )


@runtime_checkable
class PreparableController(Controller, Protocol):
    """A :class:`Controller` with work to do before its first sample."""

    def prepare(self) -> None:
        """Compile kernels and allocate memory, so that no later ``step`` has to.

        It may be called more than once and leaves the controller as after ``reset``.
        """
        ...


@runtime_checkable
class DetailedController(Controller, Protocol):
    """A :class:`Controller` whose commands carry details, each of which is a column of the log."""

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each of ``Command.details``, in their order; ``1`` if dimensionless."""
        ...


@runtime_checkable
class ReducibleController(Controller, Protocol):
    """A :class:`Controller` that can plan without the failed wheels of a robot."""

    def with_reduced_drive(self, drive: ReducedDrive) -> Controller:
        """Return a controller in the same state that plans with the driving wheels only."""
        ...


class Retiming(NamedTuple):
    """Motion that a controller tracks instead of a reference."""

    reference: Reference
    """The motion; the reference itself if the robot can follow it in time."""
    notice: str = ""
    """Why it is another one, in one line; empty: it is not."""


@runtime_checkable
class RetimingController(Controller, Protocol):
    """A :class:`Controller` that follows a reference later where the robot cannot be in time."""

    def retime(self, reference: Reference) -> Retiming:
        """Return the motion that is tracked instead of ``reference``; called after ``reset``."""
        ...


class CommandLimits(NamedTuple):
    """Largest motion that a controller commands; infinite: it has no limit of its own."""

    speed: float = inf
    """Largest speed of the origin of B, in m/s."""
    yaw_rate: float = inf
    """Largest magnitude of the yaw rate, in rad/s."""


@runtime_checkable
class LimitedController(Controller, Protocol):
    """A :class:`Controller` that cannot follow a reference which is faster than its limits."""

    def command_limits(self, reference: Reference) -> CommandLimits:
        """Return the largest motion that is commanded on ``reference``."""
        ...


FALLS_BEHIND = ": the robot falls behind"
"""End of every text of :func:`limits_notice`."""


def limits_notice(controller: LimitedController, reference: Reference, dt: float) -> str:
    """Return which limits of a controller a reference exceeds, in one line; empty: none.

    Args:
        controller: The controller.
        reference: The motion to track; it is evaluated at every sample.
        dt: Sample time, s.
    """
    limits = controller.command_limits(reference)
    if not isinstance(limits, CommandLimits):
        raise TypeError(f"command_limits must return CommandLimits, not {kind_of(limits)}")
    if not isfinite(min(limits)):
        return ""
    count = min(round(reference.duration / dt), _MAX_SAMPLES) + 1
    vx, vy, yaw_rate = np.abs(reference.window(0.0, count, dt)[:, 3:]).T
    peaks = CommandLimits(float(np.hypot(vx, vy).max()), float(yaw_rate.max()))
    excesses = [
        f"{what} up to {peak:.3g} {unit}, and the controller commands at most {limit:.3g} {unit}"
        for what, unit, peak, limit in zip(
            ("moves at", "turns at"), ("m/s", "rad/s"), peaks, limits, strict=True
        )
        if peak > (1.0 + _ROUNDING) * limit
    ]
    return f"the reference {'; it '.join(excesses)}{FALLS_BEHIND}" if excesses else ""
