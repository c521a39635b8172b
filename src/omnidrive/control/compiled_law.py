"""The interface between a controller and compiled closed loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, runtime_checkable

from omnidrive.control.controller import Controller


class SetpointWindow(NamedTuple):
    """Times of the setpoints of the reference that a law needs in each sample."""

    first: float
    """Time of the first setpoint after the sample, s."""
    length: int
    """Number of setpoints."""
    spacing: float
    """Time between them, s."""


class CompiledLaw(NamedTuple):
    """The law of a controller for a loop over samples in compiled code.

    ``step(data, memory, t, pose, setpoints, command, details)`` is a kernel that computes what the
    controller's ``step`` does for the same inputs:

    - ``data``: :attr:`data`, not changed;
    - ``memory``: the floats that the law keeps from one sample to the next, all zero at the start
      of a run; a law that needs more than these takes views of them;
    - ``t``: time of the sample, s; ``pose``: estimated pose of B in W, as ``Pose``;
    - ``setpoints``: one row per setpoint of :attr:`window`, columns as in ``Reference.window``; of
      the motion that the controller tracks, if it retimes references;
    - ``command``, filled in: body twist, m/s, m/s, rad/s;
    - ``details``, filled in: as ``Command.details``.

    It returns the :class:`~omnidrive.control.Status` as an integer. The loop itself treats commands
    that are not finite as :class:`~omnidrive.control.guarded_controller.GuardedController` does.
    """

    step: Callable[..., int]
    """The kernel; one object per law, so that its loop is compiled once."""
    data: Any
    """Parameters: a named tuple of numbers, arrays and named tuples."""
    memory: int
    """Number of floats of the memory."""
    window: SetpointWindow


@runtime_checkable
class CompilableController(Controller, Protocol):
    """A :class:`Controller` whose law can be called from compiled loops."""

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law, with the controller's parameters; None: these cannot be compiled."""
        ...
