"""Time limit of calls in the main thread."""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType

_TICKS = 10
_CLEAN_UP = 0.05  # s for the code that the exception ends, until it is raised again
_AGAIN = 0.001  # s from then on


class TimedOut(BaseException):
    """A call was interrupted; no ``Exception``, so that code with ``except Exception`` ends too."""


class TimeLimit:
    """Context manager that raises :class:`TimedOut` in its block after some wall-clock time.

    Python code and waiting calls such as ``time.sleep`` are interrupted; code of another language
    is interrupted when it returns. The time is counted in ticks of a timer, a tenth of the limit or
    those of a :class:`SharedTimer`. A process that is stopped (SIGSTOP, a suspended computer)
    misses all but one: that is no time of the call. The exception is raised again after 50 ms, and
    then every millisecond, until the block ends: so it can release what it holds, but not go on.

    Nothing is interrupted in a thread other than the main one, on a system without ``SIGALRM``, if
    the program uses this signal itself, and in a debugger.

    Args:
        seconds: Limit, s.

    Attributes:
        armed: Whether the block is interrupted.
        over: Whether the time is over.
    """

    __slots__ = ("_own", "_seconds", "_ticks", "armed", "over")

    def __init__(self, seconds: float) -> None:
        self._seconds, self._ticks = seconds, 0
        self._own: SharedTimer | None = None
        self.armed = self.over = False

    def __enter__(self) -> TimeLimit:
        if not _timers:
            self._own = SharedTimer(self._seconds / _TICKS)
            self._own.__enter__()
        self.armed = bool(_timers) and threading.current_thread() is threading.main_thread()
        if self.armed:
            _active.append(self)
        return self

    def __exit__(self, *_: object) -> None:
        if self.armed:
            _active.remove(self)
        if self._own is not None:
            self._own.__exit__()
        elif self.over and _timers:
            _timers[0].start()

    def tick(self, period: float) -> None:
        """Count ``period`` (s)."""
        self._ticks += 1
        whole = self._ticks if self._own is not None else self._ticks - 1  # the first is cut
        self.over = whole * period > 0.999 * self._seconds


class SharedTimer:
    """Context manager that runs one timer for all time limits in its block.

    A limit with a timer of its own costs two system calls, which is more than many blocks take.
    Within another such context, and where nothing can be interrupted, it does nothing.

    Args:
        period: Period of the timer, s.
    """

    __slots__ = ("_period",)

    def __init__(self, period: float) -> None:
        self._period = period

    def __enter__(self) -> None:
        if not _timers and _can_interrupt():
            _timers.append(self)
            signal.signal(signal.SIGALRM, self._on_alarm)
            self.start()

    def start(self, first: float | None = None) -> None:
        """Start the timer, whose first tick is after ``first`` (s), by default one period."""
        signal.setitimer(signal.ITIMER_REAL, first or self._period, self._period)

    def __exit__(self, *_: object) -> None:
        if self in _timers:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            _timers.clear()

    def _on_alarm(self, _number: int, frame: FrameType | None) -> None:
        """Count the time of the limits; raise TimedOut, except in an exit and in a debugger."""
        was_over = any(limit.over for limit in _active)
        if not was_over:
            for limit in _active:
                limit.tick(self._period)
        is_over = any(limit.over for limit in _active)
        leaving = frame is not None and frame.f_code.co_name == "__exit__"
        if is_over and not leaving and sys.gettrace() is None:
            self.start(_AGAIN if was_over else _CLEAN_UP)
            raise TimedOut


_timers: list[SharedTimer] = []
"""The timer that runs; empty without one."""
_active: list[TimeLimit] = []
"""The limits of the blocks that are executed."""


def _can_interrupt() -> bool:
    """Return whether blocks of this thread can be interrupted."""
    return (
        hasattr(signal, "setitimer")
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL
    )
