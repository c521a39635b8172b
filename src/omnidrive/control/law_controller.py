"""A base class of controllers whose step calls their law."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import entry_point
from omnidrive.control.compiled_law import (
    UNKNOWN_TWIST,
    UNKNOWN_VARIANCES,
    CompiledLaw,
    SampleState,
)
from omnidrive.control.controller import Command, Status
from omnidrive.control.guarded_controller import GuardedController
from omnidrive.control.preparation import run_once
from omnidrive.errors import InvalidReference
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Reference

_STATUSES = tuple(Status)
_CACHED = ("_law", "_call")  # made again in a copy: machine code is valid in its process only


class LawController(GuardedController):
    """A :class:`GuardedController` that computes a command with its :class:`CompiledLaw`; abstract.

    The law receives the pose of a state, neither its twist nor its covariance. A law that cannot be
    compiled runs in Python, by the same function.
    """

    @property
    def detail_units(self) -> Mapping[str, str]:
        """Name and unit of each detail of a command; here none."""
        return {}

    @abstractmethod
    def compiled_law(self) -> CompiledLaw | None:
        """Return the law with the controller's parameters; None: these cannot be compiled."""

    def law_in_python(self) -> CompiledLaw:
        """Return the law for parameters that cannot be compiled: see :func:`.in_python`.

        A controller that returns no compiled law overrides it.
        """
        raise NotImplementedError

    def prepare(self) -> None:
        """Compile the kernels of a step."""
        run_once(self)

    def reset(self, state: State) -> None:
        """Clear the memory."""
        vars(self)["_memory"] = deepcopy(self._law.memory)

    def compute(self, t: float, state: State, reference: Reference) -> Command:
        """Return the command for the state estimated at ``t`` (s); only its pose is used."""
        now = SampleState(t, state.pose, UNKNOWN_TWIST, UNKNOWN_VARIANCES, 0.0, 0.0, 0)
        setpoints = self._setpoints(t, reference)
        command, details = self._outputs
        code = self._call(self._law.data, self._memory, now, setpoints, command, details)
        twist = BodyTwist(*command.tolist())
        return Command(twist, _STATUSES[code], tuple(details.tolist()))

    def _setpoints(self, t: float, reference: Reference) -> Float[Array, "setpoints 6"]:
        """Return the setpoints of the law's window."""
        first, length, spacing, _ = self._law.window
        if length == 1:
            pose, twist = reference.at(t + first)
            return np.array(((*pose, *twist),), dtype=float)
        rows = np.ascontiguousarray(reference.window(t + first, length, spacing), dtype=float)
        if rows.shape != (length, 6):
            raise InvalidReference(
                f"window must return {length} rows of 6 numbers, got an array of shape {rows.shape}"
            )
        return rows

    @cached_property
    def _law(self) -> CompiledLaw:
        return self.compiled_law() or self.law_in_python()

    @cached_property
    def _memory(self) -> Any:
        return deepcopy(self._law.memory)

    @cached_property
    def _outputs(self) -> tuple[Array, Array]:
        """Command and details of a step."""
        return np.zeros(3), np.zeros(len(self.detail_units))

    @cached_property
    def _call(self) -> Callable[..., int]:
        if not hasattr(self._law.step, "py_func"):  # it is not compiled
            return self._law.step
        now = SampleState(0.0, (0.0, 0.0, 0.0), UNKNOWN_TWIST, UNKNOWN_VARIANCES, 0.0, 0.0, 0)
        rows = np.zeros((self._law.window.length, 6))
        return entry_point(self._law.step, self._law.data, self._memory, now, rows, *self._outputs)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in _CACHED}
