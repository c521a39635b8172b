"""The interface between a controller and compiled closed loops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import nan
from types import SimpleNamespace
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.control.controller import Controller


class SampleState(NamedTuple):
    """State estimate of one sample as numbers; see :class:`~omnidrive.estimation.State`."""

    t: float
    """Time of the sample, s."""
    pose: tuple[float, float, float]
    """Pose of B in W; m, m, rad."""
    twist: tuple[float, float, float]
    """Velocity of B in B; m/s, m/s, rad/s. NaN: unknown."""
    variances: tuple[float, float, float]
    """Variances of the pose error in B; m^2, m^2, rad^2. Negative: unknown."""
    fix_age: float
    """Time since the last pose fix, s."""
    delay: float
    """Delay of the motion that the controller tracks behind the reference, s."""
    last: int
    """Number of setpoints after the first one that are not later than the end of that motion."""


_FLOAT = np.dtype(float).itemsize

UNKNOWN_TWIST = (nan, nan, nan)
UNKNOWN_VARIANCES = (-1.0, -1.0, -1.0)


class SetpointWindow(NamedTuple):
    """Times of the setpoints of the reference that a law needs in each sample."""

    first: float
    """Time of the first setpoint after the sample, s."""
    length: int
    """Number of setpoints."""
    spacing: float
    """Time between them, s."""
    ahead: bool = False
    """Whether they are those of a :class:`~.reference_window.ReferenceWindow`, which evaluates a
    reference for many samples at once; ``spacing`` is then the sample time."""


class CompiledLaw(NamedTuple):
    """The law of a controller for a loop over samples in compiled code.

    ``step(data, memory, now, setpoints, command, details)`` is a kernel that computes what the
    controller's ``step`` does for the same inputs:

    - ``data``: :attr:`data`, not changed;
    - ``memory``: what the law keeps from one sample to the next, arrays with the structure and
      shapes of :attr:`memory`; all zero at the start of a run;
    - ``now``: time and state estimate of the sample, as :class:`SampleState`;
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
    memory: Any
    """Example of the memory: an array of floats or of one record (an aligned structured type of
    numbers of eight bytes), or a named tuple of such examples."""
    window: SetpointWindow


def in_python(law: CompiledLaw) -> CompiledLaw:
    """Return a law, whose memory is one record, as Python executes it: for data of any objects.

    The record is then an object with the same attributes, which is faster than NumPy's.
    """
    plain = getattr(law.step, "py_func", law.step)

    def step(*arguments: Any) -> int:
        """Execute the law in Python, with the arguments of its kernel."""
        data, memory, now, setpoints, command, details = arguments
        code: int = plain(data, memory, now, setpoints.tolist(), command, details)
        return code

    return law._replace(step=step, memory=(_object_of(law.memory.dtype),))


def _object_of(record: np.dtype[Any]) -> Any:
    """Return an object with the names of a type of records, or a zero of a type of numbers."""
    if record.names is None:
        return record.type(0).item()
    return SimpleNamespace(**{name: _object_of(record[name]) for name in record.names})


@runtime_checkable
class CompilableController(Controller, Protocol):
    """A :class:`Controller` whose law can be called from compiled loops."""

    def compiled_law(self) -> CompiledLaw | None:
        """Return the law, with the controller's parameters; None: these cannot be compiled."""
        ...


def floats_of(kind: Any) -> np.dtype[Any]:
    """Return the type of a record of floats with the names of a named tuple, for a memory."""
    return np.dtype([(name, "f8") for name in kind._fields], align=True)


def leaves(memory: Any) -> Iterator[Array]:
    """Yield the arrays of a memory: an array, or a named tuple of memories."""
    if isinstance(memory, np.ndarray):
        yield memory
    else:
        for each in memory:
            yield from leaves(each)


def size_in_floats(memory: Any) -> int:
    """Return the number of floats that take as many bytes as a memory."""
    return sum(each.nbytes for each in leaves(memory)) // _FLOAT


def views(memory: Any, floats: Float[Array, " floats"]) -> Any:
    """Return consecutive parts of ``floats`` with structure, types and shapes of a memory."""
    if isinstance(memory, np.ndarray):
        return floats[: size_in_floats(memory)].view(memory.dtype).reshape(memory.shape)
    parts, begin = [], 0
    for each in memory:
        parts.append(views(each, floats[begin:]))
        begin += size_in_floats(each)
    return type(memory)(*parts)
