"""Scheduling of this process for a real-time loop."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple

PRIORITY = 50
"""Priority with SCHED_FIFO, 1 to 99; interrupt threads of PREEMPT_RT kernels have 50."""
_PRIORITY_BELOW = 40
SWITCH_INTERVAL = 2e-4
"""Time after which other threads give the interpreter to the loop, s; 5 ms by default."""
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
    the thread has the policy SCHED_FIFO, which nothing that it starts inherits, and optionally one
    processor; other threads of this process give the interpreter away sooner. What the system does
    not allow is left out; it is named in the yielded list.

    Args:
        cpu: Number of the processor to run on; None: any.
    """
    enabled, interval = gc.isenabled(), sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    gc.collect()
    gc.freeze()
    gc.disable()
    before = _scheduling()
    try:
        yield [
            Measure("garbage collector frozen"),
            _tried("memory locked", _lock_memory),
            _tried("timers exact", lambda: _call("prctl", _PR_SET_TIMERSLACK, 1, 0, 0, 0)),
            _tried("SCHED_FIFO", lambda: _set_fifo(PRIORITY)),
            *([_tried(f"processor {cpu}", lambda: _pin(cpu))] if cpu is not None else []),
        ]
    finally:
        with suppress(OSError, AttributeError):
            _call("munlockall")
        _restore(before)
        sys.setswitchinterval(interval)
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


def schedule_below_loop() -> None:
    """Give this thread a priority below that of the loop and above other programs, if allowed.

    For threads of the loop's process, which the loop waits for while they have the interpreter, and
    for simulated robots, which like real ones do not wait for other programs.
    """
    with suppress(OSError, AttributeError):
        _set_fifo(_PRIORITY_BELOW)


def _set_fifo(priority: int) -> None:
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK  # what it starts does not inherit it
    os.sched_setscheduler(0, policy, os.sched_param(priority))


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
