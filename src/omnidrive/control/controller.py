"""The interface of every controller."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.control.reduced_drive import ReducedDrive
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference


class Status(IntEnum):
    """How the controller computed its command."""

    OK = 0
    FALLBACK = 1
    """No converged solution in time; the command follows the best plan available."""
    FAILED = 2
    """No usable command; the run ends and the robot must be stopped."""


class Command(NamedTuple):
    """Body twist to hold until the next sample."""

    twist: BodyTwist
    """Commanded velocity of B in B; m/s, m/s, rad/s."""
    status: Status = Status.OK
    details: tuple[float, ...] = ()
    """Internal quantities for the log, in the order of :class:`DetailedController`'s
    ``detail_units``."""
    message: str = ""
    """Reason of the status ``FAILED``, or a traceback; may be empty."""


@runtime_checkable
class Controller(Protocol):
    """Maps state estimates to commands, once per sample.

    ``reset`` and then any number of ``step`` calls is one run. Two runs with the same inputs give
    the same commands: ``reset`` clears all memory, and there is no other source of state.

    Optional members:

    - ``prepare()``: compile or factorise before the first sample, see
      :class:`PreparableController`;
    - ``detail_units``: see :class:`DetailedController`;
    - ``with_reduced_drive(drive)``: see :class:`ReducibleController`.
    """

    def reset(self, state: State) -> None:
        """Clear all memory; the robot is at rest in ``state``."""
        ...

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command to hold on [t, t + dt), t in s, for the state estimated at ``t``."""
        ...


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
