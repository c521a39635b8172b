"""Scheduling of this process for a real-time loop."""

from __future__ import annotations

import ctypes
import gc
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

PRIORITY = 50
"""Priority with SCHED_FIFO, 1 to 99; interrupt threads of PREEMPT_RT kernels have 50."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2  # of mlockall(2)
_PR_SET_TIMERSLACK = 29  # of prctl(2)


class Measure(NamedTuple):
    """One measure for punctuality, and whether the system allows it."""

    name: str
    """What was asked for."""
    refusal: str = ""
    """Why it was refused; empty: it is in force."""

    def __str__(self) -> str:
        """Format as one line."""
        return f"{self.name}: {'no (' + self.refusal + ')' if self.refusal else 'yes'}"


@contextmanager
def realtime(*, cpu: int | None = None) -> Iterator[list[Measure]]:
    """Prepare this process for a real-time loop, and undo it at the end.

    The garbage collector is off and what exists is frozen, the memory is locked, timers are exact,
    the thread has the policy SCHED_FIFO, and optionally one processor. What the system does not
    allow is left out; it is named in the yielded list.

    Args:
        cpu: Number of the processor to run on; None: any.
    """
    enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    before = _scheduling()
    try:
        yield [
            Measure("garbage collector frozen"),
            _tried("memory locked", _lock_memory),
            _tried("timers exact", lambda: _call("prctl", _PR_SET_TIMERSLACK, 1, 0, 0, 0)),
            _tried("SCHED_FIFO", _set_fifo),
            *([_tried(f"processor {cpu}", lambda: _pin(cpu))] if cpu is not None else []),
        ]
    finally:
        with suppress(OSError, AttributeError):
            _call("munlockall")
        _restore(before)
        gc.unfreeze()
        if enabled:
            gc.enable()


def _tried(name: str, action: Callable[[], object]) -> Measure:
    try:
        action()
    except (OSError, AttributeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        return Measure(name, reason.lower())
    return Measure(name)


def _call(function: str, *arguments: int) -> None:
    """Call a function of the C library; raise OSError if it fails."""
    library = ctypes.CDLL(None, use_errno=True)
    if getattr(library, function)(*arguments) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def _lock_memory() -> None:
    _call("mlockall", _MCL_CURRENT | _MCL_FUTURE)


def _set_fifo() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))


def _pin(cpu: int | None) -> None:
    os.sched_setaffinity(0, {cpu or 0})


def _scheduling() -> tuple[int, os.sched_param, set[int]] | None:
    if not hasattr(os, "sched_getscheduler"):
        return None
    return os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)


def _restore(before: tuple[int, os.sched_param, set[int]] | None) -> None:
    if before is not None:
        policy, parameter, processors = before
        with suppress(OSError):
            os.sched_setscheduler(0, policy, parameter)
            os.sched_setaffinity(0, processors)
