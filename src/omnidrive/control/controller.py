"""The one interface that every controller satisfies."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Reference


class Status(IntEnum):
    """How the controller arrived at its command."""

    OK = 0
    FALLBACK = 1
    """No converged solution in time: the best known plan is followed."""
    FAILED = 2
    """No usable command: the loop must stop the robot."""


class Command(NamedTuple):
    """What the controller asks of the robot until the next step."""

    twist: BodyTwist
    status: Status = Status.OK
    details: tuple[float, ...] = ()
    """Inner numbers worth a log, in the order of :class:`DetailedController`'s ``detail_units``."""


@runtime_checkable
class Controller(Protocol):
    """Maps measured poses to commands, once every sample time.

    ``reset`` then any number of ``step`` calls is one run. Two runs of the same inputs give
    the same commands: all memory is cleared by ``reset`` and no other source of state exists.
    """

    def reset(self, pose: Pose) -> None:
        """Forget the past; the robot now stands at ``pose``."""
        ...

    def step(self, t: float, pose: Pose, reference: Reference) -> Command:
        """Command to hold on [t, t + dt), given the pose measured at ``t`` (s)."""
        ...


@runtime_checkable
class DetailedController(Controller, Protocol):
    """A :class:`Controller` whose commands carry details, each of which becomes a column of a log.

    A controller without details just leaves this out.
    """

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each of ``Command.details``, in their order; ``1``: without unit."""
        ...
