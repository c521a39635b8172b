"""A base class of controllers whose law receives usable times and poses only."""

from __future__ import annotations

from abc import ABC, abstractmethod
from math import isfinite

from omnidrive.control.controller import Command, Status
from omnidrive.estimation import State
from omnidrive.estimation.state import are_usable
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference

_STOP = BodyTwist(0.0, 0.0, 0.0)


class GuardedController(ABC):
    """A :class:`~omnidrive.control.Controller` that survives bad numbers; abstract.

    A time or pose that is not usable (:func:`~omnidrive.estimation.state.are_usable`) does not
    reach the law: :meth:`fall_back` gives the command, whose status is not ``OK``, and the memory
    is that before the step. If the law itself computes a command that is not finite, for example
    because of the reference, the controller is reset.
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
        return Command(_STOP, Status.FAILED, message=f"its law gave {command.value}")

    def fall_back(self, reason: str) -> Command:
        """Return the command of a step in which the law cannot compute one; here ``FAILED``."""
        return Command(_STOP, Status.FAILED, message=reason)
