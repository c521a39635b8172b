"""The interface between a controller and the safety of its robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol, runtime_checkable

from omnidrive.control.controller import Command, Controller
from omnidrive.estimation import SensorReadings, State
from omnidrive.geometry import Pose


class Event(NamedTuple):
    """A fault, a finding or a reaction during a run."""

    t: float
    """Time of the event, s."""
    what: str
    """Description in one line."""


@runtime_checkable
class Supervisor(Protocol):
    """Checks the estimate before the controller's step and limits the command after it.

    Call ``reset`` at the start of a run, then ``check`` and ``limit`` in turn, once per sample.
    """

    @property
    def controller(self) -> Controller | None:
        """Controller that replaces that of ``reset``; None: no replacement."""
        ...

    @property
    def stopped(self) -> str | None:
        """Reason for which the robot is being stopped; None: it is not being stopped."""
        ...

    @property
    def at_rest(self) -> bool:
        """Whether the robot has been stopped and its command is zero."""
        ...

    @property
    def events(self) -> Sequence[Event]:
        """Findings and reactions since ``reset``, in order."""
        ...

    def reset(self, controller: Controller) -> None:
        """Start a run with ``controller``."""
        ...

    def check(self, t: float, readings: SensorReadings, state: State, target: Pose) -> State:
        """Check the robot at ``t`` (s) and return the state for the controller.

        Args:
            t: Time, s.
            readings: Sensor readings up to ``t``.
            state: Estimate from these readings.
            target: Reference pose at ``t``.
        """
        ...

    def limit(self, command: Command, dt: float) -> Command:
        """Return the command to send to the robot for ``dt`` (s) instead of ``command``."""
        ...


class NullSupervisor:
    """A supervisor that checks nothing and limits nothing."""

    stopped: str | None = None
    at_rest = False
    events: tuple[Event, ...] = ()
    controller: Controller | None = None

    def reset(self, controller: Controller) -> None:
        """Do nothing: there is no memory."""

    def check(self, t: float, readings: SensorReadings, state: State, target: Pose) -> State:
        """Return ``state``."""
        return state

    def limit(self, command: Command, dt: float) -> Command:
        """Return ``command``."""
        return command
