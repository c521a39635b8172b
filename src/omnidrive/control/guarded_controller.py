"""A base class of controllers whose law receives usable times and poses only."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import isfinite

from omnidrive.control.controller import Command, failed_command
from omnidrive.estimation import State
from omnidrive.estimation.state import are_usable
from omnidrive.reference import Reference


class GuardedController(ABC):
    """A :class:`~omnidrive.control.Controller` that survives bad numbers; abstract.

    A time or pose that is not usable (:func:`~omnidrive.estimation.state.are_usable`) does not
    reach the law: :meth:`fall_back` gives the command, whose status is not ``OK``, and only it may
    change the memory. If the law itself computes a command that is not finite, for example because
    of the reference, the step fails and the controller is reset.
    """

    __slots__ = ()

    @abstractmethod
    def reset(self, state: State) -> None:
        """Clear all memory; the robot is at rest in ``state``."""

    @abstractmethod
    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command of the law, see :meth:`step`, for a usable time and pose."""

    def step(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command to hold on [t, t + dt), t in s, for the state estimated at ``t``."""
        if not are_usable(t, state.pose):
            return self.fall_back(f"no usable time or pose: {t:g} s, {state.pose}")
        command = self.compute(t, state, reference)
        if isfinite(sum(command.value)):
            return command
        self.reset(state)
        return failed_command(self.failure(command))

    def failure(self, command: Command) -> str:
        """Return why the law gave a command that is not finite."""
        return f"its law gave {command.value}"

    def fall_back(self, reason: str) -> Command:
        """Return the command of a step in which the law cannot compute one; here ``FAILED``."""
        return failed_command(reason)
