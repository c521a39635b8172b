"""Guard of the calls of users' parts: exceptions and stalls end the run, not the program."""

from __future__ import annotations

from types import TracebackType

from omnidrive.control import pipeline
from omnidrive.control.time_limit import SharedTimer, TimedOut, TimeLimit
from omnidrive.errors import (
    PART_ERRORS,
    OmnidriveError,
    PlantLost,
    failure_reason,
    one_line,
    traceback_text,
)
from omnidrive.simulation.run import Outcome

PART_TIMEOUT = 120.0
"""Wall-clock time, s, after which a call of a plant, of sensors or of a reference counts as
stalled. The first call may compile kernels."""
_MAX_REASON = 500  # characters


class RunEnded(Exception):
    """The run ends before its reference.

    Attributes:
        outcome: Why the run ends.
        reason: Reason in one line; may be empty.
        traceback: Traceback of the exception of a part; empty without one.
    """

    def __init__(self, outcome: Outcome, reason: str = "", traceback: str = "") -> None:
        super().__init__(reason)
        self.outcome, self.reason, self.traceback = outcome, reason, traceback


def run_timer() -> SharedTimer:
    """Return the timer for the time limits of all calls of a run."""
    return SharedTimer(min(pipeline.STEP_TIMEOUT, PART_TIMEOUT) / 10.0)


class Guard:
    """Context manager that ends the run for an exception of a user's part in its block.

    Args:
        outcome: Outcome of the run after an exception other than :class:`PlantLost`.
        starting: Whether an :class:`OmnidriveError` is raised as it is: before the first step it
            concerns every run.
        call: Name of the call, for the message about a part that stalls.
        t: Time of the call, s, for that message; None: before the first sample.
        limit: Longest wall-clock time of the block, s, see :class:`TimeLimit`; None: no limit.

    Raises:
        RunEnded: In place of the exception.
    """

    __slots__ = ("_call", "_limit", "_outcome", "_seconds", "_starting", "_t")

    def __init__(
        self,
        outcome: Outcome,
        *,
        starting: bool = False,
        call: str = "",
        t: float | None = None,
        limit: float | None = None,
    ) -> None:
        self._outcome, self._starting, self._call, self._t = outcome, starting, call, t
        self._seconds, self._limit = limit, TimeLimit(limit) if limit is not None else None

    def __enter__(self) -> None:
        if self._limit is not None:
            self._limit.__enter__()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._limit is not None:
            self._limit.__exit__()
        if error is None:
            return
        if isinstance(error, PlantLost):
            raise RunEnded(Outcome.PLANT_LOST, one_line(str(error), _MAX_REASON)) from None
        if isinstance(error, OmnidriveError) and not self._starting:
            raise RunEnded(self._outcome, one_line(str(error), _MAX_REASON)) from None
        if isinstance(error, TimedOut):
            at = "" if self._t is None else f" at {self._t:g} s"
            reason = f"its {self._call}{at} took longer than {self._seconds:g} s"
            raise RunEnded(self._outcome, reason) from None
        if isinstance(error, PART_ERRORS) and not isinstance(error, RunEnded | OmnidriveError):
            raise RunEnded(self._outcome, failure_reason(error), traceback_text(error)) from None
